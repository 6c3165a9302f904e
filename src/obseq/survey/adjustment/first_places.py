"""First places of points that only vectors or axes of rotation reach, before all other initial values."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.axes import AXIS_RADIUS
from obseq.survey.kinds.vectors import VECTOR

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.model import FieldBook, Observations, Points


def with_first_places(frame: Frame, points: Points, book: FieldBook) -> Points:
    """The points, with places for those at the end of a vector from a placed one, or of an axis."""
    xyz = points.coordinates.copy()
    observations = book.observations
    vectors = np.flatnonzero((observations.types == VECTOR.code) & observations.active)
    circles = np.flatnonzero((observations.types == AXIS_RADIUS.code) & observations.active)
    if not vectors.size and not circles.size:
        return points
    _place_by_vectors(frame, book, vectors.tolist(), xyz)
    for origin in np.unique(observations.from_points[circles]).tolist():
        seen = observations.to_points[circles[observations.from_points[circles] == origin]]
        placed = xyz[seen][np.isfinite(xyz[seen]).all(axis=1)]
        if np.isnan(xyz[origin]).any() and len(placed):
            xyz[origin] = (placed.min(axis=0) + placed.max(axis=0)) / 2.0
    return replace(points, coordinates=xyz)


def _place_by_vectors(frame: Frame, book: FieldBook, rows: list[int], xyz: FloatArray) -> None:
    """Goes along the vectors from placed points to others, as far as they lead."""
    if not rows:
        return
    observations = book.observations
    rotation, _ = frame.to_geocentric(book, np.array(rows))
    open_rows = rows
    while True:
        left = [row for row in open_rows if not _placed_by(row, observations, rotation, xyz)]
        if len(left) == len(open_rows):
            return
        open_rows = left


def _placed_by(row: int, observations: Observations, rotation: FloatArray, xyz: FloatArray) -> bool:
    """Places one end of a vector from the other; whether both ends are placed then."""
    ends = int(observations.from_points[row]), int(observations.to_points[row])
    known = [bool(np.isfinite(xyz[end]).all()) for end in ends]
    if known[0] != known[1]:
        step = rotation.T @ observations.values[row : row + 3]
        start, end, sign = (*ends, 1.0) if known[0] else (ends[1], ends[0], -1.0)
        xyz[end] = xyz[start] + sign * step
    return any(known)
