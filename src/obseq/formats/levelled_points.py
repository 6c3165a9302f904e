"""Points that only levelling knows: their plan is not an unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray
from obseq.survey.kinds.lengths import DH
from obseq.survey.kinds.registry import codes_where
from obseq.survey.model import FieldBook, Observations, Points, make_points


def levelled_points(points: Points, book: FieldBook, place: Sequence[float]) -> Points:
    """Points that no file describes and that only height differences name, at a given plan, heights free.

    Args:
        points: Those that files describe.
        book: The observations.
        place: Coordinates of which the first two become theirs.
    """
    observations = book.observations
    by_height = _says_heights_only(observations)
    n = len(book.point_names)
    levelled, other = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    for ends in (observations.from_points, observations.to_points):
        levelled[ends[by_height & observations.active]] = True
        other[ends[~by_height & observations.active]] = True
    new = [
        row for row in np.flatnonzero(levelled & ~other).tolist() if book.point_names[row] not in points.index
    ]
    heights = _heights(points, book)
    coordinates = [[place[0], place[1], heights.get(row, 0.0)] for row in new]
    names = [book.point_names[row] for row in new]
    made = make_points(names, np.reshape(coordinates, (-1, 3)), np.tile((0.0, 0.0, np.nan), (len(new), 1)))
    return replace(made, invented=np.tile((True, True, False), (len(new), 1)))


def hold_plans(points: Points, book: FieldBook) -> Points:
    """The points, with the plan of those held somewhere that have none and that only heights are observed of.

    Args:
        points: All points that observations name, and others.
        book: The observations.
    """
    rows = book.observations
    in_plan = rows.active & ~_says_heights_only(rows)
    seen = rows.counts(in_plan, len(book.point_names)) > 0
    named = dict(zip(book.point_names, seen.tolist(), strict=True))
    levelled = np.array([named.get(name) is False for name in points.names], np.bool_)
    lacking = levelled & np.asarray(np.isnan(points.coordinates[:, :2]).all(axis=1))
    if not lacking.any():
        return points
    known = points.coordinates[np.isfinite(points.coordinates[:, :2]).all(axis=1), :2]
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    invented = points.is_invented.copy()
    coordinates[lacking, :2] = known.mean(axis=0) if len(known) else 0.0
    sigmas[lacking, :2], invented[lacking, :2] = 0.0, True
    return replace(points, coordinates=coordinates, sigmas=sigmas, invented=invented)


def with_heights(points: Points, book: FieldBook) -> Points:
    """The points, with approximate heights of those whose plan is held, along the height differences.

    Args:
        points: All points.
        book: The observations.
    """
    xyz, sigmas = points.coordinates, points.sigmas
    lacking = np.isnan(xyz[:, 2]) & (sigmas[:, :2] == 0.0).all(axis=1)
    if not lacking.any():
        return points
    heights = {book.point_names[row]: height for row, height in _heights(points, book).items()}
    coordinates = xyz.copy()
    for row in np.flatnonzero(lacking).tolist():
        coordinates[row, 2] = heights.get(points.names[row], np.nan)
    return replace(points, coordinates=coordinates)


def _says_heights_only(rows: Observations) -> BoolArray:
    return np.isin(rows.types, codes_where(lambda kind: kind.is_levelled))


def _heights(points: Points, book: FieldBook) -> dict[int, float]:
    """Heights along the height differences from the points that files describe, as far as they lead."""
    observations = book.observations
    rows = np.flatnonzero((observations.types == DH.code) & observations.active)
    heights = {
        row: float(points.coordinates[points.index[name], 2])
        for row, name in enumerate(book.point_names)
        if name in points.index and np.isfinite(points.coordinates[points.index[name], 2])
    }
    neighbours: dict[int, list[tuple[int, float]]] = {}
    for row in rows.tolist():
        start, end = int(observations.from_points[row]), int(observations.to_points[row])
        rise = float(observations.values[row])
        neighbours.setdefault(start, []).append((end, rise))
        neighbours.setdefault(end, []).append((start, -rise))
    queue = list(heights)
    for point in queue:
        for other, rise in neighbours.get(point, []):
            if other not in heights:
                heights[other] = heights[point] + rise
                queue.append(other)
    return heights
