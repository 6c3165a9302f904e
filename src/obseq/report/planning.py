"""The summary of a plan: how it was checked, where it is weak, and what one more observation would bring."""

import math
from collections.abc import Iterator, Sequence

from obseq.arguments import TEXTS, expecting, instance
from obseq.printable import printable
from obseq.records.plan import DrawsRecord, PlanRecord
from obseq.report.content import numbers_of
from obseq.report.content_plan import plan_tables
from obseq.report.result_file import text_of
from obseq.report.summary import left_out, notes, warnings
from obseq.report.units import units_of
from obseq.report.writer import Writer

MOST_WARNINGS = 3
DATUM = 0.5
"""Share of the variance of a point below which sights do not limit it: most comes from the datum."""
DATUM_STEP = "Next: known points that are better, or that lie around it; more sights bring little."


@expecting(record=instance(PlanRecord), written=TEXTS)
def plan_summary(record: PlanRecord, written: Sequence[str] = ()) -> str:
    """The summary of a plan.

    Args:
        record: The plan.
        written: Names of the files where the results were written.
    """
    rows = numbers_of(record.adjustment)
    writer = Writer(list(rows), units_of(record.adjustment))
    sections = (
        _counts(record),
        *(writer.lines(table) for table in plan_tables(record, rows)),
        _limited(record),
        () if record.weakest_observations else ("Every observation is well controlled by the others.",),
        draws_told(record.draws),
        warnings(record.adjustment, MOST_WARNINGS),
        notes(record.adjustment),
        [f"written: {', '.join(written)}"] if written else [],
    )
    texts = ("\n".join(section) for section in sections)
    return printable("\n\n".join(text for text in texts if text) + "\n")


def plan_json(record: PlanRecord) -> str:
    """The text of the file of a plan: valid JSON, floats exact."""
    return text_of(record)


def _counts(record: PlanRecord) -> Iterator[str]:
    planned = record.adjustment
    yield f"{len(planned.points)} points, {len(planned.stations)} stations, planned"
    yield from left_out(planned)
    yield f"  observations {planned.n_observations:>8}"
    yield f"  constraints  {planned.n_constraints:>8}   coordinates given with a sigma"
    yield f"  unknowns     {planned.n_unknowns:>8}"
    yield f"  redundancy   {planned.redundancy:>8}"


def limited(record: PlanRecord) -> tuple[str, float, float] | None:
    """The weakest point that the datum and not the sights limits: name, precision, that of the sights alone.

    Precisions with inner constraints are those of the sights. The datum limits a point where more than half
    of its variance is not theirs; None where it does not limit the weakest one.
    """
    names = {item.point for item in record.weakest_points[:1]}
    for point in record.adjustment.points:
        if point.name in names and point.inner:
            whole = math.hypot(*(value or 0.0 for value in (point.sx, point.sy, point.sz)))
            own = math.hypot(*point.inner)
            return (point.name, whole, own) if own**2 < DATUM * whole**2 else None
    return None


def is_known(record: PlanRecord) -> bool:
    """Whether every point is known already, so that the plan determines nothing."""
    return all((point.known or "").lower() == "xyz" for point in record.adjustment.points)


def _limited(record: PlanRecord) -> Iterator[str]:
    """That all points are known, or that the known ones limit the plan."""
    found = limited(record)
    if is_known(record):
        yield "Warning: every point is known already: the plan determines nothing."
    elif found is not None:
        small = units_of(record.adjustment).small_length
        name, whole, own = found
        yield f"The datum limits the precision, not the sights: {name} {small.text(whole)} in space,"
        yield f"of the sights alone {small.text(own)}. {DATUM_STEP}"


def draws_told(draws: DrawsRecord | None) -> Iterator[str]:
    """What adjustments of drawn observations say of the prediction."""
    if draws is None:
        return
    verdict = "agree with the prediction" if draws.agrees else "DO NOT AGREE with the prediction"
    yield f"{draws.draws} adjustments of drawn observations {verdict}"
    yield f"  squared errors over predicted ones  {draws.ratio:.4f}  (1 is expected)"
    yield (
        f"  worst point {draws.worst_point}: {draws.worst_ratio:.4f}, probability among all points "
        f"{draws.p_value:.3g}"
    )
    if draws.sigma0 is not None:
        yield f"  sigma0 {draws.sigma0:.4f}  (1 is expected)"
    if draws.failed:
        yield f"  {draws.failed} did not converge and do not count"
