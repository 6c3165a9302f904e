"""A record without precisions that suspected errors spoil: from the given sigmas, as reports show it then."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec import structs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.records.adjustment import AdjustmentRecord, EllipseRecord, PointRecord, RelativeRecord

GIVEN = "from the given sigmas"


def spared(record: AdjustmentRecord) -> AdjustmentRecord:
    """The record; with errors suspected, its precisions do not hold the sigma0 that they spoil."""
    if not record.gross_errors or record.precision != "a posteriori" or not record.sigma0:
        return record
    by = 1.0 / record.sigma0
    return structs.replace(
        record,
        precision=GIVEN,
        points=tuple(_point(point, by) for point in record.points),
        relative=record.relative and tuple(_relative(pair, by) for pair in record.relative),
    )


def _point(point: PointRecord, by: float) -> PointRecord:
    names = ("sx", "sy", "sz", "crs_sx", "crs_sy", "crs_sz")
    return structs.replace(
        point,
        **{name: _times(getattr(point, name), by) for name in names},
        covariance=_all(point.covariance, by * by),
        inner=_all(point.inner, by),
        ellipse=point.ellipse and _ellipse(point.ellipse, by),
        ellipsoid=point.ellipsoid and structs.replace(point.ellipsoid, axes=_all(point.ellipsoid.axes, by)),
    )


def _relative(pair: RelativeRecord, by: float) -> RelativeRecord:
    return structs.replace(
        pair,
        precision=pair.precision * by,
        bearing_precision=_times(pair.bearing_precision, by),
        ellipse=_ellipse(pair.ellipse, by),
    )


def _ellipse(ellipse: EllipseRecord, by: float) -> EllipseRecord:
    return structs.replace(ellipse, semi_major=ellipse.semi_major * by, semi_minor=ellipse.semi_minor * by)


def _all(values: Sequence[float | None] | None, by: float) -> tuple[float | None, ...] | None:
    return None if values is None else tuple(_times(value, by) for value in values)


def _times(value: float | None, by: float) -> float | None:
    return None if value is None else value * by
