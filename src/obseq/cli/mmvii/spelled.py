"""`obseq mmvii`: the commands of MMVII in its own spelling, on a project in this folder."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.gencode import generate
from obseq.cli.parsing import Commands, add_command, meant
from obseq.errors import InputError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence

    from obseq.project.options.spelling import Spelling

HELP = ("-help", "-Help", "--help", "-h", "help", "Help")
MORE = """
COMMAND is one of MMVII's; its options are Name=Value, with lists in brackets.
Without a command, all are listed. COMMAND -help shows its arguments, -Help an example too."""
EXAMPLE = """\
example:
  obseq mmvii ImportGCP inputs/coords.cor ANXYZ InitRTL ChSys=[L93,RTL] Sigma=0.001 Comment=*

exit code: that of the command here that does it"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "MMVII's commands, as MMVII's users type them"
    command = add_command(commands, "mmvii", run, purpose, MORE, EXAMPLE)
    command.add_argument("words", nargs="*", metavar="COMMAND ARGUMENTS")


def run(arguments: argparse.Namespace) -> int:
    """List the commands; words of one are put in ours before they are parsed."""
    print(listing(), end="")
    return 0


def as_mmvii(words: Sequence[str], run_ours: Callable[[Sequence[str]], int]) -> int:
    """Run what MMVII's users type by our command for it; its folders get their names of 2024 too."""
    from obseq.project.layout import give_old_names

    ours = in_our_words(words)
    if not ours:
        return 0
    code = generate(ours[1:]) if ours[0] == "gencode" else run_ours(ours)
    give_old_names(Path())
    return code


def in_our_words(words: Sequence[str]) -> list[str]:
    """Our words for those that MMVII's users type; none where they ask for help, which is printed."""
    from obseq.project.options.spelling import IDLE, in_our_words

    if not words or words[0] in HELP:
        print(listing(), end="")
        return []
    name, *given = words
    spelling = _named(name)
    if any(word in HELP for word in given):
        print(explained(spelling, with_example="-Help" in given), end="")
        return []
    if not spelling.ours:
        raise InputError(f"{name}: it {spelling.about}")
    ours, idle = in_our_words(spelling, given)
    for option in idle:
        print(f"{option} has no effect here: {IDLE[option]}", file=sys.stderr)
    return [*spelling.ours.split(), *ours]


def listing() -> str:
    """All commands, with a line each."""
    from obseq.project.options.spellings import SPELLINGS

    width = max(len(spelling.name) for spelling in SPELLINGS)
    return "".join(f"{spelling.name:<{width}}  {spelling.about}\n" for spelling in SPELLINGS)


def explained(spelling: Spelling, *, with_example: bool) -> str:
    """The arguments and options of a command."""
    from obseq.project.options.spelling import IDLE, usage

    lines = [f"{spelling.name} {spelling.about}", "", *usage(spelling).splitlines()]
    width = max((len(option.name) for option in spelling.options), default=0)
    lines += [f"  {option.name:<{width}}  {option.about}" for option in spelling.options]
    if spelling.ours:
        lines += ["", f"here: obseq {spelling.ours}; {' '.join(IDLE)} have no effect"]
    lines += [spelling.differs] if spelling.differs else []
    lines += ["example:", f"  {spelling.example}"] if with_example and spelling.example else []
    return "".join(f"{line}\n" for line in lines)


def _named(name: str) -> Spelling:
    """The command of a name.

    Raises:
        InputError: there is none; the nearest is told.
    """
    from obseq.project.options.spellings import BY_NAME

    if name in BY_NAME:
        return BY_NAME[name]
    raise InputError(
        f"MMVII's command {name} has no counterpart here{meant(name, BY_NAME)} (`obseq mmvii` lists them)"
    )
