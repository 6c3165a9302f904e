"""`obseq compare`: two epochs of a network."""

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from obseq.cli.networks.network_files import COMMON, Source, add_network_arguments, source_of
from obseq.cli.parsing import Commands, add_command, probability
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

    from obseq.records.comparison import ComparisonRecord
    from obseq.report.summary import Outcome

MORE = """
Adjusts both epochs in one frame, and tests which points have moved. Without --reference, the known points are
the datum, but for those that have moved by what the observations alone say: they are named. With it, the
epochs rest on inner constraints of the reference points and are fitted together on those that have stayed,
and the others are named."""

EXAMPLE = """\
examples:
  obseq compare may.obs points.cor --obs-2 october.obs
  obseq compare may.obs points.cor --obs-2 october.obs --level 0.01 --out moved
  obseq compare may.gkf --project-2 october.gkf --reference P1 P2 P3 P4"""

EXITS = """\
exit code: 0 nothing has moved significantly; 1 something has, or an epoch is incomplete, or a gross error
is suspected in one (no verdict then); 2 could not run"""
NAMES = ("comparison.json", "comparison.txt", "comparison.csv", "comparison.html")


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "say what has moved between two epochs of a network"
    common = (*COMMON, "obs_2", "cor_2", "project_2", "reference", "points", "level")
    command = add_command(commands, "compare", run, purpose, MORE, EXAMPLE, exits=EXITS, common=common)
    add_network_arguments(command)
    second = command.add_argument_group("second epoch")
    second.add_argument("--obs-2", nargs="+", type=Path, metavar="FILE", help="its observation files (OBS)")
    second.add_argument(
        "--cor-2",
        nargs="+",
        type=Path,
        metavar="FILE",
        help="its point files (those of the first)",
    )
    second.add_argument("--project-2", nargs="+", type=Path, metavar="PROJECT", help="or its project")
    wanted = command.add_argument_group("tests")
    wanted.add_argument("--level", type=probability, default=0.05, metavar="P", help="level of a test (0.05)")
    wanted.add_argument(
        "--points", nargs="+", type=composed, metavar="NAME", help="the points to compare (all common ones)"
    )
    wanted.add_argument(
        "--reference", nargs="+", type=composed, metavar="NAME", help="points that should have stayed"
    )
    wanted.add_argument("--a-priori", action="store_true", help="trust the given sigmas")
    add_units(command)
    add_detail(command)
    command.add_argument("--out", type=Path, metavar="DIR", help=f"folder for {', '.join(NAMES)}")


def run(arguments: argparse.Namespace) -> int:
    """Compare what the command line names."""
    first, detail = source_of(arguments), detail_of(arguments, "comparison")
    second = _second(arguments, first)
    places = [arguments.out / name for name in NAMES] if arguments.out else []
    check_writable(places, [*first.files, *second.files])
    with Progress("starting") as progress:
        watch = Stopwatch(progress)
        with watch.phase("load"):
            from obseq.report.compared import outcome
            from obseq.survey import compare  # noqa: F401  # its time is not that of reading
        record = _compared(arguments, first, second, watch)
        with watch.phase("write"), shown_anyway(lambda: show(outcome(record), (), detail)):
            made = dict(zip(places, texts_of(record).values(), strict=True)) if places else {}
            write_all({path: text() for path, text in telling(made, progress).items()})
    with watch.phase("summary"):
        found = outcome(record)
    show(found, places, detail, watch.seconds)
    return exit_code(found)


def exit_code(found: "Outcome") -> int:
    """0 where both epochs are whole, and nothing has moved."""
    return 0 if found.head.verdict.level == "ok" else INCOMPLETE


def texts_of(record: "ComparisonRecord") -> "dict[str, Callable[[], str]]":
    """What writes the files, by the names of the formats."""
    from obseq.report.compared import comparison_csv, comparison_page, outcome
    from obseq.report.result_file import text_of
    from obseq.report.summary import listing

    return {
        "json": partial(text_of, record),
        "text": lambda: listing(outcome(record)),
        "csv": partial(comparison_csv, record),
        "html": partial(comparison_page, record),
    }


def _second(arguments: argparse.Namespace, first: Source) -> Source:
    """The files of the second epoch, read like those of the first."""
    if bool(arguments.obs_2) == bool(arguments.project_2):
        raise InputError("compare: give the second epoch with --obs-2, or with --project-2")
    if bool(arguments.project_2) != bool(first.project):
        raise InputError("compare: both epochs must be projects, or both observation and point files")
    from obseq.formats.once import require_another

    require_another(arguments.project_2 or arguments.obs_2, [*first.project, *first.observations])
    if arguments.project_2:
        return replace(first, project=arguments.project_2)
    return replace(first, observations=arguments.obs_2, points=arguments.cor_2 or first.points)


def _compared(
    arguments: argparse.Namespace, first: Source, second: Source, watch: Stopwatch
) -> "ComparisonRecord":
    from obseq.survey import Datum, compare
    from obseq.survey.adjustment.datum import DatumKind

    with watch.phase("read"), watch.counted("read"):
        before = shown_in(first.read(), arguments.units)
    reading = second.reading | {"frame": before.frame.system.definition}
    if not second.project:
        reading["points_crs"] = before.points_crs.definition
    with watch.phase("read"), watch.counted("read"):
        after = shown_in(replace(second, reading=reading).read(), arguments.units)
    # coordinates of reference points that have moved would bend the network
    datum = Datum(DatumKind.INNER, tuple(arguments.reference)) if arguments.reference else None
    with watch.phase("adjust"):
        epochs = [network.adjust(progress=watch.progress, datum=datum) for network in (before, after)]
    with watch.phase("compare"):
        found = compare(
            epochs[0],
            epochs[1],
            arguments.level,
            points=arguments.points,
            reference=arguments.reference,
            a_priori=arguments.a_priori,
        )
        return found.record()
