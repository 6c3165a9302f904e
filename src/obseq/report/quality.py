"""What reports say of the quality of an adjustment, in sentences."""

from collections.abc import Iterator

from obseq.records.adjustment import (
    AdjustmentRecord,
    JointTestRecord,
    ObservationRecord,
    SnoopingRecord,
)
from obseq.records.quality import ReliabilityRecord
from obseq.report import units

MOST_SUSPECTS = 8


def suspects(record: AdjustmentRecord) -> list[ObservationRecord]:
    """The observations whose test of the standardised residual fails, the worst first."""
    if record.reliability is None:
        return []
    sizes = abs(record.observations.numbers("standardised_residual"))
    beyond = (sizes > record.reliability.critical).nonzero()[0].tolist()
    return list(record.observations.take(sorted(beyond, key=lambda row: -sizes[row])))


def single_tests(record: AdjustmentRecord) -> Iterator[str]:
    """What the tests of single observations found, if reliability was asked for."""
    found = record.reliability
    if found is None:
        yield "single observations are not tested without reliability: a gross error among them goes unsaid"
        return
    if record.planned:
        yield from _uncontrolled(found)
        return
    known = int((abs(record.constraints.numbers("standardised_residual")) > found.critical).sum())
    count = len(suspects(record)) + known
    verdict = f"exceeded by {count} of {found.tests}" if count else f"exceeded by none of {found.tests}"
    if known:
        verdict += f", {known} of these {'a known coordinate' if known == 1 else 'known coordinates'}"
    share, limit = f"{100.0 * found.level:g} %", f"{found.critical:.2f}"
    yield f"test of each standardised residual at {share}: limit {limit} (a priori sigmas), {verdict}"
    yield from _joint_tests(record)
    yield from _uncontrolled(found)


def _uncontrolled(found: ReliabilityRecord) -> Iterator[str]:
    """How many equations nothing checks."""
    if found.uncontrolled:
        subject = "equation is" if found.uncontrolled == 1 else "equations are"
        yield f"{found.uncontrolled} {subject} controlled by no other: any blunder there goes unseen"


def _joint_tests(record: AdjustmentRecord) -> Iterator[str]:
    """What the tests of vectors found, by the number of their degrees of freedom."""
    for degrees in sorted({item.degrees for item in record.joint}, reverse=True):
        mine = [item for item in record.joint if item.degrees == degrees]
        beyond = [item for item in worst_vectors(record) if item.is_beyond and item.degrees == degrees]
        verdict = f"exceeded by {len(beyond) or 'none'} of {len(mine)}"
        if beyond:
            verdict += f", the worst {beyond[0].what}: T {beyond[0].statistic:.1f}"
        yield (
            f"test of each vector or position as a whole, {degrees} degrees of freedom: limit of T "
            f"{mine[0].critical:.2f} (at {100.0 * mine[0].level:.2g} %), {verdict}"
        )


def worst_vectors(record: AdjustmentRecord) -> list[JointTestRecord]:
    """The tests of vectors and positions, the one farthest beyond its limit first."""
    return sorted(record.joint, key=lambda item: -item.statistic / item.critical)


def snooping_lines(record: AdjustmentRecord) -> Iterator[str]:
    """What data snooping left out, why it ended, and what that changed."""
    snooping = record.snooping
    if snooping is None:
        return
    share = f"{100.0 * snooping.level:g} %"
    count = len(snooping.rejections)
    yield (
        f"Data snooping with {snooping.statistic} at an overall level of {share}: {count} left out; "
        f"{snooping.end}"
    )
    yield from _rejections(record, snooping)
    if snooping.suspects:
        shown = ", ".join(snooping.suspects[:MOST_SUSPECTS])
        more = len(snooping.suspects) - MOST_SUSPECTS
        yield f"  suspected: {shown}{f' and {more} more' if more > 0 else ''}"
    if snooping.moved is not None:
        size = units.units_of(record).small_length.text(snooping.moved)
        yield f"  this moved {snooping.most_moved} most, by {size}"


def _rejections(record: AdjustmentRecord, snooping: SnoopingRecord) -> Iterator[str]:
    shown = units.units_of(record)
    for item in snooping.rejections:
        unit = record.observations[item.row].unit or "m"
        size, least = shown.small(unit, item.blunder), shown.small(unit, item.detectable)
        others = ", left out with its whole vector" if item.companions else ""
        statistic = f"{snooping.statistic} {item.statistic:.2f}"
        if item.degrees > 1:
            statistic = f"T of its vector {item.statistic:.2f} (limit {item.critical or 0.0:.2f})"
        yield (f"  {item.observation}: {statistic}, off by about {size} (detectable from {least}){others}")
