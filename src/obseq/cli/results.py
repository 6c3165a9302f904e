"""Where the results of a command go: the options that say so, and the writing."""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec import structs

from obseq.boundary import Boundary
from obseq.cli.parsing import coloured, output_file, say
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import printable
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.shown_units import METRIC, chosen_units
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

Outputs = Sequence[tuple[Path, Format]]


def add_result_arguments(command: argparse.ArgumentParser) -> None:
    """Add what says where results are written: a folder for all, or a file per format."""
    results = command.add_argument_group("results")
    names = ", ".join(f"{STEM}{form.suffix}" for form in FORMATS)
    results.add_argument("--out", type=Path, metavar="DIR", help=f"folder for {names}")
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
    places = ((form, getattr(arguments, form.name) or inside.get(form)) for form in FORMATS)
    return [(path, form) for form, path in places if path]


def outputs_in(folder: Path) -> Outputs:
    """All formats, in a folder."""
    return [(path, form) for form, path in _inside(folder, STEM)]


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
    paths = [*others, *(path for path, _ in outputs)]
    text = summary(record, [str(path) for path in paths], detail.amount, detail.shown)
    judged = verdict(record)
    say(coloured(text, {judged.text: judged.level}), paths)


def write(
    record: AdjustmentRecord, outputs: Outputs, others: Mapping[Path, str | bytes] | None = None
) -> AdjustmentRecord:
    """Write all the results that can be made, other files among them; the record with what cannot."""
    boundary = Boundary()
    texts = boundary.texts({path: partial(form.write, record) for path, form in outputs})
    write_all({**(others or {}), **texts})
    told = tuple(boundary.failures)
    return structs.replace(record, warnings=(*told, *record.warnings), failures=(*record.failures, *told))


def _inside(folder: Path, stem: str) -> Iterator[tuple[Format, Path]]:
    return ((form, folder / f"{stem}{form.suffix}") for form in FORMATS)
