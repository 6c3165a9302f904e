"""The `obseq` command: its parser, and what its exit code says.

Exit codes: 0 done; 1 done, and a check failed (no convergence, a derivative that is wrong); 2 could not run,
with one message on standard error; 130 interrupted from the keyboard, or told to end (SIGTERM).
"""

import argparse
import sys
from collections.abc import Sequence
from functools import cache

from obseq.cli import (
    adjust,
    aerial,
    bundle,
    bundle_adjust,
    check_derivatives,
    compare,
    convert,
    demo,
    epipolar,
    formulas,
    plan,
    project,
    project_imports,
    report,
    topo_adjust,
    versions,
)
from obseq.cli.guard import guarded
from obseq.cli.parsing import CommandParser

DESCRIPTION = """\
Least squares adjustment of survey observations.

Try `obseq demo` first. `obseq COMMAND --help` explains a command."""

EPILOG = """\
exit code: 0 done; 1 done, and a check failed; 2 could not run, with one message that says why"""


@cache
def parser() -> argparse.ArgumentParser:
    """The parser of the command line, with every subcommand; a process makes it once."""
    top = argparse.ArgumentParser(
        prog="obseq",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = top.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=CommandParser
    )
    for module in (
        demo,
        adjust,
        bundle,
        plan,
        compare,
        report,
        convert,
        aerial,
        epipolar,
        project_imports,
        project,
        topo_adjust,
        bundle_adjust,
        formulas,
        check_derivatives,
        versions,
    ):
        module.register(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""

    def work() -> int:
        chosen = parser().parse_args(arguments)
        code: int = chosen.run(chosen)
        return code

    return guarded("obseq", work)


if __name__ == "__main__":
    sys.exit(main())
