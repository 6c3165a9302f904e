"""The tables of the page of an adjustment, and the names of its points: from the record alone."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence

from obseq.printable import printable_line
from obseq.records.adjustment import AdjustmentRecord, ObservationRecord
from obseq.report.tables import content_quality, units
from obseq.report.tables.columns import (
    PLACES,
    Column,
    Table,
    all_rounded,
    choice,
    column,
    elements,
    ellipse_columns,
    field,
    filled,
    inside,
    rounded,
    table,
)
from obseq.report.tables.named import ellipse_level, unit_of, where

Rows = dict[str, int]
"""The number of each name of a point: those of the record first, in its order."""


def tables(record: AdjustmentRecord, rows: Rows, names: Collection[str] = ()) -> list[Table]:
    """The tables of an adjustment, or those of some names; the quantity of a column says how it is shown."""
    return filled(of(record, rows) for name, of in TABLES.items() if not names or name in names)


def numbers_of(record: AdjustmentRecord) -> Rows:
    """The number of each name of a point: those of the record first, in its order."""
    rows = {name: k for k, name in enumerate(record.points.values("name"))}
    quoted = [item.name for item in record.left_out if item.place]
    for end in ("from", "to", "backsight"):
        quoted += record.observations.distinct(end)
    for name in (*quoted, *record.stations.distinct("origin"), *(item.name for item in record.setups or ())):
        rows.setdefault(name, len(rows))
    return rows


def _observations(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """All observations; those of a plan have only what is intended and its reliability."""
    found = record.observations
    if not found:
        return None
    columns = [*_observed(record, rows), *_judged(record), *_effects(record)]
    limit = record.reliability and record.reliability.critical
    chips = [] if limit is None or record.planned else [[f"|w| > {limit:.2f}", f"|w|>{limit:.2f}"]]
    return table(
        "observations",
        "Observations",
        columns,
        about=_of_observations(record),
        angular=[int(unit_of(row) == "rad") for row in found],
        unused=[int(not row.active) for row in found],
        order="effect" if record.planned else "w",
        hint=f"{printable_line(found[0].origin)} {found[0].type} |w|>3",
        chips=chips if limit is None else [*chips, ["weakly checked", "redundancy<0.1"]],
        rows="observation",
    )


def _observed(record: AdjustmentRecord, rows: Rows) -> list[Column]:
    found = record.observations
    places = [PLACES[unit_of(row)] for row in found]
    columns = [
        choice("type", [row.type for row in found]),
        column("from", "point", (rows[row.origin] for row in found)),
        column("to", "point", (rows[row.target] for row in found)),
        column("backsight", "point", (rows.get(row.backsight or "") for row in found)),
        *where(found),
        *_uses(found),
        column(
            "intended" if record.planned else "observed",
            "observed",
            all_rounded([row.value for row in found], places),
        ),
        field("sigma", "small", found, "sigma", paper=record.planned),
    ]
    if not record.planned:
        columns += [
            column("adjusted", "observed", all_rounded([row.adjusted for row in found], places), paper=False),
            field("residual", "small", found, "residual", by_size=True, about="computed minus observed"),
        ]
    return columns


def _uses(found: Sequence[ObservationRecord]) -> Iterator[Column]:
    """Whether each takes part, where some do not."""
    if not all(row.active for row in found):
        words = ["yes" if row.active else "rejected" if row.rejected else "not used" for row in found]
        yield choice("used", words, about="rejected: left out by data snooping")


def _judged(record: AdjustmentRecord) -> list[Column]:
    """Normalised residuals, and reliability where the record has it."""
    found, level = record.observations, record.reliability
    if level is None:
        about = "residual / sigma"
        return [
            field("w", "number", found, "normalised_residual", by_size=True, limit=4.0, about=about, bar="w")
        ]
    return [*([] if record.planned else _tests(found, level.critical)), *_reliability(record)]


def _tests(found: Sequence[ObservationRecord], limit: float) -> list[Column]:
    """The tests of single observations."""
    own = "residual / its own a priori standard deviation"
    estimated = "residual / its own a posteriori standard deviation"
    error = "estimate of its error, if it were the only one"
    sized = {"by_size": True, "rare": True}
    return [
        field("w", "number", found, "standardised_residual", by_size=True, limit=limit, about=own, bar="w"),
        field("normalised", "number", found, "normalised_residual", about="residual / sigma", **sized),
        field("tau", "number", found, "tau", about=estimated, **sized),
        field("error", "small", found, "blunder", about=error, **sized),
    ]


def _reliability(record: AdjustmentRecord) -> list[Column]:
    """How far others check each observation, and what an error would do."""
    found, paper = record.observations, record.planned
    share = "share of an error that shows in its residual"
    least = "smallest error that its test finds"
    most = "most that such an error moves a coordinate, in its standard deviations"
    return [
        field("redundancy", "number", found, "redundancy", about=share, bar="redundancy"),
        field("detectable", "small", found, "detectable", about=least, paper=paper),
        field("effect", "number", found, "external", about=most, paper=paper),
    ]


def _effects(record: AdjustmentRecord) -> list[Column]:
    """Which point the detectable bias of each observation moves most, and by how much."""
    found = [row.effect for row in record.observations]
    names = [None if item is None else printable_line(item.point) for item in found]
    about = "the point that an error of the detectable size moves most"
    moved = [inside(f"by d{axis}", "small_length", found, axis, by_size=True, rare=True) for axis in "xyz"]
    return [column("moves", "text", names, about=about, rare=True), *moved]


def _of_observations(record: AdjustmentRecord) -> str:
    found = record.reliability
    if record.planned:
        return "Nothing is measured yet: what the tests of each would find, and what they would miss."
    text = "Residuals are computed minus observed."
    if found is None:
        return f"{text} w is the residual over its sigma."
    return (
        f"{text} w is the residual over its own standard deviation, limit {found.critical:.2f} at "
        f"{100 * found.level:g} %; detectable with a power of {100 * found.power:g} %."
    )


def _points(record: AdjustmentRecord, rows: Rows) -> Table | None:
    """Coordinates in the system of the points, those of the computation frame beside them; precisions."""
    found = record.points
    if not found:
        return None
    is_other = record.points_crs != record.frame
    columns = [
        column("point", "point", range(len(found))),
        _classes(record),
        *_coordinates(record, is_other),
        *ellipse_columns(point.ellipse for point in found),
        *_counted(record),
        *_moves(record),
    ]
    where = record.points_crs if is_other else f"the computation frame {record.frame}"
    precisions = f"precisions {record.precision or 'as in the record'}"
    about = f"Coordinates in {where}; {precisions}; ellipses {ellipse_level(record)}."
    return table(
        "points",
        "Points",
        columns,
        about=about,
        rows="point",
        order="major",
        hint=f"{printable_line(found[0].name)} known sz>3",
    )


def _coordinates(record: AdjustmentRecord, is_other: bool) -> list[Column]:
    """Coordinates in the system of the points, then in the frame; and their precisions."""
    found = record.points
    given = [_given_axis(record, axis) for axis in "xyz"] if is_other else []
    has_own = is_other and any(point.crs_sx is not None for point in found)
    names = {axis: f"frame {axis}" if is_other else axis for axis in "xyz"}
    placed = {axis: all_rounded([getattr(point, axis) for point in found]) for axis in "xyz"}
    frame = [column(names[axis], "length", placed[axis], rare=is_other) for axis in "xyz"]
    kind = "crs_s" if has_own else "s"
    own = {axis: f"s{axis}" if has_own or not is_other else f"frame s{axis}" for axis in "xyz"}
    return [*given, *frame, *(field(own[axis], "small_length", found, f"{kind}{axis}") for axis in "xyz")]


def _counted(record: AdjustmentRecord) -> list[Column]:
    """How many observations name each point."""
    rows = record.observations.whole
    active, (origins, names) = rows.truths("active"), rows.texts("from")
    targets, others = rows.texts("to")
    is_other = [names[a] != others[b] for a, b in zip(origins.tolist(), targets.tolist(), strict=True)]
    counts = Counter(rows.distinct("from", active))
    counts.update(rows.distinct("to", active & is_other))
    numbers = (counts[name] for name in record.points.values("name"))
    return [column("observations", "count", numbers, paper=False)]


def _moves(record: AdjustmentRecord) -> list[Column]:
    """How points moved, and their precisions on inner constraints."""
    moved, inner = [point.moved for point in record.points], [point.inner for point in record.points]
    far, free = "adjusted minus given", "with the datum of inner constraints"
    names = [f"moved {axis}" for axis in "xyz"], [f"inner s{axis}" for axis in "xyz"]
    return [
        *elements(names[0], "small_length", moved, by_size=True, about=far, rare=True),
        *elements(names[1], "small_length", inner, about=free, rare=True),
    ]


def _classes(record: AdjustmentRecord) -> Column:
    """What each point is: known, station, free."""
    stations = stations_of(record)
    texts = []
    for point in record.points:
        known = f"known {point.known}" if point.known else ""
        texts.append(known or ("station" if point.name in stations else "point"))
    return choice("kind", texts, about="known coordinates: small letters with a sigma, capitals held")


def stations_of(record: AdjustmentRecord) -> Collection[str]:
    """The points from which something is observed, also what a page of the worst does not have."""
    rows = record.observations.whole
    return rows.distinct("from", rows.truths("active"))


def _given_axis(record: AdjustmentRecord, axis: str) -> Column:
    unit = (record.points_crs_height_unit if axis == "z" else record.points_crs_unit) or "m"
    places = units.DECIMALS.get(unit, 4)
    values = all_rounded([getattr(point, f"crs_{axis}") for point in record.points], places + 1)
    more = {} if unit == "m" else {"decimals": places, "unit": unit}
    return column(axis, "length", values, **more)


def _known(record: AdjustmentRecord, rows: Rows) -> Table | None:
    found = record.constraints
    unit = {"unit": record.points_crs_unit} if record.points_crs_unit not in (None, "m") else {}
    columns = [
        column("point", "point", (rows.get(row.point) for row in found)),
        choice("coordinate", [row.coordinate for row in found]),
        *where(found),
        column("given", "length", (rounded(row.value, 9) for row in found), **unit),
        field("sigma", "small_length", found, "sigma"),
        field("residual", "small_length", found, "residual", by_size=True),
        field("normalised", "number", found, "normalised_residual", by_size=True, limit=4.0),
        field("w", "number", found, "standardised_residual", by_size=True, bar="w"),
        field("redundancy", "number", found, "redundancy", bar="redundancy"),
    ]
    return table(
        "known", "Known points", columns, order="normalised", about="Residuals are adjusted minus given."
    )


def _vectors(record: AdjustmentRecord, _: Rows) -> Table | None:
    """Vectors and positions, each tested as one observation."""
    found = record.joint
    off = (math.hypot(*row.blunder) for row in found)
    columns = [
        column("vector", "text", [printable_line(row.what) for row in found]),
        *where(found),
        field("T", "number", found, "statistic"),
        column("degrees", "count", (row.degrees for row in found)),
        field("limit", "number", found, "critical"),
        column("T / limit", "number", (row.statistic / row.critical for row in found), limit=1.0),
        column("off by", "small_length", off, about="estimate of its error, if it were the only one"),
        field("up", "small_length", found, "rise", about="the same, if its height alone were wrong"),
        field("w of that", "number", found, "rise_test", by_size=True),
    ]
    about = (
        "Each is tested as one observation: T of all components together; its limit finds errors as large "
        "as single tests do."
    )
    return table("vectors", "Vectors", columns, order="T / limit", about=about)


def _stations(record: AdjustmentRecord, rows: Rows) -> Table | None:
    found = record.stations
    zeros = (None if row.g0 is None else rounded(row.g0 % math.tau, PLACES["rad"]) for row in found)
    columns = [
        column("station", "point", (rows.get(row.origin) for row in found)),
        choice("orientation", [row.orientation for row in found]),
        column("zero of the circle", "angle", zeros, about="its azimuth"),
    ]
    return table("stations", "Stations", columns)


TABLES: dict[str, Callable[[AdjustmentRecord, Rows], Table | None]] = {
    "observations": _observations,
    "vectors": _vectors,
    "points": _points,
    "known": _known,
    "stations": _stations,
    "by-type": content_quality.by_type,
    "by-station": content_quality.by_station,
    "ellipsoids": content_quality.ellipsoids,
    "relative": content_quality.relative,
    "components": content_quality.components,
    "undetermined": content_quality.undetermined,
}
"""The tables by name, in the order of the page."""
