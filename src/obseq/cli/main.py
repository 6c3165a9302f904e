"""The `obseq` command: its parser, and what its exit code says.

Exit codes: 0 done; 1 done, and a check failed (no convergence, a derivative that is wrong); 2 could not run,
with one message on standard error; 130 interrupted from the keyboard, or told to end (SIGTERM).
"""

import argparse
import sys
from collections.abc import Sequence
from functools import cache
from importlib import import_module

from obseq.cli.guard import guarded
from obseq.cli.mmvii import as_mmvii
from obseq.cli.parsing import CommandParser, Parser
from obseq.version import __version__

COMMANDS = {
    "demo": ("demo",),
    "adjust": ("adjust",),
    "bundle": ("bundle",),
    "satellite": ("satellite",),
    "plan": ("plan", "simulate"),
    "compare": ("compare",),
    "report": ("report",),
    "causes": ("causes",),
    "convert": ("convert",),
    "aerial": ("image-world", "world-image", "intersect", "resect"),
    "epipolar": ("epipolar",),
    "targets": ("targets",),
    "project_targets": ("extract-targets", "complete-targets", "refine-circles"),
    "project_imports": ("edit-metadata", "import-gcp", "import-obs"),
    "project": (
        "create-calib",
        "check-gcp-distribution",
        "resection",
        "resection-11p",
        "block-init",
        "report-gcp",
        "project-contents",
        "change-sysco",
    ),
    "topo_adjust": ("topo-adjust",),
    "bundle_adjust": ("bundle-adjust",),
    "mmvii": ("mmvii",),
    "formulas": ("formulas",),
    "check_derivatives": ("check-derivatives",),
    "versions": ("versions",),
}
"""The modules of `obseq.cli` that have commands, in the order of the help, and the names of those."""

DESCRIPTION = """\
Least squares adjustment of survey observations.

Try `obseq demo` first. `obseq COMMAND --help` explains a command."""

EPILOG = """\
exit code: 0 done; 1 done, and a check failed; 2 could not run, with one message that says why"""


@cache
def parser(name: str = "") -> argparse.ArgumentParser:
    """The parser of the command line; a process makes it once.

    Args:
        name: The subcommand that the line begins with: no other is loaded. Where it is none, all are.
    """
    top = Parser(
        prog="obseq",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action="version", version=f"obseq {__version__}", help="show the version")
    commands = top.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=CommandParser
    )
    for module in [module for module, names in COMMANDS.items() if name in names] or COMMANDS:
        import_module(f"obseq.cli.{module}").register(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    given = sys.argv[1:] if arguments is None else arguments

    def work() -> int:
        if given[:1] == ["mmvii"] and given[1:] not in (["-h"], ["--help"]):
            return as_mmvii(given[1:], run)
        return run(given)

    return guarded("obseq", work)


def run(words: Sequence[str]) -> int:
    """Run the command of some words."""
    chosen = parser(*words[:1]).parse_args(words)
    code: int = chosen.run(chosen)
    return code


if __name__ == "__main__":
    sys.exit(main())
