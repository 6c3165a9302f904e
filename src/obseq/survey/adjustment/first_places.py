"""First places of points that only positions, vectors or axes give, before all other initial values."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.geometry.circles import axis_of, centre_of
from obseq.survey.equations.families import present
from obseq.survey.equations.frame import Frame
from obseq.survey.kinds.kind import FirstPlace
from obseq.survey.kinds.registry import BY_CODE, among, codes_placed_by
from obseq.survey.model import FieldBook, Observations, Points

_OF_THREE = FirstPlace.POSITION, FirstPlace.VECTOR, FirstPlace.LOCAL_VECTOR
"""What takes three observations, one for each component."""


def with_first_places(frame: Frame, points: Points, book: FieldBook) -> Points:
    """The points, with places for those observed in position, at the end of a vector, or of an axis."""
    observations = book.observations
    if not _are_given(observations, FirstPlace.CIRCLE, *_OF_THREE):
        return points
    circles = _rows_of(observations, FirstPlace.CIRCLE)
    positions, coordinates = _triples(observations, FirstPlace.POSITION)
    vectors, geocentric = _triples(observations, FirstPlace.VECTOR)
    local, steps = _triples(observations, FirstPlace.LOCAL_VECTOR)
    if not (positions.size or vectors.size or local.size or circles.size):
        return points
    xyz = points.coordinates.copy()
    if positions.size:
        rotation, translation = frame.to_geocentric(book, positions)
        targets = observations.to_points[positions]
        new = np.isnan(xyz[targets]).any(axis=1)
        xyz[targets[new]] = (coordinates[new] - translation) @ rotation
    rotation = frame.to_geocentric(book, vectors)[0] if vectors.size else np.eye(3)
    both = np.concatenate([geocentric @ rotation, steps])
    _place_by_vectors(book, np.concatenate([vectors, local]), both, xyz)
    for origin in np.unique(observations.from_points[circles]).tolist():
        seen = observations.to_points[circles[observations.from_points[circles] == origin]]
        placed = xyz[seen][np.isfinite(xyz[seen]).all(axis=1)]
        if np.isnan(xyz[origin]).any() and len(placed) > 1:
            xyz[origin] = (placed.min(axis=0) + placed.max(axis=0)) / 2.0
    return replace(points, coordinates=xyz)


def with_later_places(points: Points, book: FieldBook, placed: FloatArray) -> Points | None:
    """The points, with places for what others have that have been placed; None when there are no more.

    These are barycentres, and origins of axes at the centre of a circle.

    Args:
        points: Those without some of the places.
        book: The observations.
        placed: (n, 3) places of the points, NaN for none.
    """
    if not _are_given(book.observations, FirstPlace.BARYCENTRE, FirstPlace.CIRCLE):
        return None
    observations, xyz = book.observations, points.coordinates.copy()
    for row in _rows_of(observations, FirstPlace.BARYCENTRE).tolist():
        centre, group = observations.from_points[row], book.groups[observations.groups[row]]
        members = list(group.members)
        if np.isnan(placed[centre]).any() and np.isfinite(placed[members]).all():
            xyz[centre] = group.shares @ placed[members]
    for origin, circle in _circles(book, placed):
        centre_there = centre_of(circle)
        if np.isnan(placed[origin]).any() and np.isnan(xyz[origin]).any() and centre_there is not None:
            xyz[origin] = centre_there
    is_more = np.isfinite(xyz).sum() > np.isfinite(points.coordinates).sum()
    return replace(points, coordinates=xyz) if is_more else None


def on_axes(points: Points, book: FieldBook, placed: FloatArray) -> FloatArray:
    """(n, 3) places of points, where origins of axes that are not held are brought to their axis.

    Coordinates of an origin that are off its axis by more than the radius lead the iterations astray.
    """
    found = placed
    for origin, circle in _circles(book, placed):
        normal, centre = axis_of(circle), centre_of(circle)
        if centre is None or np.isnan(placed[origin]).any() or (points.sigmas[origin] == 0.0).any():
            continue
        along = normal / np.linalg.norm(normal)
        found = found.copy() if found is placed else found
        found[origin] = centre + along * ((placed[origin] - centre) @ along)
    return found


def _circles(book: FieldBook, placed: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Origins of axes, and (k, 3) placed points of the circle that has most of them."""
    rows = _rows_of(book.observations, FirstPlace.CIRCLE)
    circles: dict[int, dict[int, FloatArray]] = {}
    for group in sorted(set(book.observations.groups[rows].tolist())):
        of_circle = rows[book.observations.groups[rows] == group]
        points = placed[book.observations.to_points[of_circle]]
        origin = int(book.observations.from_points[of_circle[0]])
        circles.setdefault(origin, {})[group] = points[np.isfinite(points).all(axis=1)]
    for origin, several in circles.items():
        yield origin, max(several.values(), key=len)


def _are_given(observations: Observations, *uses: FirstPlace) -> bool:
    """Whether some observations, active or not, give first places in one of these ways."""
    return any(BY_CODE[code].first_place in uses for code in present(observations.types))


def _rows_of(observations: Observations, use: FirstPlace) -> IntArray:
    return np.flatnonzero(among(observations.types, codes_placed_by(use)) & observations.active)


def _triples(observations: Observations, use: FirstPlace) -> tuple[IntArray, FloatArray]:
    """First rows (n,) and values (n, 3) of the vectors or positions whose three components are all active.

    Args:
        observations: All observations.
        use: What they give; their kinds are three, one for each component, in this order.
    """
    rows = _rows_of(observations, use)
    if not rows.size:
        return rows, np.zeros((0, 3))
    component = np.searchsorted(np.array(codes_placed_by(use)), observations.types)
    ends = np.stack([observations.from_points[rows], observations.to_points[rows]])
    starts = rows[:-2][(rows[2:] == rows[:-2] + 2) & (ends[:, 2:] == ends[:, :-2]).all(axis=0)]
    three = starts[:, None] + np.arange(3)
    whole = (np.sort(component[three], axis=1) == np.arange(3)).all(axis=1)
    starts, three = starts[whole], three[whole]
    values = np.empty((len(starts), 3))
    np.put_along_axis(values, component[three], observations.values[three], axis=1)
    return _apart(starts), values[np.isin(starts, _apart(starts))]


def _apart(starts: IntArray) -> IntArray:
    """Those of the first rows (n,), ascending, that are in no triple that begins before."""
    kept: list[int] = []
    for start in starts.tolist():
        if not kept or start >= kept[-1] + 3:
            kept.append(start)
    return np.array(kept, np.int64)


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
