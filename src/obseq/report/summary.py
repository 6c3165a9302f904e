"""The one-screen summary: whether it worked, how well it fits, where it does not, and the coordinates."""

import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence

from obseq.arguments import TEXTS, expecting, instance
from obseq.printable import listed, printable
from obseq.records.adjustment import AdjustmentRecord, OperationRecord, PointRecord
from obseq.report import rows, units
from obseq.report.quality import single_tests, snooping_lines, vector_table, worst_vectors
from obseq.report.table import lines_of
from obseq.report.verdict import Verdict, worst_constraints_first, worst_first, worst_title

WIDTH = 100
MOST_POINTS = 8
MOST_ERRORS = 5
MOST_FILES = 12
MOST_ITERATIONS = 9
MOST_WARNINGS = 3
MOST_UNUSED = 3
WORST = 5
NOTABLE = 2.0
"""Normalised residual beyond which the summary shows a known coordinate."""


@expecting(record=instance(AdjustmentRecord), written=TEXTS)
def summary(record: AdjustmentRecord, written: Sequence[str] = ()) -> str:
    """The summary of an adjustment, at most a screen long whatever the size of the network.

    Args:
        record: The adjustment.
        written: Names of the files where the results were written.
    """
    sections = (
        _counts(record),
        _fit(record),
        _worst(record),
        _known(record),
        _coordinates(record),
        warnings(record, MOST_WARNINGS),
        notes(record),
        _end(record, written),
    )
    texts = ("\n".join(section) for section in sections)
    return printable("\n\n".join(text for text in texts if text) + "\n")


def how_it_ended(record: AdjustmentRecord) -> str:
    """Whether the iterations converged, and how many there were."""
    if record.planned:
        return "planned, not measured"
    count = len(record.iterations)
    plural = "" if count == 1 else "s"
    if record.converged:
        return f"converged after {count} iteration{plural}"
    return f"NOT CONVERGED after {count} iteration{plural}: do not use these results"


def kinds(record: AdjustmentRecord) -> str:
    """How many active observations of each type, in words."""
    count = Counter(row.type for row in record.observations if row.active)
    unused = sum(not row.active for row in record.observations)
    text = ", ".join(f"{count[kind]} {kind}" for kind in sorted(count))
    return f"{text}; {unused} not used" if unused else text


def run_line(record: AdjustmentRecord) -> str:
    """Which run made the record, and with what."""
    if record.run is None:
        return "not in the record"
    versions = ", ".join(f"{name} {version}" for name, version in record.run.versions.items())
    return f"{record.run.identifier}, {record.run.created}; {versions}"


def basis(record: AdjustmentRecord) -> Iterator[tuple[str, str]]:
    """What it was made from, in words: files, versions, systems, refraction, operations, precisions."""
    names = record.files or tuple(dict.fromkeys(row.file for row in record.observations))
    yield "files", listed(names, MOST_FILES)
    yield "run", run_line(record)
    yield "frame", record.frame
    if record.points_crs != record.frame:
        yield "points in", record.points_crs
    if record.refraction is not None:
        yield "refraction", f"coefficient {record.refraction:g}"
    yield from (("operation", _operation(item)) for item in record.operations or ())
    yield "precisions", record.precision or "not said"
    yield "units", units.units_of(record).words


def _operation(item: OperationRecord) -> str:
    accuracy = "accuracy not announced" if item.accuracy is None else f"accuracy {item.accuracy:g} m"
    return f"{item.system} to WGS 84 by PROJ: {item.description} ({accuracy})"


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


def _counts(record: AdjustmentRecord) -> Iterator[str]:
    yield f"{len(record.points)} points, {len(record.stations)} stations: {how_it_ended(record)}"
    yield from gross_errors(record, MOST_ERRORS)
    yield from left_out(record)
    yield f"  observations {record.n_observations:>8}   {kinds(record)}"
    yield f"  constraints  {record.n_constraints:>8}   coordinates given with a sigma"
    yield f"  unknowns     {record.n_unknowns:>8}"
    yield f"  redundancy   {record.redundancy:>8}"


def _fit(record: AdjustmentRecord) -> Iterator[str]:
    values = [units.significant(row.sigma0) for row in record.iterations]
    if len(values) > MOST_ITERATIONS:
        half = MOST_ITERATIONS // 2
        values = [*values[:half], "...", *values[-half:]]
    verdict = Verdict(record)
    yield f"  sigma0 at the start of each iteration  {'  '.join(values)}"
    yield f"  sigma0 of the solution                 {units.significant(record.sigma0)}"
    yield f"  {tested(record)}"
    yield from textwrap.wrap(verdict.explanation, WIDTH, initial_indent="  ", subsequent_indent="  ")
    yield from (f"  {line}" for line in single_tests(record))
    yield from snooping_lines(record)


def _worst(record: AdjustmentRecord) -> Iterator[str]:
    worst = worst_first(record)[:WORST]
    yield from lines_of(rows.observation_table(record, f"Observations by {worst_title(record)}", worst))
    if record.joint:
        title = "Vectors and positions by their test T, with the estimate of their errors"
        yield ""
        yield from lines_of(vector_table(record, title, worst_vectors(record)[:WORST]))


def _known(record: AdjustmentRecord) -> Iterator[str]:
    """The known coordinates that fit worst, when some are beyond what one expects of a few."""
    worst = [row for row in worst_constraints_first(record) if abs(row.normalised_residual) > NOTABLE]
    if worst:
        yield from lines_of(rows.constraint_table(record, "Known coordinates that fit worst", worst[:WORST]))


def _coordinates(record: AdjustmentRecord) -> Iterator[str]:
    shown = _points_shown(record.points)
    hidden = len(record.points) - len(shown)
    yield from lines_of(rows.frame_table(record, shown))
    if record.points_crs != record.frame:
        yield ""
        yield from lines_of(rows.crs_table(record, shown))
    if hidden:
        yield f"  and {hidden} more points, all with better precisions; the files have them"


def _points_shown(points: Sequence[PointRecord]) -> Sequence[PointRecord]:
    """All points of a small network; of a large one those known worst."""
    if len(points) <= MOST_POINTS:
        return points
    return sorted(points, key=_largest_precision, reverse=True)[:MOST_POINTS]


def _largest_precision(point: PointRecord) -> float:
    return max(point.sx or 0.0, point.sy or 0.0, point.sz or 0.0)


def _end(record: AdjustmentRecord, written: Sequence[str]) -> Iterator[str]:
    phases = record.phases
    if phases:
        total = sum(phase.seconds for phase in phases)
        parts = ", ".join(f"{phase.name} {phase.seconds:.2f}" for phase in phases)
        yield f"Seconds: {parts}; {total:.2f} in all"
    yield "Written: " + (
        ", ".join(written) if written else "nothing (--out, --json, --html or --text write results)"
    )
