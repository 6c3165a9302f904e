"""Where the results of a command go: the options that say so, and the writing."""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from msgspec import structs

from obseq.boundary import Boundary
from obseq.cli.parsing import coloured, output_file, say
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import printable
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.shown_units import METRIC, chosen_units
from obseq.report import formats
from obseq.report.adjusted import verdict
from obseq.report.formats import FORMATS, Format
from obseq.report.said import plain
from obseq.report.summary import SHOWN, in_text, summary
from obseq.writing import write_all

if TYPE_CHECKING:
    from obseq.report.head import Page
    from obseq.report.units import Units
    from obseq.survey import Network

INCOMPLETE = 1
"""Exit code: not converged, or something was left out."""

STEM = "adjustment"
"""Name of the files in a folder of results."""


class Output(NamedTuple):
    """A file of results.

    Attributes:
        path: Where.
        form: Its format.
        is_asked: Whether it was asked for by itself, and is written whatever its size.
    """

    path: Path
    form: Format
    is_asked: bool = False


Outputs = Sequence[Output]


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
    """Where each format goes: in the folder of --out, unless a file is named."""
    inside = dict(_inside(arguments.out, stem or STEM)) if arguments.out else {}
    asked = {form: getattr(arguments, form.name) for form in FORMATS}
    return [
        Output(path, form, asked[form] is not None)
        for form in FORMATS
        if (path := asked[form] or inside.get(form))
    ]


def outputs_in(folder: Path) -> Outputs:
    """All formats, in a folder."""
    return [Output(path, form) for form, path in _inside(folder, STEM)]


def suiting(size: int, outputs: Outputs) -> Outputs:
    """Those that a result of so many observations is written in."""
    return [output for output in outputs if output.is_asked or output.form.suits(size)]


def left_out(size: int, outputs: Outputs) -> str:
    """Which files of a folder are not written, and how to get them; empty where all are."""
    written = suiting(size, outputs)
    spared = [output for output in outputs if output not in written]
    if size <= formats.LARGE or not spared:
        return ""
    columns = next(output.path for output in written if output.form.sizes == "large")
    names = " and ".join(output.path.name for output in spared)
    options = " ".join(f"--{output.form.name} FILE" for output in spared)
    return (
        f"Not written, as there are more than {formats.LARGE} observations: {names}, nor kept of an earlier "
        f"run; obseq report {columns} {options} writes them\n"
    )


def forget(size: int, outputs: Outputs) -> None:
    """Delete what an earlier run left in the folder in formats that this result is not written in."""
    written = suiting(size, outputs)
    for output in outputs:
        if output not in written and output.path.is_file():
            output.path.unlink()


def add_quiet(group: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add what leaves the verdict alone of what is printed."""
    group.add_argument("-q", "--quiet", action="store_true", help="print the verdict alone")


def print_verdict(page: "Page", units: "Units", written: Iterable[Path]) -> None:
    """Print the sentence that the page begins with, in its colour, and what was written."""
    sentence = in_text(plain(page.verdict.text, units))
    print(printable(coloured(sentence, {sentence: page.verdict.level})))
    if names := ", ".join(map(str, written)):
        print(printable(f"Written: {names}"))


def add_detail(group: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add what says how much is printed."""
    add_quiet(group)
    group.add_argument(
        "-v", "--verbose", action="store_true", help="print iterations, residuals, all notes, times"
    )
    purpose = "print tables as well, of points, observations or known coordinates"
    group.add_argument("--show", nargs="+", choices=SHOWN, metavar="TABLE", default=(), help=purpose)


@dataclass(frozen=True)
class Detail:
    """How much is printed.

    Attributes:
        amount: "quiet", "usual" or "verbose".
        shown: Tables that are printed as well.
    """

    amount: str = "usual"
    shown: tuple[str, ...] = ()


def detail_of(arguments: argparse.Namespace) -> Detail:
    """What the options say of it."""
    if arguments.quiet and (arguments.verbose or arguments.show):
        raise InputError("--quiet prints the verdict alone: leave out --verbose and --show")
    amount = "quiet" if arguments.quiet else "verbose" if arguments.verbose else "usual"
    return Detail(amount, tuple(arguments.show))


USUAL = Detail()


def show(
    record: AdjustmentRecord, outputs: Outputs, others: Sequence[Path] = (), detail: Detail = USUAL
) -> None:
    """Print the summary, and what was written: other files first."""
    size = len(record.observations)
    paths = [*others, *(output.path for output in suiting(size, outputs))]
    text = summary(record, [str(path) for path in paths], detail.amount, detail.shown)
    text += left_out(size, outputs)
    judged = verdict(record)
    say(coloured(text, {judged.text: judged.level}), paths)


def write(
    record: AdjustmentRecord, outputs: Outputs, others: Mapping[Path, str | bytes] | None = None
) -> AdjustmentRecord:
    """Write all the results that can be made, other files among them; the record with what cannot."""
    boundary, size = Boundary(), len(record.observations)
    writers = {output.path: partial(output.form.write, record) for output in suiting(size, outputs)}
    write_all({**(others or {}), **boundary.texts(writers)}, boundary.tell)
    forget(size, outputs)
    told = tuple(boundary.failures)
    return structs.replace(record, warnings=(*told, *record.warnings), failures=(*record.failures, *told))


def _inside(folder: Path, stem: str) -> Iterator[tuple[Format, Path]]:
    return ((form, folder / f"{stem}{form.suffix}") for form in FORMATS)
