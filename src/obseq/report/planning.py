"""The summary of a plan: how it was checked, where it is weak, and what one more observation would bring."""

from collections.abc import Iterator, Sequence

from obseq.arguments import TEXTS, expecting, instance
from obseq.printable import printable
from obseq.records.plan import DrawsRecord, GainRecord, PlanRecord, WeakObservationRecord, WeakPointRecord
from obseq.report.result_file import text_of
from obseq.report.rows import Table
from obseq.report.summary import left_out, notes, warnings
from obseq.report.table import lines_of
from obseq.report.units import Units, units_of

MOST_WARNINGS = 3


@expecting(record=instance(PlanRecord), written=TEXTS)
def plan_summary(record: PlanRecord, written: Sequence[str] = ()) -> str:
    """The summary of a plan.

    Args:
        record: The plan.
        written: Names of the files where the results were written.
    """
    shown = units_of(record.adjustment)
    sections = (
        _counts(record),
        lines_of(_weakest(record.weakest_points, shown)),
        _uncontrolled(record, shown),
        _gains(record, shown),
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


def _weakest(points: Sequence[WeakPointRecord], shown: Units) -> Table:
    rows = (
        (
            item.point,
            shown.small_length.number(item.sigma),
            shown.angle.turned(item.azimuth),
            shown.angle.turned(item.elevation),
        )
        for item in points
    )
    title = (
        f"Weakest points: standard deviation ({shown.small_length.name}) along the direction in which the "
        "point is known worst (the longest semi-axis of its ellipsoid), azimuth and elevation "
        f"({shown.angle.name}) of that direction"
    )
    return Table(title, ("point", "sigma", "azimuth", "elevation"), tuple(rows))


def _uncontrolled(record: PlanRecord, shown: Units) -> Iterator[str]:
    rows = record.weakest_observations
    if not rows:
        yield "Every observation is well controlled by the others."
        return
    title = "Weakly controlled observations: smallest error that would be noticed, and what it moves (sigmas)"
    header = ("observation", "redundancy", "detectable", "effect")
    yield from lines_of(Table(title, header, tuple(_uncontrolled_cells(item, shown) for item in rows)))


def _uncontrolled_cells(item: WeakObservationRecord, shown: Units) -> tuple[str, ...]:
    detectable = "none" if item.detectable is None else shown.small(item.unit, item.detectable)
    effect = "unlimited" if item.external is None else f"{item.external:.1f}"
    return (item.observation, f"{item.redundancy:.3f}", detectable, effect)


def _gains(record: PlanRecord, shown: Units) -> Iterator[str]:
    if not record.gains:
        return
    small = shown.small_length
    before = small.text(record.gains[0].before)
    title = (
        f"What one more observation would bring (the best of {record.candidates} tried). Network: root mean "
        f"square of the standard deviations of all coordinates, {before} now. Now and then: position in "
        f"space (root of sx^2 + sy^2 + sz^2) of the point that gains most ({small.name})"
    )
    header = ("observation", "sigma", "network", "point", "now", "then")
    yield from lines_of(Table(title, header, tuple(_gain_cells(item, shown) for item in record.gains)))


def _gain_cells(item: GainRecord, shown: Units) -> tuple[str, ...]:
    return (
        f"{item.type} {item.origin} -> {item.target}",
        shown.small(item.unit, item.sigma),
        shown.small_length.number(item.after),
        item.point,
        shown.small_length.number(item.point_before),
        shown.small_length.number(item.point_after),
    )


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
