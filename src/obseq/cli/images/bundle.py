"""`obseq bundle`: a block of images from tables, or from the files of other programs."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msgspec import structs

from obseq.boundary import Boundary, interruptions_end_searches
from obseq.cli.images.bundle_sources import DATUMS, add_sources, inputs, read_block
from obseq.cli.in_blocks import add_blocks_arguments, blocks_of, ended
from obseq.cli.parsing import (
    Commands,
    add_command,
    add_iterations,
    output_file,
    positive_integer,
    positive_number,
    sigma,
)
from obseq.cli.progress import Progress
from obseq.cli.results import (
    INCOMPLETE,
    add_detail,
    detail_of,
    forget,
    outputs_of,
    show,
    shown_anyway,
    tell_not_written,
    telling,
)
from obseq.errors import ObseqError, noting
from obseq.formats.blocks.catalogue import WRITERS
from obseq.printable import printable
from obseq.report.formats import LARGE
from obseq.stopwatch import Stopwatch
from obseq.writing import check_writable, forget_second, second_of, write_all

if TYPE_CHECKING:
    Options = dict[str, Any]
    from collections.abc import Callable, Mapping

    from obseq.formats.blocks.catalogue import BlockWriter
    from obseq.images import BundleAdjustment, BundleSolution
    from obseq.images.output.block_record import BundleRecord
    from obseq.images.poses import Poses
    from obseq.report.summary import Detail
    from obseq.writing import Content

MORE = """
A block is given by tables with a line of column names (cameras, images with or without poses,
control points, image measures), or by one file of another program. Images without a pose are
placed by resection, or from their neighbours. With --obs and --cor, survey observations join the
same adjustment."""

EXAMPLE = """\
examples:
  obseq bundle --cameras cameras.csv --images images.csv --control control.csv \\
      --measures measures.csv --image-sigma 0.5 --out results
  obseq bundle --bal problem.txt --datum centres --ply block.ply
  obseq bundle --colmap sparse/0 --control control.csv --out results

columns (commas or blanks, any order; # begins a comment):
  cameras   name width height focal [ppx ppy K1 K2 K3 p1 p2 b1 b2 ...]       pixels
  images    image camera [x y z omega phi kappa]   degrees; or w p k, yaw pitch roll, qw qx qy qz
  control   point x y z [sigma, or sx sy sz]       0: held; empty: free
  measures  image point x y [sigma, or sx sy, sxy]      pixels"""

EXITS = """\
exit code: 0 adjusted, also where the test of sigma0 fails and the diagnosis accepts the residuals; 1 not
converged, something left out, an error suspected, residuals that nothing explains, or half of the measures
of the block, of an image or of a point rejected; 2 could not run"""

COMMON = (
    *(
        "help",
        "help_all",
        "cameras",
        "images",
        "control",
        "measures",
        "obs",
        "cor",
        "colmap",
        "metashape",
    ),
    *("image_sigma", "control_sigma", "freeze", "datum", "out", "quiet", "verbose", "show"),
)
"""What most users need."""

STEM = "bundle"
"""Name of the results in a folder."""
FILES = {
    "json": ("bundle.json", "every result at full precision"),
    "ply": ("block.ply", "points and cameras for a viewer"),
    "poses": ("poses.csv", "adjusted images, in the form of --images"),
    "interior": ("cameras.csv", "adjusted cameras, in the form of --cameras"),
    "points": ("points.csv", "adjusted points with their sigmas"),
    "checks": ("checks.csv", "check points: adjusted minus given, with sigmas"),
    "text": ("bundle.txt", "a complete listing"),
    "html": ("bundle.html", "a page with drawings: views, residuals, calibrations"),
    "npz": ("bundle.npz", "every result as columns, for programs and large blocks"),
}


def register(commands: Commands) -> None:
    """Add the command to the parser."""
    purpose = "adjust a block of images"
    command = add_command(commands, "bundle", run, purpose, MORE, EXAMPLE, exits=EXITS, common=COMMON)
    command.usage = "obseq bundle [options]"
    add_sources(command)
    _add_computation(command)
    results = command.add_argument_group("results")
    names = ", ".join(name for option, (name, _) in FILES.items() if option != "npz")
    purpose = (
        f"folder for {names}; of more than {LARGE} image points, bundle.npz in place of JSON and listing"
    )
    results.add_argument("--out", type=Path, metavar="DIR", help=purpose)
    add_detail(results)
    for option, (_, purpose) in FILES.items():
        results.add_argument(f"--{option}", type=output_file, metavar="FILE", help=purpose)
    for writer in WRITERS:
        results.add_argument(f"--{writer.option}", type=Path, metavar=writer.takes, help=writer.holds)


def _add_computation(command: argparse.ArgumentParser) -> None:
    computation = command.add_argument_group("computation")
    computation.add_argument(
        "--image-sigma", type=sigma, metavar="PX", help="sigma of measures whose table gives none"
    )
    computation.add_argument(
        "--control-sigma",
        type=positive_number,
        metavar="S",
        help="sigma of control points whose table gives none",
    )
    computation.add_argument(
        "--attenuation",
        type=positive_number,
        metavar="PX",
        help="robust weights: a measure with this residual has half of its weight (needs --image-sigma)",
    )
    computation.add_argument(
        "--threshold", type=positive_number, metavar="PX", help="measures beyond have no weight"
    )
    computation.add_argument(
        "--freeze",
        metavar="PATTERN",
        help="camera parameters that keep their values: 'K3|p.', or '.*' for all",
    )
    computation.add_argument(
        "--free", metavar="PATTERN", help="camera parameters that are unknown, whatever the files say"
    )
    computation.add_argument(
        "--datum",
        choices=DATUMS,
        help="what fixes position, orientation and scale (without control points: centres or points)",
    )
    add_iterations(computation, "levenberg-marquardt")
    computation.add_argument(
        "--without-accused",
        action="store_true",
        help="adjust again without what is accused, where that explains all; files end with -without-accused",
    )
    computation.add_argument(
        "--threads", type=positive_integer, default=1, metavar="N", help="how many share the work"
    )
    add_blocks_arguments(command)


def run(arguments: argparse.Namespace) -> int:
    """Adjust what the command line names."""
    arguments.blocks = blocks_of(arguments)
    with ended(arguments.blocks), interruptions_end_searches():
        return _adjusted(arguments)


def _adjusted(arguments: argparse.Namespace) -> int:
    outputs = _outputs(arguments)
    second = _second(outputs).values() if arguments.without_accused else ()
    others = [path for writer, place in _asked(arguments) for path in writer.places(place)]
    check_writable([*outputs.values(), *second, *others], inputs(arguments))
    detail = detail_of(arguments, "block")
    with Progress("loading") as progress:
        watch = Stopwatch(progress)
        with watch.phase("load"):
            from obseq.images.diagnosing.refusals import explained
            from obseq.images.output.overview import overview

        with watch.phase("read"), watch.counted("read"):
            block, datum = read_block(arguments)
        given, options = block.poses, _options(datum, arguments)
        if not block.check_points and not arguments.checks:
            outputs.pop("checks", None)
        with noting(block.notes):
            for writer, _ in _asked(arguments):
                writer.check(block)
            read = overview(block)
            if detail.amount != "quiet":
                progress.tell(read)
                detail = replace(detail, lines=detail.lines - read.count("\n"))
            with explained(block, progress, **options):
                solution = _solve(block, options, watch)
        record, written = _reported(solution, given, arguments, outputs, options, watch, read)
    forget_second(outputs.values(), inputs(arguments))
    _show(record, written, detail, watch)
    tell_not_written(len(record.measures), outputs_of(arguments, STEM))
    if arguments.without_accused:
        return _without_accused(solution, record, arguments, outputs, options)
    return 0 if record.is_complete else INCOMPLETE


def _reported(
    solution: BundleSolution,
    given: Poses,
    arguments: argparse.Namespace,
    outputs: Mapping[str, Path],
    options: Options,
    watch: Stopwatch,
    read: str,
) -> tuple[BundleRecord, list[Path]]:
    """The record of a solution, and its files, when they are written."""
    from obseq.images.diagnosing.diagnosis import diagnosed
    from obseq.images.output.record import record_of

    boundary = Boundary()
    search = partial(diagnosed, solution, given, watch.progress, **options)
    with watch.phase("search for errors"):
        diagnosis = boundary.attempt("the search for errors", search, None, ends=True)
    with watch.phase("record"):
        record = record_of(solution, diagnosis=diagnosis, failures=boundary.failures)
    with watch.phase("write"):
        boundary, size = Boundary(), len(record.measures)
        results = [(outputs[form.name], form) for _, form in outputs_of(arguments, STEM)]
        spared = {path for path, form in results if not form.suits(size)}
        outputs = {option: path for option, path in outputs.items() if path not in spared}
        files = boundary.texts(telling(_writers(outputs, solution, record, read), watch.progress))
        others = _written(arguments, solution, boundary)
        files |= {path: text for made in others.values() for path, text in made.items()}
        with shown_anyway(partial(_show, record, [], detail_of(arguments, "block"), watch)):
            write_all(files, boundary.tell)
        forget(size, results)
    record = structs.replace(record, failures=(*record.failures, *boundary.failures))
    return record, [path for path in outputs.values() if path in files] + list(others)


def _show(record: BundleRecord, written: list[Path], detail: Detail, watch: Stopwatch) -> None:
    from obseq.images.output.page import outcome

    with watch.phase("summary"):
        found = outcome(record)
    show(found, written, detail, watch.seconds)


def _without_accused(
    solution: BundleSolution,
    first: BundleRecord,
    arguments: argparse.Namespace,
    outputs: Mapping[str, Path],
    options: Options,
) -> int:
    """Adjusts again without what is accused; where there is no such adjustment, says why."""
    from obseq.images.diagnosing.without_accused import without_accused

    places = _second(outputs)
    none = {writer.option.replace("-", "_"): None for writer in WRITERS}
    alone = argparse.Namespace(**{**vars(arguments), **none})
    try:
        with Progress("adjusting without what is accused") as progress:
            block = without_accused(solution, first.diagnosis)
            given = block.poses
            block.initialise(causes=False)
            rest = block.solve(**options)
            watch = Stopwatch(progress)
            record, written = _reported(rest, given, alone, places, options, watch, "")
    except ObseqError as error:
        print(printable(f"--without-accused: no second adjustment: {error}"), file=sys.stderr)
        return 0 if first.is_complete else INCOMPLETE
    print()
    _show(record, written, detail_of(arguments, "block"), watch)
    return INCOMPLETE


def _second(outputs: Mapping[str, Path]) -> dict[str, Path]:
    """The files of the adjustment without what is accused."""
    return {option: second_of(path) for option, path in outputs.items()}


def _outputs(arguments: argparse.Namespace) -> dict[str, Path]:
    """Option -> file, for those that are asked for."""
    places = {
        option: getattr(arguments, option) or (arguments.out / name if arguments.out else None)
        for option, (name, _) in FILES.items()
    }
    return {option: path for option, path in places.items() if path}


def _writers(
    outputs: Mapping[str, Path], solution: BundleSolution, record: BundleRecord, read: str
) -> dict[Path, Callable[[], Content]]:
    from obseq.images.output.clouds import camera_table, check_table, ply, point_table, pose_table
    from obseq.images.output.page import contents, text

    writers: dict[str, Callable[[], Content]] = {
        **contents(record),
        "ply": lambda: ply(solution),
        "poses": lambda: pose_table(solution),
        "interior": lambda: camera_table(solution),
        "points": lambda: point_table(solution),
        "checks": lambda: check_table(record),
        "text": lambda: f"{text(record)}\n{read}",
    }
    return {path: writers[option] for option, path in outputs.items() if option in writers}


def _asked(arguments: argparse.Namespace) -> list[tuple[BlockWriter, Path]]:
    """The formats of other programs that are asked for, and where they go."""
    given = vars(arguments)
    return [
        (writer, path) for writer in WRITERS if (path := given[writer.option.replace("-", "_")]) is not None
    ]


def _written(
    arguments: argparse.Namespace, solution: BundleSolution, boundary: Boundary
) -> dict[Path, dict[Path, str]]:
    """Place -> texts of its files, in the formats of other programs; none takes the place of an input."""
    found: dict[Path, dict[Path, str]] = {}
    for writer, place in _asked(arguments):
        made = boundary.attempt(f"--{writer.option}", partial(writer.files, solution, place), {})
        check_writable(list(made), inputs(arguments))
        if made:
            found[place] = made
    return found


def _options(datum: str | tuple[str, ...], arguments: argparse.Namespace) -> Options:
    given = {"strategy": arguments.strategy} if arguments.strategy else {}
    limits = {"max_iterations": arguments.iterations, "tolerance": arguments.tolerance}
    return {"datum": datum, "threads": arguments.threads, "blocks": arguments.blocks, **limits, **given}


def _solve(block: BundleAdjustment, options: Options, watch: Stopwatch) -> BundleSolution:
    with watch.phase("initial values"), watch.counted("initial values"):
        block.initialise()
    with watch.phase("adjust"):
        return block.solve(progress=lambda step: watch.progress(str(step)), **options)
