"""`obseq targets`: coded targets, from the codes to the measures in images."""

import argparse
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.images import targets_find
from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number
from obseq.errors import InputError
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.targets.specification import Specification

MORE = """
Sets of targets are files of MMVII: PREFIX_FullSpecif.xml. `generate` makes one, `draw` prints its
sheets, `find` measures them in images, `simulate` makes images of which everything is known, and
`complete` gives names to measures that have none."""

EXAMPLE = """\
example:
  obseq targets generate IGNIndoor --out sheets
  obseq targets draw sheets/IGNIndoor_Nbb12_Freq2_Hamm3_Run2_3_FullSpecif.xml --width 150 --out sheets

exit code: 0 done; 1 done, and something was left out, which is named; 2 could not run"""

GENERATE = """
Writes PREFIX_SpecEncoding.xml (codes) and PREFIX_FullSpecif.xml (codes and geometry). Families:
IGNIndoor and IGNDroneSym (12 bits, 3 bits apart), IGNDroneTop (Hamming codes of 10 bits), CERN
(ring codes of 14 bits, those of AICON and PhotoModeler; 12 and 20 too). A set that was printed is read from
its file: never make it again."""

DRAW = """
Writes the sheets of a set. SVG: a file each, with lines of any sharpness. PDF: one file, a page each, and
below the sheet its name and size. PNG: a file each, 600 pixels across (needs the extra images). Where a
width or the angle is given, the sheets have it, and PREFIX_FullSpecif.xml is written for them."""
WIDTHS = {
    "inside": "from the central figure to the code",
    "code": "of the ring of the code",
    "outside": "from the code to the legend",
    "border": "from the legend to the end of the sheet",
}
"""Of the geometry, that `draw` may change."""
FORMATS = ("pdf", "svg", "png")
PARITIES = {"odd": 1, "even": 2, "all": 3}
SHEET = 150.0
"""Width of a sheet, millimetres."""


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "coded targets: make and print them, find and measure them in images"
    parser = add_command(commands, "targets", _no_command, purpose, MORE, EXAMPLE)
    within: Commands = parser.add_subparsers(
        title="commands", metavar="COMMAND", required=True, parser_class=type(parser)
    )
    _register_generate(within)
    _register_draw(within)
    targets_find.register(within)


def _no_command(arguments: argparse.Namespace) -> int:
    raise InputError("targets: say which command: obseq targets --help")


def _register_generate(commands: Commands) -> None:
    command = add_command(commands, "generate", generate, "make a set of codes, as a file", GENERATE)
    command.add_argument("family", metavar="FAMILY", help="IGNIndoor, IGNDroneSym, IGNDroneTop, CERN")
    command.add_argument("--bits", type=positive_integer, metavar="N", help="length of the codes")
    command.add_argument(
        "--choice",
        default="former",
        metavar="WORD",
        help="how codes with a distance are chosen: former, as the original did until 2024 (36 codes of 12 "
        "bits); present, as it does now (32); larger, by a search for the largest set (former)",
    )
    command.add_argument("--distance", type=positive_integer, metavar="N", help="bits in which codes differ")
    command.add_argument(
        "--runs", type=positive_integer, nargs=2, metavar=("ZEROS", "ONES"), help="longest runs of bits"
    )
    command.add_argument(
        "--frequency", type=positive_integer, metavar="N", help="how many turns of a target look alike"
    )
    command.add_argument("--parity", choices=PARITIES, help="numbers of ones that codes may have")
    command.add_argument("--most", type=positive_integer, metavar="N", help="so many codes at most")
    command.add_argument(
        "--base", type=positive_integer, default=10, metavar="N", help="of the numbers in names, 2 to 36 (10)"
    )
    command.add_argument("--digits", type=positive_integer, metavar="N", help="of the numbers in names")
    command.add_argument("--before", default="", metavar="TEXT", help="what names begin with")
    command.add_argument("--only", type=int, nargs="+", metavar="NUMBER", help="keep only these numbers")
    command.add_argument(
        "--no-half-turns",
        action="store_true",
        help="leave out codes that look the same when the target is turned",
    )
    command.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the files (.)")


def generate(arguments: argparse.Namespace) -> int:
    """Make a set and write its files."""
    from obseq.targets.families import made
    from obseq.targets.specification_files import encoding_text, specification_text

    spec = made(
        arguments.family,
        arguments.bits,
        choice=arguments.choice,
        distance=arguments.distance,
        runs=tuple(arguments.runs) if arguments.runs else None,
        frequency=arguments.frequency,
        parity=PARITIES.get(arguments.parity),
        most=arguments.most,
        base=arguments.base,
        digits=arguments.digits,
        before=arguments.before,
        numbers=arguments.only,
        without_half_turns=arguments.no_half_turns,
    )
    texts = {"SpecEncoding": encoding_text(spec), "FullSpecif": specification_text(spec)}
    files: Mapping[Path, str | bytes] = {
        arguments.out / f"{spec.prefix}_{kind}.xml": text for kind, text in texts.items()
    }
    check_writable(files)
    write_all(files)
    names = list(spec.codes)
    print(f"{len(names)} targets, {names[0]} to {names[-1]}: {list(files)[-1]}")
    return 0


def _register_draw(commands: Commands) -> None:
    command = add_command(commands, "draw", draw_sheets, "draw the sheets of a set, for printing", DRAW)
    command.add_argument("spec", type=Path, metavar="SPEC", help="specification of the set")
    command.add_argument(
        "--names", default=".*", metavar="PATTERN", help="regular expression of the names to draw (all)"
    )
    command.add_argument(
        "--width", type=positive_number, default=SHEET, metavar="MM", help=f"of a sheet ({SHEET:.0f} mm)"
    )
    command.add_argument("--format", choices=FORMATS, nargs="+", default=["pdf"], help="of the files (pdf)")
    command.add_argument("--no-legend", action="store_true", help="without names in the corners")
    for name, what in WIDTHS.items():
        command.add_argument(f"--{name}", type=float, metavar="UNITS", help=f"width {what}")
    command.add_argument("--angle", type=float, metavar="DEG", help="where chequers and bits begin")
    command.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder of the files (.)")


def draw_sheets(arguments: argparse.Namespace) -> int:
    """Write the sheets."""
    from obseq.targets.specification_files import read_specification, specification_text

    given = read_specification(arguments.spec)
    spec = _with_widths(given, arguments)
    names = chosen_names(spec, arguments.names)
    files: dict[Path, str | bytes] = {}
    if spec is not given:
        files[arguments.out / f"{spec.prefix}_FullSpecif.xml"] = specification_text(spec)
    for kind in dict.fromkeys(arguments.format):
        files |= _sheets(spec, names, kind, arguments)
    check_writable(files, [arguments.spec])
    write_all(files)
    print(f"{len(names)} targets in {len(files)} files: {next(iter(files))}")
    return 0


def _with_widths(spec: "Specification", arguments: argparse.Namespace) -> "Specification":
    """The set with the widths and the angle that are asked for; itself without any."""
    changed = {name: value for name in WIDTHS if (value := getattr(arguments, name)) is not None}
    if arguments.angle is not None:
        changed["angle"] = math.radians(arguments.angle)
    return replace(spec, geometry=replace(spec.geometry, **changed)) if changed else spec


def _sheets(
    spec: "Specification", names: list[str], kind: str, arguments: argparse.Namespace
) -> dict[Path, str | bytes]:
    from obseq.targets.drawing.drawings import draw
    from obseq.targets.drawing.sheets import pdf_bytes, svg_text
    from obseq.targets.pictures import png_bytes

    prefix, legend = arguments.out / spec.prefix, not arguments.no_legend
    if kind == "pdf":
        return {Path(f"{prefix}_Targets.pdf"): pdf_bytes(spec, names, arguments.width, legend=legend)}
    if kind == "svg":
        return {
            Path(f"{prefix}_Target_{name}.svg"): svg_text(spec, name, arguments.width, legend=legend)
            for name in names
        }
    return {Path(f"{prefix}_Target_{name}.png"): png_bytes(draw(spec, name, legend=legend)) for name in names}


def chosen_names(spec: "Specification", pattern: str) -> list[str]:
    """The names that match a regular expression as a whole.

    Raises:
        InputError: the expression is broken, or no name matches.
    """
    try:
        wanted = re.compile(pattern)
    except re.error as error:
        raise InputError(f"--names {pattern}: is no regular expression: {error}") from None
    names = [name for name in spec.codes if wanted.fullmatch(name)]
    if not names:
        first, last = next(iter(spec.codes)), list(spec.codes)[-1]
        raise InputError(f"--names {pattern}: no target of {spec.prefix} matches; it has {first} to {last}")
    return names
