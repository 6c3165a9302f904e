"""What the subcommands share when they declare their arguments."""

import argparse
import math
import os
import re
import sys
from collections.abc import Callable, Collection, Iterable
from copy import copy
from functools import partial
from pathlib import Path
from typing import Any, NoReturn, TextIO, TypeAlias

from obseq.arguments import EXTREME
from obseq.writing import STANDARD_OUTPUT

Commands: TypeAlias = "argparse._SubParsersAction[CommandParser]"
CHOICE = re.compile(r"invalid choice: '?(?P<word>[^' ]+)'? \(choose from (?P<known>.*)\)")
"""What argparse says of a word that is none of those it takes."""
CLAUSE = re.compile(r" \(|[;:.] |, for instance")
"""What ends the first clause of a help."""
CANNOT_RUN = 2
"""Exit code of a line that is wrong."""
Run = Callable[[argparse.Namespace], int]


def add_command(
    commands: Commands,
    name: str,
    run: Run,
    purpose: str,
    more: str = "",
    example: str | None = None,
    *,
    exits: str = "",
    common: Collection[str] = (),
) -> "CommandParser":
    """Add a subcommand.

    Args:
        commands: Where it is added.
        name: What the user types.
        run: What it does; returns the exit code.
        purpose: Its line in the list of commands, and the beginning of its help.
        more: The rest of the description.
        example: What ends its help.
        exits: What its exit codes mean, of a command with `common` arguments.
        common: The arguments that `--help` shows, the others are shown by `--help-all`; none for all.
    """
    command = commands.add_parser(
        name,
        help=purpose,
        description=f"{purpose[0].upper()}{purpose[1:]}.\n{more}" + (f"\n\n{example}" if common else ""),
        epilog=exits if common else example,
        usage=f"obseq {name} FILES [options]" if common else None,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=run)
    command.add_argument(
        "--help-all", action=HelpAll, help="show all options" if common else argparse.SUPPRESS
    )
    command.purpose, command.common = purpose, frozenset(common)
    return command


class HelpAll(argparse._HelpAction):
    """What shows all that a command takes, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> NoReturn:
        """Print it."""
        print(argparse.ArgumentParser.format_help(parser), end="")
        parser.exit()


class Given(argparse.Action):
    """What an option gives, with what it gave before where it takes several values."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: object,
        option_string: str | None = None,
    ) -> None:
        """Keep the values of one use of the option."""
        before = getattr(namespace, self.dest, None)
        if option_string is not None and isinstance(values, list) and before is not self.default:
            values = [*(before or ()), *values]
        setattr(namespace, self.dest, values)


class Screen(argparse.RawDescriptionHelpFormatter):
    """Shows some arguments only, in one list, each with the first clause of its help."""

    def __init__(self, prog: str, *, common: Collection[str] = ()) -> None:
        super().__init__(prog)
        self.common, self.is_open = common, False

    def start_section(self, heading: str | None) -> None:
        """Begin the list with the first section."""
        if not self.is_open:
            super().start_section("often used")
        self.is_open = True

    def end_section(self) -> None:
        """Go on: the next section stands in the same list."""

    def add_text(self, text: str | None) -> None:
        """Add a text; that after the list ends it."""
        if text and self.is_open:
            super().end_section()
        super().add_text(text)

    def add_argument(self, action: argparse.Action) -> None:
        """Show an argument, if it is a common one."""
        if action.dest in self.common:
            shown = copy(action)
            shown.help = action.help and CLAUSE.split(action.help)[0]
            super().add_argument(shown)


class Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong, and what a misspelt word may have been."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the line, and end."""
        choice = CHOICE.search(message)
        if choice:
            known = [name.strip("' ") for name in choice["known"].split(",")]
            if "COMMAND" in message:
                message = f"no command {choice['word']} ({self.prog} --help lists them)"
            message += meant(choice["word"], known)
        self.exit(CANNOT_RUN, f"{self.prog}: {message}\n")


class CommandParser(Parser):
    """A parser of a subcommand that takes positional arguments and options in any order.

    argparse gives all positional arguments that may be absent their values at the first of them, and refuses
    those that come after an option. Of an option that takes several values and is given several times, it
    forgets all values but the last ones; here they add up.
    """

    purpose = ""
    common: frozenset[str] = frozenset()
    _is_intermixed = False

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.register("action", None, Given)

    def add_subparsers(self, **options: Any) -> Any:
        """Take a word that says what follows it: it stands in its place."""
        self._is_intermixed = True
        return super().add_subparsers(**options)

    def format_help(self) -> str:
        """The help; of a command with common arguments, what fits on a screen."""
        if not self.common:
            return super().format_help()
        whole = self.formatter_class, self.epilog
        self.formatter_class = partial(Screen, common=self.common)
        self.epilog = f"All options: {self.prog} --help-all. Exit codes: obseq help exit-codes."
        try:
            return super().format_help()
        finally:
            self.formatter_class, self.epilog = whole

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse options first, then what is left; an option that is not known ends it."""
        if self._is_intermixed:
            return super().parse_known_args(args, namespace)
        self._is_intermixed = True
        try:
            found, rest = self.parse_known_intermixed_args(args, namespace)
        finally:
            self._is_intermixed = False
        unknown = [word.partition("=")[0] for word in rest if word.startswith("--")]
        if unknown:
            options = re.findall(r"--[\w-]+", argparse.ArgumentParser.format_help(self))
            self.error(f"there is no option {unknown[0]}{meant(unknown[0], options)}")
        return found, rest


def meant(word: str, known: Iterable[str]) -> str:
    """What a misspelt word may have been, as the end of a sentence; nothing where no known one is near."""
    import difflib

    folded = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), folded, n=1, cutoff=0.6)
    return f"; did you mean {folded[near[0]]}?" if near else ""


def output_file(text: str) -> Path:
    """A file to write; `-` is standard output."""
    return STANDARD_OUTPUT if text == "-" else Path(text)


COLOURS = {"bad": "1;31", "warn": "1;33", "ok": "1;32"}
"""Of verdicts, as terminals call them; the words say the same."""


def coloured(line: str, level: str, stream: TextIO) -> str:
    """The line in the colour of its level, where a person reads it on a terminal."""
    if level not in COLOURS or not stream.isatty() or "NO_COLOR" in os.environ:
        return line
    return f"\x1b[{COLOURS[level]}m{line}\x1b[0m"


def say(text: str, outputs: Iterable[Path]) -> None:
    """Print what a command found, where no result is printed: that may be read by a program."""
    stream = sys.stderr if STANDARD_OUTPUT in outputs else sys.stdout
    print(text, end="", file=stream)


def add_iterations(group: argparse._ArgumentGroup, usual: str) -> None:
    """Add what says how the iterations move, and when they end.

    Args:
        group: Options of the computation.
        usual: The strategy that is taken when nothing is said.
    """
    from obseq.leastsquares.iterations.strategies import NAMES

    group.add_argument("--iterations", type=positive_integer, metavar="N", help="stop at this number")
    group.add_argument(
        "--tolerance",
        type=positive_number,
        metavar="T",
        help="the iterations end when nothing moves by more than this share of its standard deviation",
    )
    group.add_argument(
        "--strategy",
        choices=[name for name in NAMES if name != "l1"],
        help=f"how the iterations move (without it: {usual})",
    )


def positive_number(text: str) -> float:
    """A finite number above zero."""
    value = _number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a number above zero")
    return value


def sigma(text: str) -> float:
    """A number above zero whose square, and its inverse, have a size."""
    value = positive_number(text)
    if not 1.0 / EXTREME <= value <= EXTREME:
        raise argparse.ArgumentTypeError(f"{text} is no sigma: it is from {1 / EXTREME:g} to {EXTREME:g}")
    return value


def finite_number(text: str) -> float:
    """A finite number."""
    value = _number(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def probability(text: str) -> float:
    """A number between 0 and 1, neither of them."""
    value = _number(text)
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not between 0 and 1 (5 % is 0.05)")
    return value


def positive_integer(text: str) -> int:
    """A whole number above zero."""
    if not (text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text} is not a whole number above zero")
    return int(text)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
