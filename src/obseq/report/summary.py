"""The summary on the terminal: whether the result may be used, what is wrong, how good it is."""

import textwrap
import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from heapq import nlargest

from msgspec import structs

from obseq.arguments import TEXT, TEXTS, WORDS, expecting, instance
from obseq.errors import InputError
from obseq.printable import listed, printable
from obseq.records.adjustment import AdjustmentRecord
from obseq.report import units
from obseq.report.adjusted import cards, verdict
from obseq.report.content import numbers_of, tables
from obseq.report.quality import single_tests, snooping_lines
from obseq.report.said import plain
from obseq.report.spared import spared
from obseq.report.verdict import Verdict
from obseq.report.writer import Writer, worst

WIDTH = 100
MOST_POINTS = 8
MOST_NOTES = 2
SHOWN = ("points", "observations", "known")
"""Tables that a summary may have."""
SIGNS = {"\u2192": "->", "\u03c3": "sigmas", " \u00b7 ": "; ", "\u00d7": "x", "\u2013": "-"}
TERSE = (
    "type", "from", "to", "file", "line", "observed", "sigma", "residual", "w", "redundancy", "point",
    "coordinate", "given", "normalised", "vector", "T", "limit", "T / limit", "off by",
)  # fmt: skip
"""Columns of the worst rows."""
MOST_ERRORS = 5
MOST_ITERATIONS = 9
MOST_WARNINGS = 3
MOST_UNUSED = 3
WORST = 5
NOTABLE = 2.0
"""Normalised residual beyond which the summary shows a known coordinate."""


@expecting(record=instance(AdjustmentRecord), written=TEXTS, detail=TEXT, shown=WORDS)
def summary(
    record: AdjustmentRecord,
    written: Sequence[str] = (),
    detail: str = "usual",
    shown: Collection[str] = (),
) -> str:
    """The summary of an adjustment, at most thirty lines whatever the size of the network.

    Args:
        record: The adjustment.
        written: Names of the files where the results were written.
        detail: "quiet": the verdict alone; "verbose": iterations, the worst residuals, all notes, seconds.
        shown: Tables to print as well, of `SHOWN`.
    """
    if detail == "quiet":
        return printable(f"{verdict(record).text}\n{_files(written)}\n")
    begun, given = time.perf_counter(), spared(record)
    is_long = detail == "verbose"
    sections: list[Iterable[str]] = [_head(record), gross_errors(record, MOST_ERRORS), left_out(record)]
    sections += [_cards(given), _why(record), _joint(record), snooping_lines(record)]
    if is_long:
        sections += [_iterations(record), _worst(given), _known(given)]
    sections += [_table(given, name) for name in shown]
    sections += [warnings(record, len(record.warnings) if is_long else MOST_WARNINGS)]
    sections += [_notes(record, len(record.notes) if is_long else MOST_NOTES)]
    lines = [line for section in sections for line in section]
    lines += [*(_seconds(record, time.perf_counter() - begun) if is_long else ()), _files(written)]
    return printable("\n".join(lines) + "\n")


def _head(record: AdjustmentRecord) -> Iterator[str]:
    told = verdict(record)
    title = f"{record.title}: " if record.title else ""
    yield f"{title}{in_text(told.detail)}; redundancy {record.redundancy}"
    yield told.text


def in_text(sentence: str) -> str:
    """A sentence of the page in letters that every terminal has."""
    for sign, letters in SIGNS.items():
        sentence = sentence.replace(sign, letters)
    return sentence


def _cards(record: AdjustmentRecord) -> Iterator[str]:
    """Figures beside what they are compared with."""
    shown = units.units_of(record)
    rows = []
    for card in cards(record, numbers_of(record)):
        tag = "" if card.tag is None else card.tag[1]
        limits = ""
        if card.figure and card.figure["kind"] == "gauge":
            limits = f"{card.figure['lower']:.2f} to {card.figure['upper']:.2f}"
        expected = f"expected {limits}" if limits else card.unit
        parts = (card.label, card.value, expected, tag, card.note)
        rows.append([in_text(plain(part, shown)) for part in parts])
    widths = [max(len(row[k]) for row in rows) for k in range(4)] if rows else []
    for label, value, expected, tag, note in rows:
        first = f"  {label:<{widths[0]}}  {value:>{widths[1]}}"
        yield f"{first}  {expected:<{widths[2]}}  {tag:<{widths[3]}}  {note}".rstrip()


def _why(record: AdjustmentRecord) -> Iterator[str]:
    """What the test of sigma0 means, where it does not pass and nothing is accused."""
    found = Verdict(record)
    if record.planned or found.spoilt or (found.test is not None and found.is_accepted):
        return
    yield from textwrap.wrap(found.explanation, WIDTH, initial_indent="  ", subsequent_indent="  ")


def _joint(record: AdjustmentRecord) -> Iterator[str]:
    """The tests of vectors and positions, where some fail."""
    if any(item.is_beyond for item in record.joint):
        yield from (f"  {line}" for line in single_tests(record))


def _iterations(record: AdjustmentRecord) -> Iterator[str]:
    values = [units.significant(row.sigma0) for row in record.iterations]
    if len(values) > MOST_ITERATIONS:
        half = MOST_ITERATIONS // 2
        values = [*values[:half], "...", *values[-half:]]
    yield f"  sigma0 at the start of each iteration  {'  '.join(values)}"
    yield f"  sigma0 of the solution                 {units.significant(record.sigma0)}"
    yield f"  {tested(record)}"


def _table(record: AdjustmentRecord, name: str) -> Iterator[str]:
    """A table that is asked for, the worst first."""
    if name not in SHOWN:
        raise InputError(f"there is no table {name!r} to show; there are {', '.join(SHOWN)}")
    yield ""
    yield from _lines(record, name, by={"observations": "w", "known": "normalised"}.get(name))
    yield ""


def _lines(
    record: AdjustmentRecord, name: str, by: str | None = None, most: int | None = None
) -> Iterator[str]:
    """The first rows of a table, those of the largest values of a column first."""
    numbers = numbers_of(record)
    writer = Writer(list(numbers), units.units_of(record))
    for table in tables(record, numbers, [name]):
        rows = range(len(table["columns"][0]["values"])) if by is None else worst(table, by)
        yield from writer.lines(table, rows[:most], () if most is None else TERSE)


def _notes(record: AdjustmentRecord, most: int) -> Iterator[str]:
    yield from (f"Note: {text}" for text in record.notes[:most])
    if len(record.notes) > most:
        yield f"and {len(record.notes) - most} more notes (-v tells them)"


def _seconds(record: AdjustmentRecord, told: float) -> Iterator[str]:
    """The time of each part of the work, that of telling it too."""
    if record.phases:
        phases = [*((phase.name, phase.seconds) for phase in record.phases), ("summary", told)]
        total = sum(seconds for _, seconds in phases)
        parts = ", ".join(f"{name} {seconds:.2f}" for name, seconds in phases)
        yield f"Seconds: {parts}; {total:.2f} in all"


def _files(written: Sequence[str]) -> str:
    return "Written: " + (
        ", ".join(written) if written else "nothing (--out, --json, --html or --text write results)"
    )


def tested(record: AdjustmentRecord) -> str:
    """What the test of sigma0 compares with which limits, and what it finds."""
    verdict = Verdict(record)
    test = verdict.test
    if record.planned:
        return "to be tested when there are residuals"
    if test is None:
        return f"sigma0 is {verdict.headline}"
    own = units.significant(test.sigma0, 5)
    is_other = own != units.significant(record.sigma0, 5)
    known = ", the residuals of known points included" if is_other else ""
    share = 100.0 * (1.0 - test.level)
    limits = f"between {test.lower:.4g} and {test.upper:.4g} is expected"
    return f"chi-square test at {share:g} %: {own}{known}; {limits}: {verdict.headline}"


def left_out(record: AdjustmentRecord) -> Iterator[str]:
    """What the adjustment does without, if anything."""
    names = [item.what for item in record.left_out]
    if names:
        why = "because nothing determines them"
        if record.gross_errors:
            why += " (which the gross errors may cause: correct these first)"
        yield f"  LEFT OUT, {why}: {listed(names, MOST_POINTS)}"
    for item in record.unused:
        yield f"  LEFT OUT, because {item.reason}: {listed(item.observations, MOST_UNUSED)}"


def gross_errors(record: AdjustmentRecord, most: int) -> Iterator[str]:
    """What is wrong, the clearest first, and what sigma0 is without it."""
    diagnosis, found = record.diagnosis, record.gross_errors
    if diagnosis is None:
        return
    if found:
        yield f"  GROSS ERRORS are suspected ({len(found)}, the worst first):"
    for item in found[:most]:
        yield f"    {item.what}: {item.text}"
    if len(found) > most:
        yield f"    and {len(found) - most} more; the listing and the JSON file have them"
    if found and diagnosis.sigma0 is not None:
        rest = "" if diagnosis.status == "explained" else ": they do not explain all of it"
        yield f"    Without {'it' if len(found) == 1 else 'them'} sigma0 is {diagnosis.sigma0:.3g}{rest}."
    for item in diagnosis.remarks[:most]:
        yield f"  Remark: {item.what}: {item.text}. No error: it is not beyond a sigma of each."
    if diagnosis.status == "undecided" or diagnosis.reason:
        yield f"  DIAGNOSIS {diagnosis.status}: {diagnosis.reason}"


def warnings(record: AdjustmentRecord, most: int) -> Iterator[str]:
    """What the user should know of the input, one line each, at most so many of them."""
    found = record.warnings
    yield from (f"Warning: {text}" for text in found[:most])
    if len(found) > most:
        yield f"and {len(found) - most} more warnings; the listing and the JSON file have them"


def notes(record: AdjustmentRecord) -> Iterator[str]:
    """What was computed and how far it holds, one line each."""
    yield from (f"Note: {text}" for text in record.notes)


def _worst(record: AdjustmentRecord) -> Iterator[str]:
    found = record.observations
    sizes = [abs(found.numbers(name)) for name in ("standardised_residual", "normalised_residual")]
    keys = [[0.0 if size != size else size for size in column.tolist()] for column in sizes]
    active = found.truths("active").nonzero()[0].tolist()
    rows = nlargest(WORST, active, key=lambda row: (keys[0][row], keys[1][row]))
    few = structs.replace(record, observations=found.take(rows))
    yield from _lines(few, "observations", "w", WORST)
    if record.joint:
        yield ""
        yield from _lines(record, "vectors", "T / limit", WORST)


def _known(record: AdjustmentRecord) -> Iterator[str]:
    """The known coordinates that fit worst, when some are beyond what one expects of a few."""
    count = int((abs(record.constraints.numbers("normalised_residual")) > NOTABLE).sum())
    if count:
        yield from _lines(record, "known", "normalised", min(count, WORST))
