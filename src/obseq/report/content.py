"""What the interactive page holds: names of points, plan, tables and iterations, from the record alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from obseq.printable import printable_line
from obseq.report import units
from obseq.report.columns import (
    PLACES,
    Column,
    Table,
    all_rounded,
    choice,
    column,
    element,
    ellipse_columns,
    field,
    inside,
    rounded,
    small,
    table,
)
from obseq.report.plan import plan
from obseq.report.quality import ellipse_level, parts_per_million
from obseq.report.rows import short_names, unit_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.records.adjustment import AdjustmentRecord, StatisticsRecord

Rows = dict[str, int]
"""The number of each name of a point: those of the record first, in its order."""


def content(record: AdjustmentRecord) -> Table:
    """Names of points, plan, tables and iterations of an adjustment.

    A table has columns; a column a title, a quantity (how its numbers are shown), and values.
    """
    rows = _numbers(record)
    tables = (made(record, rows) for made in TABLES)
    return {
        "units": {"length": record.units.length, "angle": record.units.angle},
        "names": [printable_line(name) for name in rows],
        "plan": plan(record, rows) if record.points else None,
        "tables": [table for table in tables if table],
        "iterations": [{"sigma0": row.sigma0, "max_step": row.max_step} for row in record.iterations],
    }


def _numbers(record: AdjustmentRecord) -> Rows:
    rows = {point.name: k for k, point in enumerate(record.points)}
    lost = [item.name for item in record.left_out if item.place]
    quoted = (name for row in record.observations for name in (row.origin, row.target, row.backsight))
    for name in (*lost, *filter(None, quoted)):
        rows.setdefault(name, len(rows))
    return rows


def _observations(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """All observations, the worst first."""
    found = record.observations
    if not found:
        return None
    columns = [*_observed(record, rows), *_judged(record), *_effects(record), *_places(record)]
    made = table("observations", "Observations", "Observations", columns, about=_of_observations(record))
    keys = [item.get("key") for item in made["columns"]]
    judged = "standardised" if record.reliability else "normalised"
    return made | {
        "angular": [int(unit_of(row) == "rad") for row in found],
        "unused": [int(not row.active) for row in found],
        "sort": [keys.index(judged), -1] if judged in keys else None,
    }


def _observed(record: AdjustmentRecord, rows: Rows) -> list[Column]:
    found = record.observations
    places = [PLACES[unit_of(row)] for row in found]
    return [
        choice("type", [row.type for row in found], key="type"),
        column("from", "point", (rows[row.origin] for row in found), key="from"),
        column("to", "point", (rows[row.target] for row in found), key="to"),
        column("backsight", "point", (rows.get(row.backsight or "") for row in found)),
        column("observed", "observed", all_rounded([row.value for row in found], places)),
        column("adjusted", "observed", all_rounded([row.adjusted for row in found], places)),
        field("sigma", "small", found, "sigma"),
        field("residual", "small", found, "residual", by_size=True),
    ]


def _judged(record: AdjustmentRecord) -> list[Column]:
    """Normalised residuals, and reliability where the record has it."""
    found, level = record.observations, record.reliability
    normalised = {"key": "normalised", "by_size": True, "about": "residual / sigma"}
    if level is None:
        return [field("normalised", "number", found, "normalised_residual", limit=4.0, **normalised)]
    standardised = {
        "key": "standardised",
        "by_size": True,
        "limit": level.critical,
        "about": "residual / its own a priori standard deviation",
    }
    tau = "residual / its own a posteriori standard deviation"
    controlled = "how far the others control it: 0 not at all, 1 completely"
    effect = "most that the detectable bias moves any coordinate, in its standard deviations"
    blunder = "estimate of its error, if it were the only one"
    return [
        field("normalised", "number", found, "normalised_residual", **normalised),
        field("standardised", "number", found, "standardised_residual", **standardised),
        field("tau", "number", found, "tau", by_size=True, about=tau),
        field("redundancy", "number", found, "redundancy", key="redundancy", about=controlled),
        field("detectable", "small", found, "detectable", about="smallest bias that its test finds"),
        field("effect", "number", found, "external", about=effect),
        field("off by", "small", found, "blunder", by_size=True, about=blunder),
    ]


def _effects(record: AdjustmentRecord) -> list[Column]:
    """Which point the detectable bias of each observation moves most, and by how much."""
    found = [row.effect for row in record.observations]
    names = [None if item is None else printable_line(item.point) for item in found]
    about = "the point that the detectable bias moves most"
    moved = [inside(f"by d{axis}", "small_length", found, axis, by_size=True) for axis in "xyz"]
    return [column("moves", "text", names, about=about), *moved]


def _places(record: AdjustmentRecord) -> list[Column]:
    found = record.observations
    names = short_names({row.file for row in found})
    return [
        choice("file", [names[row.file] for row in found]),
        column("line", "count", (row.line for row in found)),
    ]


def _of_observations(record: AdjustmentRecord) -> str:
    text = "Residuals are computed minus observed; struck out: not used."
    if record.reliability is None:
        return text
    found = record.reliability
    return (
        f"{text} Standardised residuals with the a priori sigmas, limit {found.critical:.2f} at "
        f"{100 * found.level:g} %; detectable with a power of {100 * found.power:g} %."
    )


def _points(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Coordinates in the computation frame, with precisions and what was known."""
    found = record.points
    if not found:
        return None
    inner, moved = [point.inner for point in found], [point.moved for point in found]
    given = {"by_size": True, "about": "adjusted minus given"}
    columns = [
        column("point", "point", range(len(found))),
        _classes(record),
        *(column(axis, "length", all_rounded([getattr(point, axis) for point in found])) for axis in "xyz"),
        *(field(f"s{axis}", "small_length", found, f"s{axis}") for axis in "xyz"),
        *(element(f"inner s{axis}", "small_length", inner, k) for k, axis in enumerate("xyz")),
        *(element(f"moved {axis}", "small_length", moved, k, **given) for k, axis in enumerate("xyz")),
        *ellipse_columns(point.ellipse for point in found),
    ]
    about = f"Precisions {record.precision or 'as in the record'}; ellipses {ellipse_level(record)}."
    return table("points", "Points", f"Points in the computation frame {record.frame}", columns, about=about)


def _classes(record: AdjustmentRecord) -> Column:
    """What each point is: known, station, free."""
    stations = {row.origin for row in record.observations if row.active}
    texts = []
    for point in record.points:
        known = f"known {point.known}" if point.known else "free"
        texts.append(f"{known}, station" if point.name in stations else known)
    about = "known coordinates: small letters with a sigma, capitals held"
    return choice("class", texts, about=about)


def _crs(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Coordinates in the system of the points, where it is another."""
    found = record.points
    if record.points_crs == record.frame or not found:
        return None
    columns = [
        column("point", "point", range(len(found))),
        *(_given_axis(record, axis) for axis in "xyz"),
        *(field(f"s{axis}", "small_length", found, f"crs_s{axis}") for axis in "xyz"),
    ]
    about = f"Precisions {record.precision or ''}, along the axes of the system or along east, north and up."
    return table("coordinates", "Coordinates", f"Points in {record.points_crs}", columns, about=about)


def _given_axis(record: AdjustmentRecord, axis: str) -> Column:
    unit = (record.points_crs_height_unit if axis == "z" else record.points_crs_unit) or "m"
    places = units.DECIMALS.get(unit, 4)
    values = all_rounded([getattr(point, f"crs_{axis}") for point in record.points], places + 1)
    more = {} if unit == "m" else {"decimals": places, "unit": unit}
    return column(axis, "length", values, **more)


def _ellipsoids(record: AdjustmentRecord, _: Rows) -> Table | None:
    found = [(k, point.ellipsoid) for k, point in enumerate(record.points) if point.ellipsoid]
    if not found:
        return None
    parts = {name: [getattr(item, name) for _, item in found] for name in ("axes", "bearings", "elevations")}
    columns = [column("point", "point", (k for k, _ in found))]
    for k in range(3):
        columns += [
            element(f"axis {k + 1}", "small_length", parts["axes"], k),
            element(f"bearing {k + 1}", "bearing", parts["bearings"], k),
            element(f"elevation {k + 1}", "bearing", parts["elevations"], k),
        ]
    about = f"Semi-axes, the longest first; {ellipse_level(record, 'ellipsoid')}."
    return table("ellipsoids", "Ellipsoids", "Error ellipsoids", columns, about=about)


def _known(record: AdjustmentRecord, rows: Rows) -> Table | None:
    found = record.constraints
    if not found:
        return None
    names = short_names({row.file for row in found})
    unit = {"unit": record.points_crs_unit} if record.points_crs_unit not in (None, "m") else {}
    columns = [
        column("point", "point", (rows.get(row.point) for row in found)),
        choice("coordinate", [row.coordinate for row in found]),
        column("given", "length", (rounded(row.value, 9) for row in found), **unit),
        field("sigma", "small_length", found, "sigma"),
        field("residual", "small_length", found, "residual", by_size=True),
        field("normalised", "number", found, "normalised_residual", by_size=True, limit=4.0),
        field("standardised", "number", found, "standardised_residual", by_size=True),
        field("redundancy", "number", found, "redundancy"),
        choice("file", [names[row.file] for row in found]),
        column("line", "count", (row.line for row in found)),
    ]
    about = "Residuals are adjusted minus given."
    return table("known", "Known points", "Known coordinates", columns, sort=[5, -1], about=about)


def _vectors(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Vectors and positions, each tested as one observation."""
    found = record.joint
    if not found:
        return None
    names = short_names({row.file for row in found})
    off = (small(math.hypot(*row.blunder)) for row in found)
    columns = [
        column("vector", "text", (printable_line(row.what) for row in found)),
        field("T", "number", found, "statistic"),
        column("degrees", "count", (row.degrees for row in found)),
        field("limit", "number", found, "critical"),
        column("T / limit", "number", (small(row.statistic / row.critical) for row in found), limit=1.0),
        column("off by", "small_length", off, about="estimate of its error, if it were the only one"),
        field("up", "small_length", found, "rise", about="the same, if its height alone were wrong"),
        field("w of that", "number", found, "rise_test", by_size=True),
        choice("file", [names[row.file] for row in found]),
        column("line", "count", (row.line for row in found)),
    ]
    about = "T is the test of all components together; its limit finds errors as large as single tests do."
    title = "Vectors and positions, each tested as one observation"
    return table("vectors", "Vectors", title, columns, sort=[4, -1], about=about)


def _stations(record: AdjustmentRecord, rows: Rows) -> Table | None:
    found = record.stations
    if not found:
        return None
    zeros = (None if row.g0 is None else rounded(row.g0 % math.tau, PLACES["rad"]) for row in found)
    columns = [
        column("station", "point", (rows.get(row.origin) for row in found)),
        choice("orientation", [row.orientation for row in found]),
        column("zero of the circle", "angle", zeros),
    ]
    return table("stations", "Stations", "Stations and the azimuth of the zero of their circles", columns)


def _by_type(record: AdjustmentRecord, _: Rows) -> Table | None:
    first = choice("type", [row.name for row in record.types or ()])
    return _statistics("type", first, record.types or ())


def _by_station(record: AdjustmentRecord, rows: Rows) -> Table | None:
    first = column("from", "point", (rows.get(row.name) for row in record.setups or ()))
    return _statistics("station", first, record.setups or ())


def _statistics(kind: str, first: Column, found: Sequence[StatisticsRecord]) -> Table | None:
    """The table of how the observations of each type or from each point fit."""
    if not found:
        return None
    columns = [
        first,
        column("observations", "count", (row.count for row in found)),
        column("not used", "count", (row.unused for row in found)),
        field("redundancy", "number", found, "redundancy"),
        field("mean", "number", found, "mean", by_size=True),
        field("rms", "number", found, "rms"),
        field("largest", "number", found, "largest"),
        field("sigma x", "number", found, "sigma_factor"),
    ]
    about = (
        "Mean and root mean square of normalised residuals; the largest standardised one; what would "
        "multiply the sigmas (root of the weighted squares over the redundancy)."
    )
    return table(f"by-{kind}", f"By {kind}", f"Statistics by {kind}", columns, about=about)


def _relative(record: AdjustmentRecord, rows: Rows) -> Table | None:
    found = record.relative
    if not found:
        return None
    columns = [
        column("first", "point", (rows.get(row.first) for row in found)),
        column("second", "point", (rows.get(row.second) for row in found)),
        column("distance", "length", (rounded(row.distance) for row in found)),
        field("s distance", "small_length", found, "precision"),
        column("ppm", "number", (small(parts_per_million(row)) for row in found)),
        field("s bearing", "small_angle", found, "bearing_precision"),
        *ellipse_columns(row.ellipse for row in found),
    ]
    about = f"Precisions {record.precision or 'as in the record'}; ellipses {ellipse_level(record)}."
    return table("relative", "Relative", "Points relative to each other", columns, about=about)


def _components(record: AdjustmentRecord, _: Rows) -> Table | None:
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
    title = "Variance components: factors of the given variances, which were applied"
    return table("components", "Components", title, columns)


def _undetermined(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """What the observations of a free network leave undetermined, by motion and point; the plan draws it."""
    found = record.undetermined
    if not found:
        return None
    numbered = [(f"{k + 1}: {item.text}", item) for k, item in enumerate(found)]
    moves = [move for item in found for move in item.moves]
    columns = [
        choice("motion", [text for text, item in numbered for _ in item.points], key="motion"),
        column("point", "point", (rows[name] for item in found for name in item.points), key="point"),
        *(
            column(f"along {axis}", "number", (move[k] for move in moves), key=axis)
            for k, axis in enumerate("xyz")
        ),
    ]
    about = "How points may move together without any residual; the farthest of each motion by 1."
    title = "Not determined by the observations: what the datum of the free network takes"
    return table("undetermined", "Not determined", title, columns, about=about)


TABLES: tuple[Callable[[AdjustmentRecord, Rows], Table | None], ...] = (
    _observations,
    _vectors,
    _points,
    _crs,
    _known,
    _stations,
    _by_type,
    _by_station,
    _ellipsoids,
    _relative,
    _components,
    _undetermined,
)
