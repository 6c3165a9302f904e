"""`obseq convert`: a survey network as a file of another program, results as points and maps."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from obseq.cli.networks.network_files import add_network_arguments, source_of
from obseq.cli.parsing import Commands, add_command, positive_number
from obseq.errors import InputError
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from obseq.records.adjustment import AdjustmentRecord

Writer = TypeVar("Writer")
RESULTS = (".json", ".npz")
MORE = """
What a network holds, as a file that another program reads; what is in a result, as a point file or a map.
Nothing is adjusted. What the other format cannot say is refused by name."""

EXAMPLE = """\
examples:
  obseq convert network.gkf --to network.obs network.cor
  obseq convert --obs day1.obs --cor points.cor --refraction 1 --to network.gkf
  obseq convert results/adjustment.json --to adjusted.cor adjusted.csv map.geojson map.gpkg plan.dxf

written, by suffix: of a network .gkf (GNU Gama), .xml (DynaML), .obs, .cor, .csv (points), .obs.csv
(observations); of a result .cor, .csv (adjusted points), .obs.csv (observations and how they fit), .geojson,
.gpkg, .kml (maps; the last two need pyogrio), .dxf (a drawing; needs ezdxf)

exit code: 0 written; 1 written, of a result in which something is wrong; 2 could not run"""


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(
        commands, "convert", run, "write networks and results in other formats", MORE, EXAMPLE
    )
    command.add_argument(
        "--to", nargs="+", type=Path, required=True, metavar="FILE", help="what to write; suffixes say how"
    )
    command.add_argument(
        "--ellipse-scale",
        type=positive_number,
        default=1000.0,
        metavar="K",
        help="how many times larger ellipses are drawn on maps (1000)",
    )
    add_network_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Read, and write all files or none."""
    hint, doubt = "", ""
    inputs = [*arguments.project, *(arguments.obs or ()), *(arguments.cor or ())]
    check_writable(arguments.to, inputs)
    if any(path.suffix.lower() in RESULTS for path in arguments.project):
        if len(inputs) > 1:
            raise InputError("convert: a result is converted by itself; give no other file")
        texts, doubt = _of_result(arguments)
    else:
        texts, hint = _of_network(arguments)
    write_all(texts)
    print("Written: " + ", ".join(str(path) for path in texts))
    if hint or doubt:
        print(hint or doubt)
    return 1 if doubt else 0


def _of_result(arguments: argparse.Namespace) -> tuple[dict[Path, str | bytes], str]:
    """What to write, and what is wrong with the result.

    Raises:
        InputError: it is none: its iterations did not converge.
    """
    from obseq.formats.conversion import RESULT_WRITERS
    from obseq.report.result_file import read_json

    writers = {path: _writer(path, RESULT_WRITERS, "a result") for path in arguments.to}
    record = read_json(arguments.project[0])
    check_writable(arguments.to, map(Path, record.files or ()))
    if not record.converged:
        raise InputError(
            f"{arguments.project[0]}: this adjustment did not converge, and its coordinates are no result: "
            "its report says what is suspected; put that right, and adjust again"
        )
    doubt = "" if record.is_complete else f"{arguments.project[0]}: {_doubt(record)}"
    return {path: write(record, arguments.ellipse_scale) for path, write in writers.items()}, doubt


def _doubt(record: "AdjustmentRecord") -> str:
    if errors := [error.what for error in record.gross_errors]:
        return f"gross errors are suspected, which spoil these coordinates, the worst in {errors[0]}"
    return "something is wrong with this adjustment; its report says what"


def _of_network(arguments: argparse.Namespace) -> tuple[dict[Path, str | bytes], str]:
    """What to write, and what the files do not say of the network."""
    from obseq.formats.conversion import NETWORK_WRITERS, datum_options

    writers = {path: _writer(path, NETWORK_WRITERS, "a network") for path in arguments.to}
    network = source_of(arguments).read(arguments.to)
    hint = ""
    if {path.suffix.lower() for path in writers} & {".obs", ".cor", ".csv"}:
        system, frame = network.points_crs.definition, network.frame
        options = f"--points-crs '{system}' --refraction {frame.refraction_coefficient:g}"
        if frame.has_place:
            options = f"--frame '{frame.system.definition}' {options}"
        options += datum_options(network)
        hint = f"OBS, COR and CSV files say neither systems, refraction nor datum: adjust them with {options}"
    return {path: write(network) for path, write in writers.items()}, hint


def _writer(path: Path, writers: Mapping[str, Writer], what: str) -> Writer:
    found = writers.get("".join(path.suffixes[-2:]).lower()) or writers.get(path.suffix.lower())
    if found is None:
        raise InputError(f"{path}: {what} is written as {', '.join(writers)}; choose one of these suffixes")
    return found
