"""Where the results of a command go: the options that say so, and the writing."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, TypeVar

from msgspec import structs

from obseq.boundary import Boundary
from obseq.cli.parsing import coloured, output_file
from obseq.errors import InputError
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.shown_units import METRIC, chosen_units
from obseq.report import formats
from obseq.report.formats import FORMATS, Format
from obseq.report.summary import USUAL, Detail, check_shown, told
from obseq.stopwatch import Progress, silent
from obseq.writing import STANDARD_OUTPUT, write_all

if TYPE_CHECKING:
    from obseq.report.summary import Outcome
    from obseq.survey import Network

INCOMPLETE = 1
"""Exit code: not converged, or something was left out."""

STEM = "adjustment"
"""Name of the files in a folder of results."""

Made = TypeVar("Made")
Outputs = Sequence[tuple[Path, Format]]


def add_result_arguments(command: argparse.ArgumentParser) -> None:
    """Add what says where results are written: a folder for all, or a file per format."""
    results = command.add_argument_group("results")
    most = formats.LARGE
    sizes = ([form for form in FORMATS if form.suits(size)] for size in (0, most + 1))
    usual, large = (", ".join(f"{STEM}{form.suffix}" for form in chosen) for chosen in sizes)
    purpose = f"folder for {usual}; of more than {most} observations, for {large}"
    results.add_argument("--out", type=Path, metavar="DIR", help=purpose)
    add_units(results)
    add_detail(results)
    for form in FORMATS:
        results.add_argument(f"--{form.name}", type=output_file, metavar="FILE", help=form.purpose)


def add_units(group: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add what says in which units lengths and angles are shown."""
    group.add_argument(
        "--units",
        nargs="+",
        metavar="UNIT",
        default=(),
        help="units of the reports, of m, ft, us-ft, gon, degree, dms (without it those of the files; JSON "
        "always holds metres and radians)",
    )


def in_units(record: AdjustmentRecord, arguments: argparse.Namespace) -> AdjustmentRecord:
    """The record with the units of its reports that --units asks for."""
    return structs.replace(record, units=chosen_units(arguments.units, record.units))


def shown_in(network: "Network", words: Iterable[str]) -> "Network":
    """The network, whose values are told in the units that --units asks for."""
    return replace(network, shown=chosen_units(words, network.shown or METRIC))


def outputs_of(arguments: argparse.Namespace, stem: str | None = None) -> Outputs:
    """Where each format goes: in the folder of --out, unless a file is named: then whatever the size is."""
    inside = dict(_inside(arguments.out, stem or STEM)) if arguments.out else {}
    asked = {form: getattr(arguments, form.name) for form in FORMATS}
    named = [(path, replace(form, sizes="all")) for form, path in asked.items() if path]
    return [*named, *((path, form) for form, path in inside.items() if not asked[form])]


def outputs_in(folder: Path) -> Outputs:
    """All formats, in a folder."""
    return [(path, form) for form, path in _inside(folder, STEM)]


def suiting(size: int, outputs: Outputs) -> Outputs:
    """Those that a result of so many observations is written in."""
    return [(path, form) for path, form in outputs if form.suits(size)]


def not_written(size: int, outputs: Outputs) -> str:
    """Which files of the folder of a large result are not written, and how to get them."""
    spared = [(path, form) for path, form in outputs if not form.suits(size)]
    if size <= formats.LARGE or not spared:
        return ""
    columns = next(path for path, form in outputs if form.name == "npz")
    names = " and ".join(path.name for path, _ in spared)
    options = " ".join(f"--{form.name} FILE" for _, form in spared)
    return (
        f"Not written, as there are more than {formats.LARGE} observations: {names}, nor kept of an earlier "
        f"run; obseq report {columns} {options} writes them"
    )


def tell_not_written(size: int, outputs: Outputs) -> None:
    """Print that, where the summary is printed."""
    if text := not_written(size, outputs):
        print(text, file=_stream([path for path, _ in outputs]))


def _stream(paths: Sequence[Path]) -> TextIO:
    """Where a summary goes: beside a result that is printed itself, which a program may read."""
    return sys.stderr if STANDARD_OUTPUT in paths else sys.stdout


def forget(size: int, outputs: Outputs) -> None:
    """Delete what an earlier run left in the folder in formats that this result is not written in."""
    for path, form in outputs:
        if not form.suits(size) and path.is_file():
            path.unlink()


def add_detail(group: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add what says how much is printed."""
    group.add_argument("-q", "--quiet", action="store_true", help="print the verdict alone")
    group.add_argument(
        "-v", "--verbose", action="store_true", help="print all findings, iterations, worst residuals, times"
    )
    purpose = "print tables of the page as well: points, residuals, ..."
    group.add_argument("--show", nargs="+", metavar="TABLE", default=(), help=purpose)


def detail_of(arguments: argparse.Namespace, kind: str) -> Detail:
    """What the options say of it.

    Args:
        arguments: Of the command line.
        kind: Of the result, which knows the tables that may be shown; "" where it is not known yet.

    Raises:
        InputError: Options contradict each other, or there is no such table.
    """
    if arguments.show and kind:
        check_shown(_tables(kind), arguments.show)
    if arguments.quiet and (arguments.verbose or arguments.show):
        raise InputError("--quiet prints the verdict alone: leave out --verbose and --show")
    amount = "quiet" if arguments.quiet else "verbose" if arguments.verbose else "usual"
    return Detail(amount, tuple(arguments.show))


def _tables(kind: str) -> tuple[str, ...]:
    from obseq.report.tables.content import TABLES

    if kind == "plan":
        from obseq.report.tables.content_plan import PLAN_TABLES

        return (*PLAN_TABLES, *TABLES)
    if kind == "block":
        from obseq.images.output.page_tables import TABLES as OF_BLOCKS

        return tuple(OF_BLOCKS)
    return ("displacements",) if kind == "comparison" else tuple(TABLES)


def show(
    outcome: "Outcome",
    written: Iterable[Path] = (),
    detail: Detail = USUAL,
    seconds: Mapping[str, float] | None = None,
) -> None:
    """Print the summary, on standard error where a result is printed: that may be read by a program."""
    paths = list(written)
    stream = _stream(paths)
    for line, level in told(outcome, [str(path) for path in paths], detail, seconds):
        print(coloured(line, level, stream), file=stream)


@contextmanager
def shown_anyway(show: Callable[[], None]) -> Iterator[None]:
    """Where results cannot be written (a full disk), what was found is printed before the error."""
    try:
        yield
    except InputError:
        show()
        raise


def show_adjustment(
    record: AdjustmentRecord, outputs: Outputs, detail: Detail = USUAL, others: Iterable[Path] = ()
) -> None:
    """The same of a network; other files come first."""
    from obseq.report.adjusted import outcome

    begun = time.perf_counter()
    seconds = {phase.name: phase.seconds for phase in record.phases or ()}
    found = outcome(record)
    seconds["summary"] = time.perf_counter() - begun
    size = len(record.observations)
    show(found, [*others, *(path for path, _ in suiting(size, outputs))], detail, seconds)
    tell_not_written(size, outputs)


def telling(writers: Mapping[Path, Callable[[], Made]], told: Progress) -> dict[Path, Callable[[], Made]]:
    """What writes some files, each of which says how far the writing is."""

    def written(number: int, write: Callable[[], Made]) -> Made:
        told(f"write: file {number} of {len(writers)}")
        return write()

    return {path: partial(written, k, write) for k, (path, write) in enumerate(writers.items(), 1)}


def write(
    record: AdjustmentRecord,
    outputs: Outputs,
    others: Mapping[Path, str | bytes] | None = None,
    told: Progress = silent,
) -> AdjustmentRecord:
    """Write all the results that can be made, other files among them; the record with what cannot."""
    boundary, size = Boundary(), len(record.observations)
    writers = {path: partial(form.write, record) for path, form in suiting(size, outputs)}
    write_all({**(others or {}), **boundary.texts(telling(writers, told))}, boundary.tell)
    forget(size, outputs)
    failures = tuple(boundary.failures)
    warnings = (*failures, *record.warnings)
    return structs.replace(record, warnings=warnings, failures=(*record.failures, *failures))


def _inside(folder: Path, stem: str) -> Iterator[tuple[Format, Path]]:
    return ((form, folder / f"{stem}{form.suffix}") for form in FORMATS)
