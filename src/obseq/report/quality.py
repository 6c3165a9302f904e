"""What reports say of the quality of an adjustment: sentences, and tables as text."""

import math
from collections.abc import Iterator, Sequence

from obseq.records.adjustment import (
    AdjustmentRecord,
    JointTestRecord,
    ObservationRecord,
    RelativeRecord,
    SnoopingRecord,
)
from obseq.records.quality import ReliabilityRecord
from obseq.report import units
from obseq.report.rows import Table, brief_names

MOST_SUSPECTS = 8


def suspects(record: AdjustmentRecord) -> list[ObservationRecord]:
    """The observations whose test of the standardised residual fails, the worst first."""
    if record.reliability is None:
        return []
    limit = record.reliability.critical
    beyond = [row for row in record.observations if abs(row.standardised_residual or 0.0) > limit]
    return sorted(beyond, key=lambda row: -abs(row.standardised_residual or 0.0))


def single_tests(record: AdjustmentRecord) -> Iterator[str]:
    """What the tests of single observations found, if reliability was asked for."""
    found = record.reliability
    if found is None:
        yield "single observations are not tested without reliability: a gross error among them goes unsaid"
        return
    if record.planned:
        yield from _uncontrolled(found)
        return
    known = sum(abs(row.standardised_residual or 0.0) > found.critical for row in record.constraints)
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


def vector_table(record: AdjustmentRecord, title: str, tests: Sequence[JointTestRecord]) -> Table:
    """Tests of vectors and positions, with the estimates of their errors."""
    small = units.units_of(record).small_length
    names = brief_names({item.file for item in tests})
    rows = (
        (
            item.what,
            f"{names[item.file]}:{item.line}" if item.file else units.ABSENT,
            units.fixed(item.statistic, 2),
            str(item.degrees),
            units.fixed(item.critical, 2),
            small.number(math.hypot(*item.blunder)),
            ", ".join(small.number(part) for part in item.blunder),
            small.number(item.rise),
            units.fixed(item.rise_test, 2),
        )
        for item in tests
    )
    header = (
        "vector",
        "file",
        "T",
        "degrees",
        "limit",
        f"off by ({small.name})",
        "its components",
        "up alone",
        "w",
    )
    return Table(title, header, tuple(rows), 2)


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


def quality_tables(record: AdjustmentRecord) -> Iterator[Table]:
    """The tables of what was asked for: variance components, ellipses, relative precisions."""
    if record.variance_components is not None:
        yield _component_table(record)
    if any(point.ellipse for point in record.points):
        yield _ellipse_table(record)
    if any(point.ellipsoid for point in record.points):
        yield _ellipsoid_table(record)
    if record.relative is not None:
        yield _relative_table(record)


def _component_table(record: AdjustmentRecord) -> Table:
    rows = (
        (
            item.group,
            units.fixed(item.factor, 4),
            units.fixed(item.precision, 4),
            units.fixed(item.sigma_factor, 4),
            units.fixed(item.redundancy, 2),
            "" if item.supported else "not supported by the observations",
        )
        for item in record.variance_components or ()
    )
    header = ("kind", "variance x", "precision", "sigma x", "redundancy", "")
    return Table(
        "Variance components: factors of the given variances, which were applied", header, tuple(rows)
    )


def ellipse_level(record: AdjustmentRecord, shape: str = "ellipse") -> str:
    """How the ellipses, or ellipsoids, are to be read."""
    standard = "39 % (standard)" if shape == "ellipse" else "20 % (standard)"
    level = standard if record.ellipse_level is None else f"{100.0 * record.ellipse_level:g} %"
    return f"{level}, {record.precision}" if record.precision else level


def _ellipse_table(record: AdjustmentRecord) -> Table:
    shown = units.units_of(record)
    rows = (
        (
            point.name,
            shown.small_length.number(point.ellipse.semi_major),
            shown.small_length.number(point.ellipse.semi_minor),
            shown.bearing(point.ellipse.bearing),
        )
        for point in record.points
        if point.ellipse
    )
    names = f"semi-axes ({shown.small_length.name}), bearing of the major one ({shown.bearing_name})"
    title = f"Error ellipses, {ellipse_level(record)}: {names}"
    return Table(title, ("point", "major", "minor", "bearing"), tuple(rows))


def _ellipsoid_table(record: AdjustmentRecord) -> Table:
    shown, rows = units.units_of(record), []
    for point in record.points:
        if point.ellipsoid:
            parts = zip(
                point.ellipsoid.axes, point.ellipsoid.bearings, point.ellipsoid.elevations, strict=True
            )
            cells = (
                (shown.small_length.number(axis), shown.bearing(turn), shown.bearing(rise))
                for axis, turn, rise in parts
            )
            rows.append((point.name, *(text for cell in cells for text in cell)))
    header = ("point", *(f"{name} {k}" for k in (1, 2, 3) for name in ("axis", "bearing", "elevation")))
    names = f"semi-axes ({shown.small_length.name}), their directions ({shown.bearing_name})"
    title = f"Error ellipsoids, {ellipse_level(record, 'ellipsoid')}: {names}"
    return Table(title, header, tuple(rows))


def _relative_table(record: AdjustmentRecord) -> Table:
    shown = units.units_of(record)
    small, turn = shown.small_length, shown.small_angle
    rows = (
        (
            item.first,
            item.second,
            shown.length.number(item.distance),
            small.number(item.precision),
            units.fixed(parts_per_million(item), 1),
            turn.number(item.bearing_precision),
            small.number(item.ellipse.semi_major),
            small.number(item.ellipse.semi_minor),
            shown.bearing(item.ellipse.bearing),
        )
        for item in record.relative or ()
    )
    names = f"s ({small.name})", "ppm", f"s ({turn.name})"
    header = ("first", "second", f"distance ({shown.length.name})", *names, "major", "minor", "bearing")
    of_ellipses = f"{ellipse_level(record)} ({small.name}, {shown.bearing_name})"
    title = f"Points relative to each other; ellipses {of_ellipses}"
    return Table(title, header, tuple(rows), 2)


def parts_per_million(item: RelativeRecord) -> float | None:
    """The precision of a distance as a share of it; None where the two points are not told apart."""
    return 1e6 * item.precision / item.distance if item.distance > item.precision else None
