"""`obseq adjust`: a survey network from observation and point files."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import structs

from obseq.boundary import Boundary, interruptions_end_searches
from obseq.cli.in_blocks import add_blocks_arguments, blocks_of, ended
from obseq.cli.networks.network_files import COMMON, Source, add_network_arguments, given, source_of
from obseq.cli.networks.quality import add_quality_arguments, quality_of
from obseq.cli.parsing import Commands, add_command, add_iterations
from obseq.cli.progress import Progress
from obseq.cli.results import (
    INCOMPLETE,
    Outputs,
    add_result_arguments,
    detail_of,
    outputs_of,
    show_adjustment,
    shown_anyway,
    shown_in,
    write,
)
from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError
from obseq.printable import composed, printable
from obseq.records.adjustment import AdjustmentRecord, PhaseRecord
from obseq.report.summary import USUAL, Detail
from obseq.stopwatch import Stopwatch
from obseq.writing import SECOND, STANDARD_OUTPUT, check_writable, forget_second, second_of

if TYPE_CHECKING:
    from obseq.survey import Network

MORE = """
Observations and points are told apart by what the files are (obseq help formats): known points with their
sigma, free points with or without approximate coordinates. What is missing is computed from the
observations. Prints a summary; --out writes all the results in a folder."""

EXAMPLE = """\
examples:
  obseq adjust levels.obs levels.cor
  obseq adjust day1.obs day2.obs points.cor --points-crs IGNF:LAMB93 --point-sigma 0.001 --out results
  obseq adjust project.comp --show points --units ft dms"""

EXITS = """\
exit code: 0 adjusted, and nothing is wrong; 1 the iterations did not converge, points were left out, or
observations that no file switches off, gross errors are suspected, sigma0 is far too large and nothing
explains it (at 0.5 %), or snooping or --without-accused left some out; 2 could not run"""


@dataclass(frozen=True)
class Request:
    """What is to be adjusted, and how.

    Attributes:
        source: The files, and how they are read.
        solving: Keyword arguments of `Network.adjust`.
        outputs: Where the results go.
        title: What the reports call it.
        sinex: Where the points go with their whole covariance; None for nowhere.
        estimated: What is estimated of instruments and refraction.
        units: Of the reports, in words; those of the files for what they do not name.
        without_accused: Whether a second adjustment is made without what is accused.
        detail: How much is printed.
    """

    source: Source
    solving: dict[str, Any]
    outputs: Outputs
    title: str | None = None
    sinex: Path | None = None
    estimated: Sequence[str] = ()
    units: Sequence[str] = ()
    without_accused: bool = False
    detail: Detail = USUAL

    @property
    def places(self) -> list[Path]:
        """Where something is written."""
        sinex = [] if self.sinex is None else [self.sinex]
        return [*(path for path, _ in self.outputs), *sinex]

    def second(self) -> "Request":
        """The request of the adjustment without what is accused: its results go beside the first ones.

        Raises:
            InputError: a result goes to standard output, which takes one.
        """
        if STANDARD_OUTPUT in self.places:
            raise InputError("--without-accused writes two results: name a file in place of -")
        return replace(
            self,
            outputs=[(second_of(path), form) for path, form in self.outputs],
            title=f"{self.title}, without the accused" if self.title else "Without the accused",
            sinex=None if self.sinex is None else second_of(self.sinex),
        )


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "adjust a survey network by least squares"
    command = add_command(
        commands, "adjust", run, purpose, MORE, EXAMPLE, exits=EXITS, common=(*COMMON, "datum", "snooping")
    )
    add_network_arguments(command)
    computation = command.add_argument_group("iterations")
    computation.add_argument(
        "--datum",
        choices=("given", "fixed", "inner"),
        help="what the network rests on: known coordinates with their sigmas (given), or exactly (fixed); or "
        "inner constraints, free of them (without it: what a project says, else given)",
    )
    computation.add_argument(
        "--datum-points",
        nargs="+",
        type=composed,
        metavar="NAME",
        help="with --datum inner: the points that carry the constraints (without it: all)",
    )
    computation.add_argument(
        "--estimate",
        nargs="+",
        choices=("constant", "scale", "refraction", "frame-scale"),
        metavar="WHAT",
        help="unknowns of each file of observations: additive constant and scale of distances, "
        "refraction coefficient of zenith angles (constant, scale, refraction); of each set-up or sub-frame: "
        "scale of the components dx dy dz (frame-scale)",
    )
    add_iterations(computation, "controlled")
    computation.add_argument(
        "--loss",
        choices=("huber", "l1", "cauchy", "tukey"),
        help="robust weights: large residuals count less; they name nothing (see --snooping)",
    )
    computation.add_argument(
        "--strict",
        action="store_true",
        help="refuse (exit code 2) a network of which points would have to be left out as undetermined",
    )
    computation.add_argument(
        "--without-accused",
        action="store_true",
        help="where errors are named that explain what is wrong: also a second adjustment, without them "
        f"(of a group, without all its observations); its files end with {SECOND}",
    )
    command.add_argument("--title", metavar="TEXT", help="what the reports call this adjustment")
    add_quality_arguments(command)
    add_blocks_arguments(command)
    add_result_arguments(command)
    command.add_argument(
        "--sinex", type=Path, metavar="FILE", help="also adjusted points with their whole covariance (SINEX)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    solving = {
        "max_iterations": arguments.iterations,
        "tolerance": arguments.tolerance,
        "strategy": arguments.strategy,
        "strict": arguments.strict,
        "loss": arguments.loss,
        "quality": quality_of(arguments),
        "datum": _datum(arguments),
        "blocks": blocks_of(arguments),
    }
    return adjust(
        Request(
            source_of(arguments),
            given(solving),
            outputs_of(arguments),
            arguments.title,
            arguments.sinex,
            arguments.estimate or (),
            arguments.units,
            arguments.without_accused,
            detail_of(arguments, "adjustment"),
        )
    )


def _datum(arguments: argparse.Namespace) -> Any:
    """What the network rests on; None when nothing is said."""
    if arguments.datum is None:
        if arguments.datum_points:
            raise InputError("--datum-points goes with --datum inner")
        return None
    from obseq.survey import Datum

    return Datum(arguments.datum, tuple(arguments.datum_points or ()))


def adjust(request: Request) -> int:
    """Adjust a network, write its results, print its summary; 1 when it did not converge or is incomplete."""
    with ended(request.solving.get("blocks")), interruptions_end_searches():
        return _adjusted(request)


def _adjusted(request: Request) -> int:
    second = request.second() if request.without_accused else None
    check_writable([*request.places, *(second.places if second else ())], request.source.files)
    with Progress("starting") as progress:
        watch = Stopwatch(progress)
        network = _network(request, watch)
        record, others = _written(network, request, watch)
    forget_second(request.places, request.source.files)
    show_adjustment(record, request.outputs, request.detail, others)
    if second is not None:
        return _without_accused(network, record, second)
    return 0 if record.is_complete else INCOMPLETE


def _without_accused(network: "Network", first: AdjustmentRecord, request: Request) -> int:
    """Adjust a network again, without what is accused; where there is no such adjustment, say why."""
    try:
        with Progress("adjusting without what is accused") as progress:
            rest = network.without_accused(first.diagnosis)
            record, others = _written(rest, request, Stopwatch(progress))
    except ObseqError as error:
        print(printable(f"--without-accused: no second adjustment: {error}"), file=sys.stderr)
        return 0 if first.is_complete else INCOMPLETE
    print()
    show_adjustment(record, request.outputs, request.detail, others)
    return INCOMPLETE


def _network(request: Request, watch: Stopwatch) -> "Network":
    with watch.phase("load"):
        from obseq.survey import Network  # noqa: F401  # its time is not that of reading
    with watch.counted("read"):
        network = shown_in(request.source.read(request.places), request.units)
    if request.estimated:
        from obseq.survey import estimating

        network = replace(network, book=estimating(network.book, request.estimated))
    if request.sinex is not None:
        from obseq.formats.conversion import check_sinex

        check_sinex(network, request.solving.get("datum"))
    return network


def _written(network: "Network", request: Request, watch: Stopwatch) -> tuple[AdjustmentRecord, list[Path]]:
    """The adjustment, when its results are written; and the files that its record does not make."""
    adjustment = network.adjust(progress=watch.progress, **request.solving)
    files: dict[Path, str] = {}
    if request.sinex is not None:
        from obseq.formats.conversion import sinex_of

        boundary = Boundary()
        files = boundary.texts({request.sinex: partial(sinex_of, adjustment)})
        adjustment = adjustment.failing(boundary.failures)
    with watch.phase("record"):
        record = adjustment.record(request.title)
    loading = [PhaseRecord("load", watch.seconds["load"])] if "load" in watch.seconds else []
    record = structs.replace(record, phases=(*loading, *record.phases))
    shown = partial(show_adjustment, record, (), request.detail)
    with watch.phase("write"), shown_anyway(shown):
        record = write(record, request.outputs, files, watch.progress)
    rest = (PhaseRecord(name, watch.seconds[name]) for name in ("record", "write"))
    phases = (*record.phases, *rest)
    return structs.replace(record, phases=phases), list(files)
