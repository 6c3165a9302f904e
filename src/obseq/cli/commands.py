"""The commands of `obseq` in groups, and the parser of a line."""

from functools import cache
from importlib import import_module
from itertools import chain

from obseq.cli.parsing import CommandParser, Commands, Parser
from obseq.version import __version__

MMVII = "MMVII"
GROUPS: dict[str, dict[str, tuple[str, ...]]] = {
    "Start": {"demo": ("demo",), "open_page": ("open",), "topics": ("help",)},
    "Networks": {
        "networks.adjust": ("adjust",),
        "networks.plan": ("plan", "simulate"),
        "networks.compare": ("compare",),
    },
    "Images": {
        "images.bundle": ("bundle",),
        "images.satellite": ("satellite",),
        "images.targets": ("targets",),
        "images.aerial": ("image-world", "world-image", "intersect", "resect"),
        "images.epipolar": ("epipolar",),
    },
    "Files": {"report": ("report",), "convert": ("convert",)},
    MMVII: {
        "mmvii.topo_adjust": ("topo-adjust",),
        "mmvii.bundle_adjust": ("bundle-adjust",),
        "mmvii.spelled": ("mmvii",),
        "mmvii.project_imports": ("edit-metadata", "import-gcp", "import-obs"),
        "mmvii.project": (
            "create-calib",
            "check-gcp-distribution",
            "resection",
            "resection-11p",
            "block-init",
            "report-gcp",
            "project-contents",
            "change-sysco",
        ),
        "mmvii.project_targets": (
            "extract-targets",
            "simulate-targets",
            "complete-targets",
            "refine-circles",
        ),
        "mmvii.project_instruments": (
            "import-clinometers",
            "edit-instruments",
            "init-cameras",
            "init-clinometers",
            "init-boresights",
        ),
    },
    "Checks": {
        "causes": ("causes",),
        "formulas": ("formulas",),
        "check_derivatives": ("check-derivatives",),
        "versions": ("versions",),
    },
}
"""By group of the help: the modules of `obseq.cli` that have commands, and the names of those."""
COMMANDS = {module: names for group in GROUPS.values() for module, names in group.items()}
LATER = {*chain(*GROUPS[MMVII].values())} - {"topo-adjust", "bundle-adjust", "mmvii"}
"""Commands without a line of their own: `obseq help mmvii` has them."""

EXIT_CODES = """\
Exit codes
  0    done
  1    done, and something is wrong with the result or was left out, by name
  2    could not run: one message says why
  130  interrupted; no file is half-written
"""

HEAD = """\
obseq: least squares for survey networks and image blocks

Try `obseq demo` first. `obseq COMMAND --help` explains a command, `obseq help` lists topics.
"""


class TopParser(Parser):
    """The parser of the command line, whose help shows commands in groups."""

    commands: Commands

    def format_help(self) -> str:
        """The commands in groups, a line each, and the exit codes."""
        lines = [HEAD]
        for title in GROUPS:
            found = self.purposes(title)
            shown = [f"  {name:<17} {purpose}" for name, purpose in found.items() if name not in LATER]
            more = [f"  and {len(found) - len(shown)} more: obseq help mmvii"] if LATER & set(found) else []
            lines += [title, *shown, *more]
        return "\n".join([*lines, "", EXIT_CODES])

    def purposes(self, group: str) -> dict[str, str]:
        """The commands of a group, and what each does."""
        found = self.commands.choices
        return {name: found[name].purpose for name in chain(*GROUPS[group].values())}


@cache
def parser(name: str = "") -> TopParser:
    """The parser of the command line; a process makes it once.

    Args:
        name: The subcommand that the line begins with: no other is loaded. Where it is none, all are.
    """
    top = TopParser(prog="obseq")
    top.add_argument("--version", action="version", version=f"obseq {__version__}", help="show the version")
    top.commands = top.add_subparsers(metavar="COMMAND", required=True, parser_class=CommandParser)
    for module in [module for module, names in COMMANDS.items() if name in names] or COMMANDS:
        import_module(f"obseq.cli.{module}").register(top.commands)
    return top
