"""`obseq help`: what concerns several commands, a topic each."""

from __future__ import annotations

import re
from itertools import chain
from typing import TYPE_CHECKING

from obseq.cli.commands import COMMANDS, EXIT_CODES, MMVII, parser
from obseq.cli.parsing import Commands, add_command, meant
from obseq.errors import InputError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Sequence

CODE = re.compile(r"[SIWsiw]\d+")
"""Of a cause."""

SYSTEMS = """\
What --points-crs and --frame take:
  EPSG:2154, IGNF:LAMB93, ...   what PROJ knows, also '+proj=utm +zone=31 +datum=WGS84'
  EPSG:2056@h                   the same, with heights above the ellipsoid of WGS 84
  L93, Geog                     IGNF:LAMB93; longitude and latitude of WGS 84
  GeoC                          geocentric, WGS 84
  RTL*X0*Y0*Z0*DEFINITION       east, north and up at an origin; RTL alone takes the mean of the points
  LEuc*TX*TY*TZ*OMEGA*PHI*KAPPA a rotation and a shift of the geocentric system
  Local, Local*sw, ...          a plane with heights, axes to the south and west, ...
x, easting or longitude always comes first. Without --points-crs points are in the frame; without --frame
either, in a plane with heights.
"""

COMPLETION = """\
The Tab key completes commands, options and files:
  pip install 'obseq[completion]'     (in a checkout: pip install -e '.[completion]')
then, in the start file of the shell:
  bash, zsh   eval "$(register-python-argcomplete obseq)"
  fish        register-python-argcomplete --shell fish obseq | source
"""


def _formats() -> str:
    from obseq.formats.catalogue import FORMATS
    from obseq.formats.conversion import NETWORK_WRITERS, RESULT_WRITERS

    lines = [f"  {form.told:<44} {form.holds}" for form in FORMATS]
    written = [
        f"Written by `obseq convert` of a network: {' '.join(NETWORK_WRITERS)}",
        f"Written by `obseq convert` of a result: {' '.join(RESULT_WRITERS)}",
    ]
    return "\n".join(["Read, as a file says itself or as its suffix does:", *lines, *written]) + "\n"


def _mmvii() -> str:
    """The commands on projects of MMVII, and its own words for them."""
    from obseq.cli.mmvii.spelled import listing

    lines = [f"  {name:<24} {purpose}" for name, purpose in parser().purposes(MMVII).items()]
    told = listing().replace("\n", "\n  ").rstrip()
    return "\n".join(["On the folders of a project:", *lines, "", f"As `obseq mmvii COMMAND`:\n  {told}\n"])


TOPICS: dict[str, tuple[str, Callable[[], str]]] = {
    "exit-codes": ("what exit codes say", lambda: EXIT_CODES),
    "formats": ("the files that are read and written", _formats),
    "crs": ("how coordinate systems are written", lambda: SYSTEMS),
    "mmvii": ("the commands on projects of MMVII, and its own words for them", _mmvii),
    "completion": ("how the Tab key completes commands and options", lambda: COMPLETION),
}


LIST = "".join(f"  {name:<12} {about}\n" for name, (about, _) in TOPICS.items())


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    more = f"\nTopics, beside the commands and the codes of causes (S120):\n{LIST}"
    command = add_command(commands, "help", run, "explain a topic, a command or the code of a cause", more)
    command.add_argument("topic", nargs="?", metavar="TOPIC", help="such as crs, adjust or S120")


def instead(words: Sequence[str]) -> Sequence[str]:
    """The line that `help COMMAND`, `help CODE` or `help` alone stands for; other lines as they are."""
    match words:
        case ["help"]:
            return ["help", "--help"]
        case ["help", name] if name not in TOPICS and name in chain(*COMMANDS.values()):
            return [name, "--help-all"]
        case ["help", code] if CODE.fullmatch(code):
            return ["causes", code]
    return words


def run(arguments: argparse.Namespace) -> int:
    """Explain a topic."""
    if arguments.topic not in TOPICS:
        said = meant(arguments.topic, [*TOPICS, *chain(*COMMANDS.values())])
        raise InputError(f"there is no topic {arguments.topic}{said} (`obseq help` lists them)")
    print(TOPICS[arguments.topic][1](), end="")
    return 0
