"""First places of points that only positions, vectors or axes give, before all other initial values."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.axes import AXIS_RADIUS
from obseq.survey.kinds.geodetic import GEO_X
from obseq.survey.kinds.vectors import LOCAL_X, VECTOR

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.model import FieldBook, Points


def with_first_places(frame: Frame, points: Points, book: FieldBook) -> Points:
    """The points, with places for those observed in position, at the end of a vector, or of an axis."""
    observations = book.observations
    positions, vectors, local, circles = (
        np.flatnonzero((observations.types == kind.code) & observations.active)
        for kind in (GEO_X, VECTOR, LOCAL_X, AXIS_RADIUS)
    )
    if not (positions.size or vectors.size or local.size or circles.size):
        return points
    xyz = points.coordinates.copy()
    _place_by_positions(frame, book, positions, xyz)
    rotation = frame.to_geocentric(book, vectors)[0] if vectors.size else np.eye(3)
    values = observations.values
    steps = [values[vectors[:, None] + np.arange(3)] @ rotation, values[local[:, None] + np.arange(3)]]
    _place_by_vectors(book, np.concatenate([vectors, local]), np.concatenate(steps), xyz)
    for origin in np.unique(observations.from_points[circles]).tolist():
        seen = observations.to_points[circles[observations.from_points[circles] == origin]]
        placed = xyz[seen][np.isfinite(xyz[seen]).all(axis=1)]
        if np.isnan(xyz[origin]).any() and len(placed):
            xyz[origin] = (placed.min(axis=0) + placed.max(axis=0)) / 2.0
    return replace(points, coordinates=xyz)


def _place_by_positions(frame: Frame, book: FieldBook, rows: IntArray, xyz: FloatArray) -> None:
    if not rows.size:
        return
    rotation, translation = frame.to_geocentric(book, rows)
    targets = book.observations.to_points[rows]
    new = np.flatnonzero(np.isnan(xyz[targets]).any(axis=1))
    geocentric = book.observations.values[rows[new][:, None] + np.arange(3)]
    xyz[targets[new]] = (geocentric - translation) @ rotation


def _place_by_vectors(book: FieldBook, rows: IntArray, steps: FloatArray, xyz: FloatArray) -> None:
    """Goes along the vectors (n, 3), in the frame, from placed points to others, as far as they lead."""
    neighbours: dict[int, list[tuple[int, FloatArray]]] = {}
    ends = (book.observations.from_points[rows].tolist(), book.observations.to_points[rows].tolist())
    for start, end, step in zip(*ends, steps, strict=True):
        neighbours.setdefault(start, []).append((end, step))
        neighbours.setdefault(end, []).append((start, -step))
    waiting = deque(point for point in neighbours if np.isfinite(xyz[point]).all())
    while waiting:
        point = waiting.popleft()
        for other, step in neighbours[point]:
            if np.isnan(xyz[other]).any():
                xyz[other] = xyz[point] + step
                waiting.append(other)
