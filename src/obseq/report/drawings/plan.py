"""The plan of a network for the interactive page: places, kinds of points, ellipses, displacements."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from obseq.printable import printable_line
from obseq.records.adjustment import AdjustmentRecord, PointRecord
from obseq.report.drawings.map import Similarity, similarity
from obseq.report.tables.content import stations_of
from obseq.report.tables.named import ellipse_level

TOGETHER = 0.1
"""Width (rad) of the bundles of rays that are drawn as one, with all their names."""

KNOWN, STATION, UNDETERMINED = 1, 2, 4
"""Marks of points, added up; the script of the page has the same."""


def plan(record: AdjustmentRecord, rows: dict[str, int]) -> dict[str, object]:
    """The plan; `rows` gives the number of each name, points of the record first."""
    from obseq.report.drawings.scheme import (
        scheme,  # numpy comes with it, which a command's help need not load
    )

    stations = stations_of(record)
    places: list[tuple[float | None, float | None]] = [(None, None)] * len(rows)
    marks, to_map = [0] * len(rows), similarity(record)
    for k, point in enumerate(record.points):
        places[k] = _place(point, to_map)
        marks[k] = (KNOWN if _is_known(record, point) else 0) | (STATION if point.name in stations else 0)
    for item in record.left_out:
        row = rows.get(item.name)
        if row is not None and item.place and row >= len(record.points):
            places[row] = to_map.place(item.place[0], item.place[1])
            marks[row] = UNDETERMINED
    padding, drawn = len(rows) - len(record.points), scheme(record)
    for name, place in (drawn or {}).items():
        places[rows[name]] = place
        if "z" not in (record.points[rows[name]].known or "").lower():
            marks[rows[name]] &= ~KNOWN
    shown = {"ellipses": f"ellipse {ellipse_level(record)}"}
    if drawn is not None:
        shown = {
            "title": "no plan is known: a scheme of the levelling, longer lines being less precise ones",
            "ellipses": f"circle: standard deviation of the height {record.precision or ''}".strip(),
        }
    return {
        "x": [x for x, _ in places],
        "y": [y for _, y in places],
        "marks": marks,
        "scheme": drawn is not None,
        "turn": to_map.turned(1.0, 0.0),
        **(_ellipses(record, padding, to_map) if drawn is None else _circles(record, padding)),
        "moved": _moved(record, padding, to_map) if drawn is None else None,
        "unplaced": [printable_line(name) for name in _unplaced(record)],
        "rays": _rays(record, rows, to_map),
        "loose": _loose(record, rows, to_map),
        **shown,
        "displacements": "displacement, adjusted minus given",
        "across": [row.name for row in record.types or () if row.sense == "across"],
        "along": [row.name for row in record.types or () if row.sense == "along"],
    }


def round_below(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above it."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= value)


def plan_of_points(points: Sequence[PointRecord], stations: Collection[str]) -> dict[str, object]:
    """The plan of what is not adjusted yet: places and marks."""
    places = [point.plan or (None, None) for point in points]
    marks = [STATION if point.name in stations else 0 for point in points]
    return {"x": [x for x, _ in places], "y": [y for _, y in places], "marks": marks, "scheme": False}


def _is_known(record: AdjustmentRecord, point: PointRecord) -> bool:
    if point.known is not None:
        return point.known != ""
    return point.name in {row.point for row in record.constraints}


def _ellipses(record: AdjustmentRecord, padding: int, to_map: Similarity) -> dict[str, list[float | None]]:
    found = [point.ellipse for point in record.points] + [None] * padding
    return {
        "major": [None if item is None else float(f"{item.semi_major:.4g}") for item in found],
        "minor": [None if item is None else float(f"{item.semi_minor:.4g}") for item in found],
        "bearing": [None if item is None else round(to_map.bearing(item.bearing), 4) for item in found],
    }


def _circles(record: AdjustmentRecord, padding: int) -> dict[str, list[float | None]]:
    """Standard deviations of heights, as circles of a scheme."""
    sigmas = [None if point.sz is None else float(f"{point.sz:.4g}") for point in record.points]
    padded = [*sigmas, *[None] * padding]
    return {"major": padded, "minor": padded, "bearing": [0.0] * len(padded)}


def _moved(record: AdjustmentRecord, padding: int, to_map: Similarity) -> list[list[float] | None] | None:
    """How far points came from where they were given, in x and y; None where none were given."""
    found = [_in_plan(point, to_map) for point in record.points]
    return [*found, *[None] * padding] if any(found) else None


def _in_plan(point: PointRecord, to_map: Similarity) -> list[float] | None:
    """How far a point moved in x and y; None where one of them is not known."""
    x, y = (point.moved or (None, None))[:2]
    return None if x is None or y is None else [round(value, 5) for value in to_map.turned(x, y)]


def _place(point: PointRecord, to_map: Similarity) -> tuple[float | None, float | None]:
    """Where a point is on the plan: exactly where it is on the map."""
    if point.plan is None:
        return None, None
    x, y = point.plan
    if to_map.is_map and point.crs_x is not None and point.crs_y is not None:
        x, y = point.crs_x, point.crs_y
    return round(x, 4), round(y, 4)


def _unplaced(record: AdjustmentRecord) -> list[str]:
    """Points that are left out and have no place on the plan."""
    placed = {point.name for point in record.points}
    return [item.name for item in record.left_out if not item.place and item.name not in placed]


def _loose(record: AdjustmentRecord, rows: dict[str, int], to_map: Similarity) -> list[list[float]]:
    """Directions along which nothing holds a point that is left out: its row, and a unit vector."""
    return [
        [rows[item.name], *(round(part, 3) for part in (*to_map.turned(*direction[:2]), *direction[2:]))]
        for item in record.left_out
        if item.place and rows.get(item.name, -1) >= len(record.points)
        for direction in item.directions or ()
    ]


def _rays(record: AdjustmentRecord, rows: dict[str, int], to_map: Similarity) -> list[list[float | str]]:
    """Sights of adjusted points to left out ones without a place: row of the point, unit step, name."""
    lost = set(_unplaced(record))
    bundles: dict[tuple[int, int], list[tuple[float, str]]] = {}
    for sight in record.observations:
        bearing = sight.azimuth
        if sight.target in lost and bearing is not None and rows[sight.origin] < len(record.points):
            bundle = rows[sight.origin], round(bearing % math.tau / TOGETHER)
            bundles.setdefault(bundle, []).append((to_map.bearing(bearing), printable_line(sight.target)))
    return [
        [
            row,
            round(math.sin(rays[0][0]), 6),
            round(math.cos(rays[0][0]), 6),
            ", ".join(dict.fromkeys(name for _, name in rays)),
        ]
        for (row, _), rays in bundles.items()
    ]
