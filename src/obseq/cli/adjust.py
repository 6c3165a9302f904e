"""`obseq adjust`: a survey network from observation and point files."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from obseq.cli.parsing import Commands, add_command, finite_number, positive_integer, positive_number
from obseq.cli.progress import Progress
from obseq.cli.quality import add_quality_arguments, quality_of
from obseq.cli.results import INCOMPLETE, Outputs, add_result_arguments, outputs_of, show, write
from obseq.errors import InputError
from obseq.record import AdjustmentRecord, PhaseRecord
from obseq.stopwatch import Stopwatch
from obseq.writing import check_writable

IGNORABLE = ("heights", "relative-sigmas", "deflections", "after-sigma", "frames")

MORE = """
The observations are read from OBS files, the points from COR files: known points with their
sigma, free points with or without approximate coordinates. What is missing is computed from the
observations. Prints a summary; --out writes all the results in a folder."""

EXAMPLE = """\
example:
  obseq adjust --obs day1.obs day2.obs --cor points.cor --points-crs IGNF:LAMB93 \\
      --point-sigma 0.001 --out results
  obseq adjust --obs levels.obs --cor levels.cor
  obseq adjust project.comp --json result.json

exit code: 0 adjusted; 1 the iterations did not converge, or points were left out; 2 could not run"""


@dataclass(frozen=True)
class Request:
    """What is to be adjusted, and how.

    Attributes:
        observations: OBS files.
        points: COR files.
        reading: Keyword arguments of `Network.read`.
        solving: Keyword arguments of `Network.adjust`.
        outputs: Where the results go.
        project: Files of another program, to read instead of observations and points.
    """

    observations: Sequence[Path]
    points: Sequence[Path]
    reading: dict[str, Any]
    solving: dict[str, Any]
    outputs: Outputs
    project: Sequence[Path] = ()


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "adjust", run, "adjust a survey network by least squares", MORE, EXAMPLE)
    files = command.add_argument_group("files")
    files.add_argument(
        "project",
        nargs="*",
        type=Path,
        metavar="PROJECT",
        help="files of another program: a Comp3D project (.comp)",
    )
    files.add_argument("--obs", nargs="+", type=Path, metavar="FILE", help="observation files (OBS)")
    files.add_argument("--cor", nargs="+", type=Path, metavar="FILE", help="point files (COR)")
    files.add_argument(
        "--outside", action="store_true", help="let a project read files outside of its own folder"
    )
    files.add_argument(
        "--geoid", type=Path, metavar="FILE", help="geoid heights and deflections, for files that need them"
    )
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
        "at that origin; RTL alone takes the mean of the points as origin (without --frame: that at the mean "
        "of the known points; without --points-crs either: a plane with heights)",
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
        "--refraction",
        type=finite_number,
        metavar="K",
        help="refraction coefficient of zenith angles (without it: 0.12; 0: no refraction; 1: neither "
        "refraction nor curvature)",
    )
    computation.add_argument(
        "--ignore",
        nargs="+",
        choices=IGNORABLE,
        metavar="WHAT",
        help="leave out of the files, with a warning: " + ", ".join(IGNORABLE),
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
    add_quality_arguments(command)
    add_result_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    reading = {
        "encoding": arguments.encoding,
        "frame": arguments.frame,
        "points_crs": arguments.points_crs,
        "point_sigma": arguments.point_sigma,
        "refraction": arguments.refraction,
        "ignore": arguments.ignore,
        **_point_format(arguments),
    }
    solving = {
        "max_iterations": arguments.iterations,
        "strict": arguments.strict,
        "quality": quality_of(arguments),
    }
    outputs = outputs_of(arguments)
    if arguments.project:
        reading = _project_options(arguments, _given(reading))
        return adjust(Request([], [], reading, _given(solving), outputs, arguments.project))
    if not arguments.obs or not arguments.cor:
        raise InputError("adjust: give a project, or observation files (--obs) and point files (--cor)")
    return adjust(Request(arguments.obs, arguments.cor, _given(reading), _given(solving), outputs))


def _project_options(arguments: argparse.Namespace, reading: dict[str, Any]) -> dict[str, Any]:
    """What may be said about a project besides its name."""
    accepted = {"frame", "refraction", "encoding", "ignore"}
    given = sorted(set(reading) - accepted) + [name for name in ("obs", "cor") if getattr(arguments, name)]
    if given:
        listed = ", ".join("--" + name.replace("_", "-") for name in given)
        raise InputError(
            f"{arguments.project[0]}: a project says itself what {listed} would say; leave it out"
        )
    return reading | _given({"outside": arguments.outside, "geoid": arguments.geoid})


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
    check_writable([path for path, _ in request.outputs], _inputs(request))
    with Progress("starting") as progress:
        watch = Stopwatch(progress)
        record = _adjusted(request, watch)
        with watch.phase("write"):
            write(record, request.outputs)
    phases = (*record.phases, PhaseRecord("write", watch.seconds["write"]))
    show(replace(record, phases=phases), request.outputs)
    return 0 if record.is_complete else INCOMPLETE


def _inputs(request: Request) -> list[Path]:
    """The files that no output may replace."""
    return [*request.observations, *request.points, *request.project]


def _adjusted(request: Request, watch: Stopwatch) -> AdjustmentRecord:
    with watch.phase("load"):
        from obseq.survey import Network
    watch.progress("read")
    if request.project:
        network = Network.read_project(request.project, **request.reading)
    else:
        network = Network.read(request.observations, request.points, **request.reading)
    record = network.adjust(progress=watch.progress, **request.solving).record()
    return replace(record, phases=(PhaseRecord("load", watch.seconds["load"]), *record.phases))


def _given(options: dict[str, Any]) -> dict[str, Any]:
    """The options that were given: the others keep the defaults of what they are passed to."""
    return {name: value for name, value in options.items() if value is not None}
