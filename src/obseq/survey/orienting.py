"""Initial orientation of stations: local axes (#FIX), one azimuth (#VERT), or a rotation in space (#BASC)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.closed_forms import Space, wrap
from obseq.survey.constraints import free_direction
from obseq.survey.model import Orientation
from obseq.survey.placement_state import Matrix, State, Step, as_matrix, minus, times

if TYPE_CHECKING:
    from obseq.survey.model import FloatArray
    from obseq.survey.sights import Graph, Sight

_LEAST_SPREAD = 0.01
"""Second singular value over the first, below which points are on a line and determine no rotation."""


def orient(state: State, graph: Graph, station: int, is_constrained: list[bool]) -> bool:
    """Orients a station if what is known allows it; a #BASC station may place its origin at the same time.

    Args:
        state: what is known; it is completed.
        graph: the observations.
        station: a station that is not oriented yet.
        is_constrained: for each point, true when its coordinates are constrained (they are preferred).
    """
    orientation, origin = graph.orientations[station], graph.origins[station]
    if orientation == Orientation.BASC:
        return _orient_free(state, graph, station)
    if state.verticals[origin] is None:
        return False
    if orientation == Orientation.FIX:
        state.g0[station] = 0.0
        state.station_steps[station] = Step("local axes")
        return True
    return _orient_plumb(state, graph, station, is_constrained)


def _orient_plumb(state: State, graph: Graph, station: int, is_constrained: list[bool]) -> bool:
    """G0 from the first reading to a constrained point, else to any located point (MMVII: the first)."""
    usable = []
    for number in graph.sights_from[station]:
        sight = graph.sights[number]
        if state.verticals[sight.target] is None or sight.reading() is None:
            continue
        usable.append(sight)
        if is_constrained[sight.target]:
            usable[0] = sight
            break
    return bool(usable) and _take_azimuth(state, usable[0])


def _take_azimuth(state: State, sight: Sight) -> bool:
    reading = sight.reading()
    offset = minus(state.known(sight.target), state.known(sight.origin))
    east, north, up = times(state.vertical_of(sight.origin), offset)
    if reading is None or math.hypot(east, north) <= 1e-6 * abs(up) + 1e-9:
        return False
    state.g0[sight.station] = wrap(math.atan2(east, north) - reading[0])
    state.station_steps[sight.station] = Step("azimuth of a known point", reading[1])
    return True


@dataclass(frozen=True)
class _Pairs:
    """Targets known in the frame and their vectors in the instrument."""

    ground: FloatArray
    seen: FloatArray
    rows: tuple[int, ...]


def _orient_free(state: State, graph: Graph, station: int) -> bool:
    """Rotation (and position) from three vectors, or from two directions when the origin is known."""
    vectors = _pairs(state, graph, station, complete=True)
    origin = graph.origins[station]
    if len(vectors.ground) >= 3 and _fit_isometry(state, station, origin, vectors):
        return True
    if not state.is_placed(origin):
        return False
    directions = _pairs(state, graph, station, complete=False)
    offsets = directions.ground - np.array(state.known(origin))
    lengths = np.linalg.norm(offsets, axis=1)
    kept = lengths > 0.0
    if np.count_nonzero(kept) < 2:
        return False
    rotation = best_rotation(directions.seen[kept], offsets[kept] / lengths[kept, None])
    return rotation is not None and _take_rotation(
        state, station, rotation, Step("known directions", directions.rows)
    )


def _pairs(state: State, graph: Graph, station: int, *, complete: bool) -> _Pairs:
    """Pairs with placed targets: vectors with their length, or all directions as unit vectors."""
    ground: list[Space] = []
    seen: list[Space] = []
    rows: list[int] = []
    for number in graph.sights_from[station]:
        sight = graph.sights[number]
        found = free_direction(sight) if state.is_placed(sight.target) else None
        if found is None or (complete and not found[1]):
            continue
        ground.append(state.known(sight.target))
        seen.append(found[0][0])
        rows.extend(found[0][1])
    vectors = np.array(seen, np.float64).reshape(-1, 3)
    if not complete:
        vectors /= np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None]
    return _Pairs(np.array(ground, np.float64).reshape(-1, 3), vectors, tuple(rows))


def _fit_isometry(state: State, station: int, origin: int, pairs: _Pairs) -> bool:
    """Least-squares isometry instrument -> frame; gives the position of the origin if it has none."""
    ground_centre, seen_centre = pairs.ground.mean(axis=0), pairs.seen.mean(axis=0)
    rotation = best_rotation(pairs.seen - seen_centre, pairs.ground - ground_centre)
    if rotation is None:
        return False
    if not state.is_placed(origin):
        position = ground_centre - rotation @ seen_centre
        state.positions[origin] = (float(position[0]), float(position[1]), float(position[2]))
        state.has_height[origin] = 1
        state.point_steps[origin] = Step("isometry on three or more points", pairs.rows)
    return _take_rotation(state, station, rotation, Step("isometry on three or more points", pairs.rows))


def best_rotation(local: FloatArray, world: FloatArray) -> FloatArray | None:
    """The rotation R that makes R local_i closest to world_i (Kabsch); None when all are on one line.

    Args:
        local: (n, 3) vectors.
        world: (n, 3) vectors.
    """
    left, singular, right = np.linalg.svd(world.T @ local)
    if not singular[1] > _LEAST_SPREAD**2 * singular[0]:
        return None
    sign = 1.0 if np.linalg.det(left @ right) > 0.0 else -1.0
    return np.asarray(left @ np.diag([1.0, 1.0, sign]) @ right, dtype=np.float64)


def _take_rotation(state: State, station: int, rotation: FloatArray, step: Step) -> bool:
    state.rotations[station] = as_matrix(rotation)
    state.station_steps[station] = step
    return True


def plumb_rotation(vertical: FloatArray, g0: FloatArray) -> FloatArray:
    """Rotations instrument -> frame of plumb stations: (Rz(g0) R_(frame -> vertical))^T.

    Args:
        vertical: (m, 3, 3) R_(frame -> vertical) at the origins.
        g0: (m,) azimuths of the zeros of the circles, radians.
    """
    cosine, sine = np.cos(g0), np.sin(g0)
    turn = np.zeros((len(g0), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1] = cosine, -sine
    turn[:, 1, 0], turn[:, 1, 1] = sine, cosine
    turn[:, 2, 2] = 1.0
    return np.transpose(turn @ vertical, (0, 2, 1))


def g0_of(rotation: Matrix, vertical: Matrix) -> float:
    """G0 of a rotation instrument -> frame: read from R_(vertical -> instrument), as MMVII reads it."""
    to_instrument = np.array(rotation).T @ np.array(vertical).T
    return math.atan2(float(to_instrument[1, 0]), float(to_instrument[0, 0]))
