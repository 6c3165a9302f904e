"""A frame for a network in which nothing is known: a point is its origin, a sight from there its orientation.

Two points are enough: from them the others are placed as from known points. Where no distance is measured,
the first one is said to be `UNIT` long. Slope distances alone say nothing of the vertical: a third point
in a triangle with the two makes the plane of height 0, and a fourth one says which side of it is up.
Where all set-ups are tilted sub-frames, the network is in the axes of the one that sees most.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE, among, codes_where
from obseq.survey.model import FieldBook, Orientation, Points

UNIT = 100.0
"""Metres between the first two points of a network without any distance."""
_AXES = (Start.DX, Start.DY, Start.DZ)
_USED = (Start.HZ, Start.ANGLE, Start.ZENITH, Start.FLAT, Start.DISTANCE, Start.RISE, *_AXES)


class _Sight(NamedTuple):
    """From a point to another."""

    origin: int
    target: int


def placed_in_own_frame(points: Points, book: FieldBook) -> tuple[Points, str] | None:
    """The points with coordinates for two of them, and what to say of it; None where something is known.

    One point with approximate coordinates says where the frame is, and nothing of its orientation.

    Args:
        points: Of a plane with or without heights, numbered like the field book.
        book: The observations.
    """
    anchors = np.flatnonzero(np.isfinite(points.coordinates[:, :2]).any(axis=1))
    if anchors.size > 1 or (anchors.size and _is_held(points, book, int(anchors[0]))):
        return None
    measured = _measured(book)
    sight = _first_sight(measured, anchors)
    if sight is None:
        return None if anchors.size else _in_axes_of_tilted(points, book)
    length = _length(measured, sight)
    azimuth = measured[Start.HZ].get(sight, 0.0)
    coordinates = points.coordinates.copy()
    flat = UNIT if length is None else length
    given = coordinates[anchors].copy()
    coordinates[anchors] = np.nan
    is_new = np.isnan(coordinates)
    coordinates[sight.origin, :2] = 0.0
    coordinates[sight.target, :2] = flat * math.sin(azimuth), flat * math.cos(azimuth)
    for row, height in ((sight.origin, 0.0), (sight.target, _rise(measured, sight, flat))):
        if np.isnan(coordinates[row, 2]):
            coordinates[row, 2] = height
    corners = _corners(measured, coordinates, sight)
    coordinates[is_new] += np.broadcast_to(
        np.nan_to_num(given - coordinates[anchors]).sum(axis=0), coordinates.shape
    )[is_new]
    origin, target = points.names[sight.origin], points.names[sight.target]
    named = [points.names[row] for row in anchors]
    what = f"only {named[0]} has coordinates" if named else "no point has coordinates"
    place = f"{named[0]} there" if named else f"{origin} at 0 0"
    told = (
        f"{what}: the network is placed in a frame of its own, {place} and the azimuth from {origin} to "
        f"{target} {'as its circle has it' if sight in measured[Start.HZ] else '0'}; its datum is that of "
        "inner constraints"
    )
    if corners:
        told += f". Nothing says what is vertical: {points.names[corners[0]]} is at their height"
    if length is None:
        told += (
            f". No distance is measured: {origin} - {target} is taken as {UNIT:g} m, its scale says nothing"
        )
    return replace(points, coordinates=coordinates), told


def _is_held(points: Points, book: FieldBook, row: int) -> bool:
    """Whether anything beside a point's approximate coordinates says what is where, or which way is north."""
    absolute = codes_where(lambda kind: kind.is_absolute or kind.is_from_north)
    rows = book.observations
    return bool(
        not np.isnan(points.sigmas[row, :2]).all()
        or points.in_datum.any()
        or (among(rows.types, absolute) & rows.active).any()
    )


def _in_axes_of_tilted(points: Points, book: FieldBook) -> tuple[Points, str] | None:
    """The points in the axes of the tilted set-up that gives most of them three components."""
    seen: dict[int, dict[_Sight, dict[Start, float]]] = defaultdict(lambda: defaultdict(dict))
    for start, sight, value, station in _rows(book, is_tilted=True):
        if start in _AXES:
            seen[station][sight].setdefault(start, value)
    places = [
        {sight: [axes[axis] for axis in _AXES] for sight, axes in sights.items() if len(axes) == len(_AXES)}
        for sights in seen.values()
    ]
    most = max(places, key=len, default={})
    if not most:
        return None
    coordinates = points.coordinates.copy()
    origin = next(iter(most)).origin
    coordinates[origin] = 0.0
    for sight, place in most.items():
        coordinates[sight.target] = place
    return replace(points, coordinates=coordinates), (
        f"no point has coordinates: the network is placed in the axes of {points.names[origin]}, a set-up "
        "that is not plumb; its datum is that of inner constraints"
    )


def _corners(measured: dict[Start, dict[_Sight, float]], coordinates: FloatArray, base: _Sight) -> list[int]:
    """Places a third point at height 0, and a fourth one above it, where slope distances are all there is.

    Args:
        measured: The first value of each sort between two points.
        coordinates: (n, 3), which are changed.
        base: The first two points.

    Returns:
        Their rows, as far as they are found: the point farthest from the line, then from the plane.
    """
    if any(found for start, found in measured.items() if start is not Start.DISTANCE):
        return []
    lengths = {frozenset(sight): value for sight, value in measured[Start.DISTANCE].items()}
    rows = sorted({end for sight in measured[Start.DISTANCE] for end in sight})
    placed = list(base)
    for _ in range(2):
        found = {
            row: _apex(coordinates[placed], [lengths.get(frozenset((end, row))) for end in placed])
            for row in rows
            if row not in placed
        }
        apexes = {row: apex for row, apex in found.items() if apex is not None}
        if not apexes:
            break
        best = max(apexes, key=lambda row: apexes[row].off)
        coordinates[best] = apexes[best].place
        placed.append(best)
    return placed[2:]


class _Apex(NamedTuple):
    """A place, and how far it is from what the points before it span."""

    place: FloatArray
    off: float


def _apex(ends: FloatArray, lengths: Sequence[float | None]) -> _Apex | None:
    """The place at these distances from two or three points; with two at height 0, with three above them."""
    known = [length for length in lengths if length is not None]
    if len(known) < len(ends):
        return None
    first = ends[0]
    sides = ends[1:] - first
    squares = np.square(known)
    right = (squares[0] - squares[1:] + np.sum(sides**2, axis=1)) / 2.0
    inside = np.linalg.lstsq(sides, right, rcond=None)[0]
    off = float(squares[0] - inside @ inside)
    if not off > 0.0:
        return None
    normal = np.cross(sides[0], [0.0, 0.0, 1.0] if len(sides) == 1 else sides[1])
    normal *= 1.0 if normal[2] >= 0.0 else -1.0
    off = math.sqrt(off)
    return _Apex(first + inside + off * normal / np.linalg.norm(normal), off)


def _measured(book: FieldBook) -> dict[Start, dict[_Sight, float]]:
    """The first value of each sort between two points; components in a plumb sub-frame are polar sights."""
    found: dict[Start, dict[_Sight, float]] = {start: {} for start in _USED}
    for start, sight, value, _ in _rows(book):
        found[start].setdefault(sight, value)
    for sight, x in found[Start.DX].items():
        if (y := found[Start.DY].get(sight)) is not None:
            found[Start.HZ].setdefault(sight, math.atan2(x, y))
            found[Start.FLAT].setdefault(sight, math.hypot(x, y))
    for sight, rise in found[Start.DZ].items():
        found[Start.RISE].setdefault(sight, rise)
    return found


def _rows(book: FieldBook, *, is_tilted: bool = False) -> Iterator[tuple[Start, _Sight, float, int]]:
    """What is observed on tilted set-ups, or everything else."""
    rows = book.observations
    free = np.append(book.stations.orientations == Orientation.BASC, False)
    chosen = np.flatnonzero(rows.active & (free[rows.stations] == is_tilted))
    columns = (rows.types, rows.from_points, rows.to_points, rows.values, rows.stations)
    for code, origin, target, value, station in zip(*(c[chosen].tolist() for c in columns), strict=True):
        start = BY_CODE[code].start
        if start in _USED and origin != target:
            yield start, _Sight(origin, target), value, station


def _first_sight(measured: dict[Start, dict[_Sight, float]], ends: IntArray) -> _Sight | None:
    """The sight to begin with: with a length if there is one, from the point that sees most.

    Args:
        measured: The first value of each sort between two points.
        ends: Row of a point at one of its ends; none: any sight.
    """
    if ends.size:
        measured = {
            start: {sight: value for sight, value in found.items() if ends[0] in sight}
            for start, found in measured.items()
        }
    seen = Counter(sight.origin for start in (Start.HZ, Start.ANGLE) for sight in measured[start])
    met = Counter(sight.target for start in (Start.HZ, Start.ANGLE) for sight in measured[start])
    lengths = [*measured[Start.FLAT], *measured[Start.DISTANCE]]
    directed = list(measured[Start.HZ])
    sighted = [sight for sight in directed if _length(measured, sight) is not None]
    for sights in (sighted, lengths, directed, list(measured[Start.ANGLE])):
        if sights:
            return max(sights, key=lambda sight: (seen[sight.origin], met[sight.target]))
    return None


def _length(measured: dict[Start, dict[_Sight, float]], sight: _Sight) -> float | None:
    """The horizontal distance of a sight, measured from either end."""
    for way in (sight, _Sight(sight.target, sight.origin)):
        if way in measured[Start.FLAT]:
            return measured[Start.FLAT][way]
        if way in measured[Start.DISTANCE]:
            slope = measured[Start.DISTANCE][way]
            zenith = measured[Start.ZENITH].get(way)
            rise = measured[Start.RISE].get(way, 0.0)
            level = math.sqrt(max(slope**2 - rise**2, 0.0)) if zenith is None else slope * math.sin(zenith)
            return abs(level) or None
    return None


def _rise(measured: dict[Start, dict[_Sight, float]], sight: _Sight, flat: float) -> float:
    """The height difference of a sight, as far as it was measured."""
    if sight in measured[Start.RISE]:
        return measured[Start.RISE][sight]
    zenith = measured[Start.ZENITH].get(sight, math.pi / 2.0)
    return flat / math.tan(zenith) if math.sin(zenith) > 1e-3 else 0.0
