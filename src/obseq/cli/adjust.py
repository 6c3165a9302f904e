"""`obseq adjust`: a survey network from observation and point files."""

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from obseq.cli.files import check_writable, write_all
from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number
from obseq.cli.progress import Progress
from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.report.record import AdjustmentRecord, PhaseRecord

INCOMPLETE = 1
"""Exit code: not converged, or something was left out."""

MORE = """
The observations are read from OBS files, the points from COR files: known points with their
sigma, free points with or without approximate coordinates. What is missing is computed from the
observations. Prints a summary; --out writes all the results in a folder."""

EXAMPLE = """\
example:
  obseq adjust --obs day1.obs day2.obs --cor points.cor --points-crs IGNF:LAMB93 \\
      --frame 'RTL*657700*6860700*0*IGNF:LAMB93' --point-sigma 0.001 --out results

exit code: 0 adjusted; 1 the iterations did not converge, or points were left out; 2 could not run"""


@dataclass(frozen=True)
class Results:
    """Where results are to be written; None for those that nobody asked for."""

    json: Path | None = None
    html: Path | None = None
    text: Path | None = None

    @property
    def paths(self) -> list[Path]:
        """The files to write."""
        return [path for path in (self.json, self.html, self.text) if path]

    def write(self, record: "AdjustmentRecord") -> None:
        """Write all of them, or none."""
        from obseq import report

        writers = ((self.json, report.to_json), (self.html, report.page), (self.text, report.listing))
        write_all({path: writer(record) for path, writer in writers if path})


@dataclass(frozen=True)
class Request:
    """What is to be adjusted, and how.

    Attributes:
        observations: OBS files.
        points: COR files.
        reading: Keyword arguments of `Network.read`.
        solving: Keyword arguments of `Network.adjust`.
        results: Where the results go.
    """

    observations: Sequence[Path]
    points: Sequence[Path]
    reading: dict[str, Any]
    solving: dict[str, Any]
    results: Results


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "adjust", run, "adjust a survey network by least squares", MORE, EXAMPLE)
    files = command.add_argument_group("files")
    files.add_argument(
        "--obs", nargs="+", type=Path, required=True, metavar="FILE", help="observation files (OBS)"
    )
    files.add_argument("--cor", nargs="+", type=Path, required=True, metavar="FILE", help="point files (COR)")
    files.add_argument("--encoding", metavar="NAME", help="encoding of point names, such as latin-1 (UTF-8)")
    files.add_argument(
        "--point-format",
        metavar="FIELDS",
        help="the point files are not COR files: the fields of their lines as in MMVII's ImportGCP, for "
        "instance ANXYZ (additional information, name, x, y, z)",
    )
    files.add_argument(
        "--free",
        metavar="PATTERN",
        help="with --point-format: points whose field A matches this expression as a whole are free",
    )
    files.add_argument(
        "--comment", metavar="C", help="with --point-format: what begins a comment (without it: #)"
    )
    systems = command.add_argument_group("coordinate systems")
    systems.add_argument(
        "--frame",
        metavar="SYSCO",
        help="system of the computation, for instance RTL*E*N*h*IGNF:LAMB93: axes along east, north and up "
        "at that origin; RTL alone takes the mean of the points as origin (without --frame: Local, where "
        "nothing is known of the Earth)",
    )
    systems.add_argument(
        "--points-crs",
        metavar="SYSCO",
        help="system of the coordinates in the point files (without it: the frame)",
    )
    computation = command.add_argument_group("computation")
    computation.add_argument(
        "--point-sigma",
        type=positive_number,
        metavar="S",
        help="sigma in metres of the known points whose line gives none (without it, they are an error)",
    )
    computation.add_argument(
        "--iterations",
        type=positive_integer,
        metavar="N",
        help="stop at this number when not converged before",
    )
    computation.add_argument(
        "--strict",
        action="store_true",
        help="refuse (exit code 2) a network of which points would have to be left out as undetermined",
    )
    add_result_arguments(command)


def add_result_arguments(command: argparse.ArgumentParser) -> None:
    """Add what says where results are written."""
    results = command.add_argument_group("results")
    results.add_argument("--out", type=Path, metavar="DIR", help="folder for adjustment.json, .html and .txt")
    results.add_argument(
        "--json", type=Path, metavar="FILE", help="every result at full precision, for programs"
    )
    results.add_argument("--html", type=Path, metavar="FILE", help="a page with a plan of the network")
    results.add_argument("--text", type=Path, metavar="FILE", help="a complete listing")


def results_of(arguments: argparse.Namespace) -> Results:
    """Where the results go: the folder of --out, unless a file is named."""
    inside = (lambda name: arguments.out / name) if arguments.out else (lambda name: None)
    return Results(
        json=arguments.json or inside("adjustment.json"),
        html=arguments.html or inside("adjustment.html"),
        text=arguments.text or inside("adjustment.txt"),
    )


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    reading = {
        "encoding": arguments.encoding,
        "frame": arguments.frame,
        "points_crs": arguments.points_crs,
        "point_sigma": arguments.point_sigma,
        **_point_format(arguments),
    }
    solving = {"max_iterations": arguments.iterations, "strict": arguments.strict}
    return adjust(
        Request(arguments.obs, arguments.cor, _given(reading), _given(solving), results_of(arguments))
    )


def _point_format(arguments: argparse.Namespace) -> dict[str, Any]:
    """How points are read when they are not in COR files."""
    options = _given({"free_pattern": arguments.free, "comment": arguments.comment})
    if arguments.point_format is None:
        if options:
            raise InputError("--free and --comment go with --point-format, which says what the lines hold")
        return {}
    from obseq.survey import PointFileOptions

    return {"point_format": arguments.point_format, "point_options": PointFileOptions(**options)}


def adjust(request: Request) -> int:
    """Adjust a network, write its results, print its summary; 1 when it did not converge or is incomplete."""
    check_writable(request.results.paths, [*request.observations, *request.points])
    with Progress("starting") as progress:
        record = _adjusted(request, progress)
        with _phase("write", progress, record["phases"]):
            request.results.write(record)
    from obseq.report import summary

    print(summary(record, [str(path) for path in request.results.paths]), end="")
    return 0 if record["converged"] and not record.get("left_out") else INCOMPLETE


def _adjusted(request: Request, progress: Progress) -> "AdjustmentRecord":
    phases: list[PhaseRecord] = []
    with _phase("load", progress, phases):
        from obseq.survey import Network
    progress("read")
    network = Network.read(request.observations, request.points, **request.reading)
    record = cast("AdjustmentRecord", network.adjust(progress=progress, **request.solving).to_dict())
    record["phases"] = phases + record["phases"]
    return record


@contextmanager
def _phase(name: str, progress: Progress, phases: "list[PhaseRecord]") -> Iterator[None]:
    """Announce a part of the work, and add the time it took."""
    progress(name)
    start = time.perf_counter()
    yield
    phases.append({"name": name, "seconds": time.perf_counter() - start})


def _given(options: dict[str, Any]) -> dict[str, Any]:
    """The options that were given: the others keep the defaults of what they are passed to."""
    return {name: value for name, value in options.items() if value is not None}
