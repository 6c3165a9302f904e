"""Points that only levelling knows: their plan is not an unknown."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.equalities import EQUAL_DH
from obseq.survey.kinds.lengths import DH
from obseq.survey.model import make_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.survey.model import FieldBook, Points


def levelled_points(points: Points, book: FieldBook, place: Sequence[float]) -> Points:
    """Points that no file describes and that only height differences name, at a given plan, heights free.

    Args:
        points: Those that files describe.
        book: The observations.
        place: Coordinates of which the first two become theirs.
    """
    observations = book.observations
    by_height = np.isin(observations.types, (DH.code, EQUAL_DH.code))
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
    return make_points(names, np.reshape(coordinates, (-1, 3)), np.tile((0.0, 0.0, np.nan), (len(new), 1)))


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
