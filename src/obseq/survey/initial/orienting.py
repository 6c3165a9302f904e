"""Initial orientation of stations: local axes (#FIX), a rotation in space (#BASC); G0 of #VERT stations."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IntArray
from obseq.dataclass import dataclass
from obseq.geometry import closest_rotation, isometry, rotation_z
from obseq.survey.initial.closed_forms import Space, plus, scaled
from obseq.survey.initial.known import Known, Matrix, as_matrix
from obseq.survey.initial.relations import free_direction
from obseq.survey.model import Orientation
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import Step

_SAMPLE = 9
"""Sights of a station that are compared with each other."""
_BLOCK = 1024
"""Stations whose angles are compared at once: the comparisons of so many stay near the processor."""
LEAST_SPREAD = 0.01
"""Second singular value over the first, below which points are on a line and determine no rotation."""


def orient(known: Known, graph: SightGraph, station: int) -> bool:
    """Orients a #FIX or #BASC station, if what is known allows it; a #BASC station may place its origin too.

    Returns:
        True when the station has just been oriented.
    """
    orientation, origin = graph.orientations[station], graph.origins[station]
    if known.station_steps[station] is not None or orientation == Orientation.VERT.value:
        return False
    if orientation == Orientation.BASC.value:
        return _orient_free(known, graph, station)
    if not known.is_settled[origin]:
        return False
    known.g0[station], known.station_steps[station] = 0.0, Step("local axes")
    return True


def verticals_of_stations(known: Known) -> FloatRows:
    """(k, 3, 3) R_(frame -> vertical) at each station whose zero is known; NaN for the others."""
    verticals = np.full((len(known.g0), 3, 3), np.nan)
    plumb = [station for station, g0 in enumerate(known.g0) if g0 is not None]
    if plumb:
        verticals[plumb] = known.verticals_of([known.origins[station] for station in plumb])
    return verticals


def reconcile(known: Known, graph: SightGraph, coordinates: FloatArray, verticals: FloatRows) -> None:
    """Sets G0 of plumb stations to the value that most of their sights agree on, once all points are known.

    With one or two sights it is that of the first, as in MMVII. The points are at the coordinates (n, 3),
    the verticals (k, 3, 3) those of the stations.
    """
    stations, angles = _g0s_of_sights(known, graph, coordinates, verticals)
    if not len(stations):
        return
    starts = np.concatenate(([0], (stations[1:] != stations[:-1]).nonzero()[0] + 1))
    for station, g0 in zip(stations[starts].tolist(), _central_angles(angles, starts).tolist(), strict=True):
        known.g0[station] = g0


def _g0s_of_sights(
    known: Known, graph: SightGraph, coordinates: FloatArray, verticals: FloatRows
) -> tuple[IntArray, FloatArray]:
    """(k,) station and G0 of each sight of oriented plumb stations to placed targets, by station."""
    sights = graph.sights
    is_oriented = graph.is_plumb & np.array([step is not None for step in known.station_steps], np.bool_)
    is_compared = is_oriented[sights.stations] & known.are_placed()[sights.targets]
    rows = (is_compared & np.isfinite(sights.readings)).nonzero()[0]
    rows = rows[sights.stations[rows].argsort(kind="stable")]
    stations = sights.stations[rows]
    offsets = coordinates[sights.targets[rows]] - coordinates[sights.origins[rows]]
    east, north, up = np.einsum("nij,nj->in", verticals[stations], offsets)
    is_usable = np.hypot(east, north) > 1e-6 * np.abs(up) + 1e-9
    angles = np.arctan2(east, north) - sights.readings[rows]
    return stations[is_usable], _wrapped(angles[is_usable])


def _central_angles(angles: FloatArray, starts: IntArray) -> FloatArray:
    """Of each run of angles, the one nearest to its first few; the first of one or two."""
    counts = np.append(starts[1:], len(angles)) - starts
    blocks = [slice(first, first + _BLOCK) for first in range(0, len(starts), _BLOCK)]
    central = [_central_of_runs(angles, starts[block], counts[block]) for block in blocks]
    return central[0] if len(central) == 1 else np.concatenate(central)


def _central_of_runs(angles: FloatArray, starts: IntArray, counts: IntArray) -> FloatArray:
    """The same of some runs that start and count so."""
    columns = np.arange(_SAMPLE)
    inside = columns < counts[:, None]
    sample = angles[np.minimum(starts[:, None] + columns, len(angles) - 1)]
    apart = np.abs(_wrapped(sample[:, :, None] - sample[:, None, :]))
    sums = np.where(inside[:, None, :], apart, 0.0).sum(axis=2)
    best = np.where(counts <= 2, 0, np.argmin(np.where(inside, sums, np.inf), axis=1))
    return np.asarray(sample[np.arange(len(starts)), best])


def _wrapped(angles: FloatArray) -> FloatArray:
    return np.asarray(angles - 2.0 * math.pi * np.round(angles / (2.0 * math.pi)))


@dataclass(frozen=True)
class _Pairs:
    """Targets known in the frame and their vectors in the instrument."""

    ground: FloatArray
    seen: FloatArray
    rows: tuple[int, ...]
    points: tuple[int, ...]


def _orient_free(known: Known, graph: SightGraph, station: int) -> bool:
    """Rotation from two directions when the origin is known, or with its position from three vectors.

    The ones are about the origin, the others about their middle: those that are less on one line are taken.
    """
    origin = graph.origins[station]
    vectors = _pairs(known, graph, station, complete=True)
    seen, ground, rows = _directions(known, graph, station)
    of_vectors = spread(centred(vectors.seen), centred(vectors.ground)) if len(vectors.ground) >= 3 else 0.0
    of_directions = spread(seen, ground) if len(seen) >= 2 else 0.0
    if max(of_vectors, of_directions) <= LEAST_SPREAD**2:
        return False
    if of_vectors > of_directions:
        return _fit_isometry(known, station, origin, vectors)
    rotation = closest_rotation(ground.T @ seen)
    return _take_rotation(known, station, rotation, Step("known directions", rows))


def _directions(
    known: Known, graph: SightGraph, station: int
) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    """(n, 3) directions as they are seen, (n, 3) in the frame, their rows; none from an unknown origin."""
    origin = graph.origins[station]
    if not known.is_placed(origin):
        return np.zeros((0, 3)), np.zeros((0, 3)), ()
    pairs = _pairs(known, graph, station, complete=False)
    offsets = pairs.ground - np.array(known.position_of(origin))
    lengths = np.linalg.norm(offsets, axis=1)
    kept = lengths > 0.0
    return pairs.seen[kept], offsets[kept] / lengths[kept, None], pairs.rows


def _pairs(known: Known, graph: SightGraph, station: int, *, complete: bool) -> _Pairs:
    """Pairs with placed targets: vectors with their length, or all directions as unit vectors."""
    ground: list[Space] = []
    seen: list[Space] = []
    rows: list[int] = []
    points: list[int] = []
    for number in graph.sights_from[station]:
        sight = graph.sights[number]
        found = free_direction(sight) if known.is_placed(sight.target) else None
        if found is None or (complete and not found[1]):
            continue
        up = known.vertical_of(sight.target)[2]
        ground.append(plus(known.position_of(sight.target), scaled(up, sight.lift)))
        seen.append(found[0][0])
        points.append(sight.target)
        rows.extend(found[0][1])
    vectors = np.array(seen, np.float64).reshape(-1, 3)
    if not complete:
        vectors /= np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None]
    return _Pairs(np.array(ground, np.float64).reshape(-1, 3), vectors, tuple(rows), tuple(points))


def _fit_isometry(known: Known, station: int, origin: int, pairs: _Pairs) -> bool:
    """Least-squares isometry instrument -> frame; gives the position of the origin if it has none."""
    pose = isometry(pairs.seen, pairs.ground)
    step = Step("isometry on three or more points", pairs.rows)
    if not known.is_placed(origin):
        x, y, z = pose.centre.tolist()
        known.positions[origin] = (x, y, z)
        known.has_height[origin], known.point_steps[origin] = 1, step
        known.point_sigmas[origin] = min(known.point_sigmas[point] for point in pairs.points)
    return _take_rotation(known, station, pose.rotation, step)


def centred(vectors: FloatArray) -> FloatArray:
    """Vectors (n, 3) about their middle."""
    return np.asarray(vectors - vectors.mean(axis=0))


def spread(local: FloatArray, world: FloatArray) -> float:
    """How far vectors (n, 3), and what they become, are from lying on one line: 0 on it."""
    singular = np.linalg.svd(world.T @ local, compute_uv=False)
    return float(singular[1] / singular[0]) if singular[0] > 0.0 else 0.0


def _take_rotation(known: Known, station: int, rotation: FloatArray, step: Step) -> bool:
    known.rotations[station] = as_matrix(rotation)
    known.station_steps[station] = step
    return True


def plumb_rotation(vertical: FloatArray, g0: FloatArray) -> FloatArray:
    """Rotations instrument -> frame of plumb stations: (Rz(g0) R_(frame -> vertical))^T.

    Args:
        vertical: (m, 3, 3) R_(frame -> vertical) at the origins.
        g0: (m,) azimuths of the zeros of the circles, radians.
    """
    return np.transpose(rotation_z(g0) @ vertical, (0, 2, 1))


def g0_of(rotation: Matrix, vertical: Matrix) -> float:
    """G0 of a rotation instrument -> frame: read from R_(vertical -> instrument), as MMVII reads it."""
    to_instrument = np.array(rotation).T @ np.array(vertical).T
    return math.atan2(float(to_instrument[1, 0]), float(to_instrument[0, 0]))
