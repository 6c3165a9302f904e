"""The `obseq` command: its parser, and what its exit code says.

Exit codes: 0 done; 1 done, and a check failed (no convergence, a derivative that is wrong); 2 could not run,
with one message on standard error; 130 interrupted from the keyboard, or told to end (SIGTERM).
"""

import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from obseq.cli.commands import parser
from obseq.cli.guard import guarded
from obseq.cli.mmvii.spelled import as_mmvii
from obseq.cli.parsing import CommandParser
from obseq.cli.topics import instead
from obseq.errors import ObseqError

KINDS = ("adjustment", "bundle", "plan", "comparison")
"""Names of the pages of results."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    given = sys.argv[1:] if arguments is None else arguments

    def work() -> int:
        if "_ARGCOMPLETE" in os.environ:
            _complete()
        if given[:1] == ["mmvii"] and given[1:] not in (["-h"], ["--help"]):
            return as_mmvii(given[1:], run)
        return run(given)

    return guarded("obseq", work)


def run(words: Sequence[str]) -> int:
    """Run the command of some words."""
    words = instead(words)
    chosen = parser(*words[:1]).parse_args(words)
    begun = time.time()
    try:
        code: int = chosen.run(chosen)
    except ObseqError as error:
        for path in _pages(getattr(chosen, "out", None)):
            if path.stat().st_mtime < begun:
                error.add_note(f"{path} and the files beside it are of an earlier run")
        raise
    return code


def _pages(folder: object) -> Iterator[Path]:
    """The pages of results in a folder that is named by --out."""
    if isinstance(folder, Path):
        yield from (path for kind in KINDS if (path := folder / f"{kind}.html").is_file())


def _complete() -> None:
    """Answer a shell that asks how a line may go on, and end; the extra is `completion`."""
    import argcomplete

    words = os.environ.get("COMP_LINE", "").split()
    CommandParser._is_intermixed = True  # options and files are looked at one by one
    argcomplete.autocomplete(parser(*words[1:2]))


if __name__ == "__main__":
    sys.exit(main())
