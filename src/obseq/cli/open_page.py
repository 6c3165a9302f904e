"""`obseq open`: the page of a result, in the browser."""

import argparse
import webbrowser
from pathlib import Path

from obseq.cli.parsing import Commands, add_command
from obseq.errors import InputError

MORE = """
RESULT is a page, a result file (its page lies beside it, or is made there), or the folder of --out."""
PAGE = ".html"


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "open", run, "open the page of a result in the browser", MORE)
    command.add_argument("result", type=Path, metavar="RESULT", help="a page, a result file or their folder")


def run(arguments: argparse.Namespace) -> int:
    """Open the page; say where it is where there is no browser."""
    page = page_of(arguments.result)
    if not webbrowser.open(page.resolve().as_uri()):
        print("There is no browser here; open this page in one:")
    print(page)
    return 0


def page_of(result: Path) -> Path:
    """The page of a result; it is made where it is not there.

    Raises:
        InputError: there is no such file, or a folder has no page or several.
    """
    if result.is_dir():
        pages = sorted(result.glob(f"*{PAGE}"))
        if len(pages) != 1:
            many = f"several pages; name one: {', '.join(map(str, pages))}" if pages else "no page (*.html)"
            raise InputError(f"{result} has {many}")
        return pages[0]
    page = result.with_suffix(PAGE)
    if not page.exists() and result.exists():
        from obseq.cli.commands import parser

        words = ["report", str(result), "--html", str(page), "--quiet"]
        chosen = parser("report").parse_args(words)
        chosen.run(chosen)
    if not page.exists():
        raise InputError(f"{result}: there is no such result")
    return page
