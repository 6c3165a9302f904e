"""Tables of how good an adjustment is: by type and station, ellipsoids, pairs, components, motions."""

from __future__ import annotations

from collections.abc import Sequence

from obseq.records.adjustment import AdjustmentRecord, RelativeRecord, StatisticsRecord
from obseq.report.tables.columns import (
    Column,
    Table,
    choice,
    column,
    element,
    ellipse_columns,
    field,
    rounded,
    table,
)
from obseq.report.tables.named import ellipse_level

Rows = dict[str, int]


def by_type(record: AdjustmentRecord, _: Rows) -> Table | None:
    """How the observations of each type fit."""
    first = choice("type", [row.name for row in record.types or ()])
    return _statistics("by-type", "By type", first, record.types or ())


def by_station(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """The same of each station."""
    first = column("from", "point", (rows.get(row.name) for row in record.setups or ()))
    return _statistics("by-station", "By station", first, record.setups or ())


def _statistics(key: str, title: str, first: Column, found: Sequence[StatisticsRecord]) -> Table | None:
    """The table of how the observations of each type or from each point fit."""
    columns = [
        first,
        column("used", "count", (row.count for row in found)),
        column("unused", "count", (row.unused for row in found)),
        field("redundancy", "number", found, "redundancy"),
        field("mean", "number", found, "mean", by_size=True, about="of the normalised residuals"),
        field("rms", "number", found, "rms", about="of the normalised residuals"),
        field("largest", "number", found, "largest", about="standardised residual"),
        field("factor", "number", found, "sigma_factor", about="1 when the sigmas are right"),
        field("from", "number", found, "lower", key="lower", about="smallest factor of right sigmas"),
        field("to", "number", found, "upper", key="upper", about="largest factor of right sigmas"),
    ]
    return table(key, title, columns, order="factor", inside=True)


def relative(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """Pairs of points that observations join."""
    found = record.relative
    if not found:
        return None
    columns = [
        column("first", "point", (rows.get(row.first) for row in found)),
        column("second", "point", (rows.get(row.second) for row in found)),
        column("distance", "length", (rounded(row.distance) for row in found)),
        field("s distance", "small_length", found, "precision"),
        column("ppm", "number", map(_parts_per_million, found)),
        field("s bearing", "small_angle", found, "bearing_precision"),
        *ellipse_columns(row.ellipse for row in found),
    ]
    about = f"Precisions {record.precision or 'as in the record'}; ellipses {ellipse_level(record)}."
    return table("relative", "Pairs", columns, about=about, order="s distance")


def _parts_per_million(item: RelativeRecord) -> float | None:
    """The precision of a distance as a share of it; None where the two points are not told apart."""
    return 1e6 * item.precision / item.distance if item.distance > item.precision else None


def components(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Factors of the variances."""
    found = record.variance_components
    if not found:
        return None
    columns = [
        choice("kind", [row.group for row in found]),
        field("variance x", "fine", found, "factor"),
        field("precision", "fine", found, "precision"),
        field("sigma x", "fine", found, "sigma_factor"),
        field("redundancy", "number", found, "redundancy"),
        choice("supported", ["yes" if row.supported else "no" for row in found]),
    ]
    about = "Factors of the given variances, which were applied."
    return table("components", "Variance components", columns, about=about, inside=True)


def undetermined(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """What the observations of a free network leave undetermined, by motion and point; the plan draws it."""
    found = record.undetermined
    if not found:
        return None
    numbered = [(f"{k + 1}: {item.text}", item) for k, item in enumerate(found)]
    moves = [move for item in found for move in item.moves]
    columns = [
        choice("motion", [text for text, item in numbered for _ in item.points]),
        column("point", "point", (rows[name] for item in found for name in item.points)),
        *(
            column(f"along {axis}", "number", (move[k] for move in moves), key=axis)
            for k, axis in enumerate("xyz")
        ),
    ]
    about = (
        "What the datum of the free network takes: how points may move together without any residual; the "
        "farthest of each motion by 1."
    )
    return table("undetermined", "Not determined", columns, about=about, inside=True)


def ellipsoids(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Error ellipsoids."""
    found = [(k, point.ellipsoid) for k, point in enumerate(record.points) if point.ellipsoid]
    parts = {name: [getattr(item, name) for _, item in found] for name in ("axes", "bearings", "elevations")}
    columns = [column("point", "point", (k for k, _ in found))]
    for k in range(3):
        columns += [
            element(f"axis {k + 1}", "small_length", parts["axes"], k),
            element(f"bearing {k + 1}", "bearing", parts["bearings"], k),
            element(f"elevation {k + 1}", "bearing", parts["elevations"], k),
        ]
    about = f"Semi-axes of the error ellipsoids, the longest first; {ellipse_level(record, 'ellipsoid')}."
    return table("ellipsoids", "Ellipsoids", columns, about=about)
