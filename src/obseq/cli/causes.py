"""`obseq causes`: what may be wrong with a network or a block, and what each code means."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.cli.parsing import Commands, add_command, meant
from obseq.errors import InputError
from obseq.printable import printable

if TYPE_CHECKING:
    import argparse

    from obseq.diagnosis.page import Page

MORE = """
Results name what they accuse by a code: S of surveys, I of images, W a slip that is behind it.
Without a code, all are listed."""
EXAMPLE = """\
example:
  obseq causes
  obseq causes S120"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "causes", run, "explain the codes of what may be wrong", MORE, EXAMPLE)
    command.add_argument("code", nargs="?", metavar="CODE", help="such as S120, I100 or W101")


def run(arguments: argparse.Namespace) -> int:
    """List the codes, or explain one."""
    print(printable(listing() if arguments.code is None else explained(_coded(arguments.code))), end="")
    return 0


def sections() -> dict[str, tuple[Page, ...]]:
    """All pages by what they are of."""
    from obseq.images.causes import pages as images
    from obseq.survey.causes import pages as surveys
    from obseq.survey.causes.slip_pages import SLIPS

    return {
        "Causes of surveys": surveys.pages(),
        "Causes of blocks of images": images.pages(),
        "Slips behind them": (*SLIPS, *images.SLIPS),
    }


def listing() -> str:
    """All codes, with a line each."""
    found = sections()
    width = max(len(page.name) for pages in found.values() for page in pages)
    parts = []
    for title, pages in found.items():
        lines = (f"{page.code}  {page.name:<{width}}  {page.about}" for page in pages)
        parts.append("\n".join([title, *lines]) + "\n")
    return "\n".join(parts)


def explained(page: Page) -> str:
    """The page of one code, for a terminal."""
    parts = [f"{page.code} {page.name}", page.about]
    parts += [f"{title}: {text}" for title, text in paragraphs(page)]
    return "\n".join(parts) + "\n"


def paragraphs(page: Page) -> tuple[tuple[str, str], ...]:
    """What is said of one code beside what it means: titles and texts."""
    return ("Tested", " ".join(page.tested)), ("Example", page.example), ("What to do", page.remedy)


def _coded(code: str) -> Page:
    """The page of a code.

    Raises:
        InputError: there is none; the nearest is told.
    """
    known = {page.code: page for pages in sections().values() for page in pages}
    if (found := known.get(code.upper())) is not None:
        return found
    raise InputError(f"there is no cause {code}{meant(code, known)} (`obseq causes` lists them)")
