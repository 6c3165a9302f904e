"""`obseq plan` and `obseq simulate`: a network before it is measured."""

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.networks.network_files import COMMON, add_network_arguments, given, source_of
from obseq.cli.parsing import Commands, add_command, positive_integer, positive_number, probability
from obseq.cli.progress import Progress
from obseq.cli.results import (
    INCOMPLETE,
    add_detail,
    add_units,
    detail_of,
    show,
    shown_anyway,
    shown_in,
    telling,
)
from obseq.errors import InputError
from obseq.printable import composed
from obseq.stopwatch import Stopwatch
from obseq.writing import check_writable, write_all

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.records.plan import PlanRecord
    from obseq.survey import Network

PLAN = """
The point file gives approximate coordinates of all points and the sigmas of the known ones; the observation
files give what is to be observed, with its sigmas. Values of observations do not count: any number may stand
there. Prints how well points will be known, where the plan is weak, and what one more observation would
bring."""

PLAN_EXAMPLE = """\
examples:
  obseq plan intended.obs approximate.cor
  obseq plan intended.obs approximate.cor --points-crs EPSG:2056 --draws 500 --out plan
  obseq plan project.comp --points P1 P2 --most 20"""

PLAN_EXITS = """\
exit code: 0 planned; 1 something is undetermined, or drawn errors disagree; 2 could not run"""

SIMULATE = """
Writes simulated.obs and simulated.cor in the folder of --out: the values that would be observed if the
coordinates of the point file were true, with normal errors of the given sigmas (in the known coordinates as
well, where they have a sigma). Points that are not known keep their coordinates, as approximations. Where
some have no plan, or no height, the points are in simulated.csv: a COR file cannot say so."""

SIMULATE_EXAMPLE = """\
example:
  obseq simulate --obs intended.obs --cor approximate.cor --seed 7 --out epoch1"""


def register(commands: Commands) -> None:
    """Add the commands to the parser."""
    purpose = "say what a network will be worth before it is measured"
    common = (*COMMON, "draws", "points", "most", "ellipses")
    command = add_command(commands, "plan", run, purpose, PLAN, PLAN_EXAMPLE, exits=PLAN_EXITS, common=common)
    add_network_arguments(command)
    wanted = command.add_argument_group("what is wanted")
    wanted.add_argument(
        "--draws", type=positive_integer, metavar="N", help="check by adjusting N drawn sets of observations"
    )
    _add_seed(wanted)
    wanted.add_argument(
        "--no-gains", action="store_true", help="without what one more observation would bring"
    )
    wanted.add_argument(
        "--farthest",
        type=positive_number,
        metavar="M",
        help="longest sight of such an observation in metres (without it: the longest of the plan)",
    )
    wanted.add_argument(
        "--points", nargs="+", type=composed, metavar="NAME", help="the points whose precision ranks them"
    )
    wanted.add_argument("--most", type=positive_integer, default=10, metavar="N", help="length of lists (10)")
    wanted.add_argument("--level", type=probability, metavar="P", help="level of the test of one observation")
    wanted.add_argument("--power", type=probability, metavar="P", help="power of that test")
    wanted.add_argument("--ellipses", type=probability, metavar="P", help="confidence of the ellipses")
    wanted.add_argument(
        "--relative", action="store_true", help="precision of each pair of points that is joined"
    )
    add_units(command)
    add_detail(command)
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for plan.json, plan.txt and plan.html"
    )
    _register_simulate(commands)


def _register_simulate(commands: Commands) -> None:
    purpose = "write the observations that a network would have"
    command = add_command(commands, "simulate", run_simulate, purpose, SIMULATE, SIMULATE_EXAMPLE)
    add_network_arguments(command)
    drawing = command.add_argument_group("errors")
    _add_seed(drawing)
    drawing.add_argument("--exact", action="store_true", help="without errors")
    command.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the two files")


def _add_seed(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--seed", type=positive_integer, default=1, metavar="N", help="of the random numbers (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Plan what the command line names."""
    source, out, detail = source_of(arguments), arguments.out, detail_of(arguments, "plan")
    names = "plan.json", "plan.txt", "plan.html"
    places = [out / name for name in names] if out else []
    check_writable(places, source.files)
    with Progress("starting") as progress:
        watch = Stopwatch(progress)
        with watch.phase("load"):
            from obseq.report.planned import outcome
            from obseq.survey import plan  # noqa: F401  # its time is not that of reading
        with watch.phase("read"), watch.counted("read"):
            network = shown_in(source.read(places), arguments.units)
        with watch.phase("plan"):
            record = _planned(arguments, network, progress)
        with watch.phase("write"), shown_anyway(lambda: show(outcome(record), (), detail)):
            made = dict(zip(places, texts_of(record).values(), strict=True)) if places else {}
            write_all({path: text() for path, text in telling(made, progress).items()})
    with watch.phase("summary"):
        found = outcome(record)
    show(found, places, detail, watch.seconds)
    return exit_code(record)


def exit_code(record: "PlanRecord") -> int:
    """0 where all is determined, and draws agree with the prediction."""
    disagrees = record.draws is not None and not record.draws.agrees
    return INCOMPLETE if disagrees or not record.adjustment.is_complete else 0


def _planned(arguments: argparse.Namespace, network: "Network", progress: Progress) -> "PlanRecord":
    from obseq.survey import Quality, plan

    options = given({name: getattr(arguments, name) for name in ("level", "power", "ellipses")})
    found = plan(
        network,
        Quality(relative=arguments.relative, **options),
        with_gains=not arguments.no_gains,
        farthest=arguments.farthest,
        counted=arguments.points,
        draws=arguments.draws or 0,
        seed=arguments.seed,
        progress=progress,
    )
    return found.record(arguments.most)


def texts_of(record: "PlanRecord") -> "dict[str, Callable[[], str]]":
    """What writes plan.json, plan.txt and plan.html, by the names of the formats."""
    from obseq.report.planned import outcome, plan_page
    from obseq.report.result_file import text_of
    from obseq.report.summary import listing

    return {
        "json": partial(text_of, record),
        "text": lambda: listing(outcome(record)),
        "html": partial(plan_page, record),
    }


def run_simulate(arguments: argparse.Namespace) -> int:
    """Simulate what the command line names."""
    source = source_of(arguments)
    observations, cor, table = (arguments.out / f"simulated.{suffix}" for suffix in ("obs", "cor", "csv"))
    places = [observations, cor, table]
    check_writable(places, source.files)
    with Progress("starting") as progress:
        from obseq.formats.conversion import tabled_points
        from obseq.formats.obs.cor import cor_text
        from obseq.formats.obs.obs import obs_text
        from obseq.formats.point_files import csv_text
        from obseq.survey import simulate

        with Stopwatch(progress).counted("read"):
            network = source.read(places)
        if network.book.clusters or network.book.has_shared_unknowns:
            raise InputError(
                "simulate: OBS files hold no correlated observations, nor groups with unknowns of their own"
            )
        progress("simulate")
        drawn = simulate(network, None if arguments.exact else arguments.seed, noise=not arguments.exact)
        progress("write")
        texts = {observations: obs_text(drawn.book)}
        if drawn.points.is_invented.any():
            texts[table] = csv_text(tabled_points(drawn))
        else:
            texts[cor] = cor_text(drawn.given_points())
        write_all(texts)
    for text in drawn.book.warnings[len(network.book.warnings) :]:
        print(f"Warning: {text}")
    print(f"written: {', '.join(map(str, texts))}")
    return 0
