"""What the observations say about one point, once its neighbours are known."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence

from obseq.dataclass import dataclass
from obseq.survey.initial.closed_forms import TURN, Space, minus, scaled, wrap
from obseq.survey.initial.known import Known, Matrix, times, transposed_times
from obseq.survey.model import Orientation
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import Sight, direction

_LOSS_SCALE = 0.005
"""Relative misfit (rad, or metres per metre) beyond which a relation speaks against a position."""


_ON_VERTICAL = 1e-6
"""Horizontal distance (m) below which derivatives are those a little aside: a cone has none at its tip."""
_SIGMA_OF_GIVEN = 1e-4
"""Sigma (m) of a height that the file gives."""


class Measured(enum.IntEnum):
    """What is constrained; `..._AT` was measured at the point, the others at the known point."""

    AZIMUTH = 0
    ZENITH = 1
    DISTANCE = 2
    LEVEL = 3
    READING_AT = 4
    ZENITH_AT = 5
    HORIZONTAL = 6
    HORIZONTAL_AT = 7
    RISE = 8
    RISE_AT = 9
    EAST = 10
    NORTH = 11


# made once: `misfit` is the innermost function of all this, and to look a member up takes longer than a sine
_LEVEL, _DISTANCE, _AZIMUTH, _EAST = Measured.LEVEL, Measured.DISTANCE, Measured.AZIMUTH, Measured.EAST
READING_AT = Measured.READING_AT
_BEARINGS = frozenset((Measured.AZIMUTH, Measured.READING_AT))
_AT = frozenset((Measured.READING_AT, Measured.ZENITH_AT, Measured.HORIZONTAL_AT, Measured.RISE_AT))
_ZENITHS = frozenset((Measured.ZENITH, Measured.ZENITH_AT))
_PLUMB = frozenset((Measured.EAST, Measured.NORTH))
_RISES = frozenset((Measured.RISE, Measured.RISE_AT))
ANGLES = frozenset((Measured.AZIMUTH, Measured.ZENITH, Measured.READING_AT, Measured.ZENITH_AT))


@dataclass(slots=True)
class Relation:
    """One relation between the point looked for and a known point `other`.

    `value` is in metres or radians; for LEVEL it is the height of the point. Readings (READING_AT) of one
    `station` share one unknown G0, unless `g0` is known. A height that the file gives has no `rows`.
    `lift` is how much higher the target of a zenith angle or a rise is above its ground than the instrument.
    """

    kind: Measured
    other: int
    value: float
    rows: tuple[int, ...]
    station: int = -1
    g0: float | None = None
    lift: float = 0.0

    def sigma(self, sigmas: Sequence[float]) -> float:
        """The largest of the sigmas (m, rad) of its observations."""
        return max((sigmas[row] for row in self.rows), default=_SIGMA_OF_GIVEN)


def collect(
    known: Known, graph: SightGraph, point: int, stations: frozenset[int] | None = None
) -> list[Relation]:
    """All relations that known points put on a point, in a fixed order.

    Args:
        known: known points and oriented stations.
        graph: the observations.
        point: the point looked for.
        stations: the only stations that may be used; all when left out.
    """
    found: list[Relation] = []
    for number in graph.sights_to[point]:
        is_usable = stations is None or graph.station_of[number] in stations
        if is_usable and known.is_settled[graph.origin_of[number]]:
            _add_sight_to(known, graph, graph.sights[number], found)
    for station in graph.stations_at[point]:
        if graph.orientations[station] == Orientation.BASC.value or (stations and station not in stations):
            continue
        for number in graph.sights_from[station]:
            if known.is_settled[graph.target_of[number]]:
                _add_sight_at(known, graph, graph.sights[number], found)
    for other, distance, row in graph.distances[point]:
        if known.is_placed(other):
            found.append(Relation(Measured.DISTANCE, other, distance, (row,)))
    for other, distance, row in graph.flat_distances[point]:
        if known.is_settled[other]:
            found.append(Relation(Measured.HORIZONTAL, other, distance, (row,)))
    given = known.given_heights.get(point)
    if given is not None and known.reference is not None:
        found.append(Relation(Measured.LEVEL, known.reference, given - known.reference_height, ()))
    elif point in known.level and known.reference is not None:
        found.append(Relation(Measured.LEVEL, known.reference, 0.0, ()))
    for other, difference, row in graph.height_differences[point]:
        height = known.height(other)
        if height is not None:
            found.append(Relation(Measured.LEVEL, other, height + difference, (row,)))
    return found


def _add_sight_to(known: Known, graph: SightGraph, sight: Sight, found: list[Relation]) -> None:
    """Measures made at a known point."""
    if graph.orientations[sight.station] == Orientation.BASC.value:
        _add_free_sight(known, sight, found)
        return
    g0, reading = known.g0[sight.station], sight.reading()
    if g0 is not None and reading is not None:
        found.append(Relation(Measured.AZIMUTH, sight.origin, wrap(g0 + reading[0]), reading[1]))
    _add_lengths(known, sight, sight.origin, (Measured.ZENITH, Measured.HORIZONTAL, Measured.RISE), found)


def _add_sight_at(known: Known, graph: SightGraph, sight: Sight, found: list[Relation]) -> None:
    """Measures made at the point itself."""
    reading = sight.reading()
    if reading is not None:
        g0 = 0.0 if graph.orientations[sight.station] == Orientation.FIX.value else None
        found.append(Relation(Measured.READING_AT, sight.target, *reading, sight.station, g0))
    _add_lengths(
        known,
        sight,
        sight.target,
        (Measured.ZENITH_AT, Measured.HORIZONTAL_AT, Measured.RISE_AT),
        found,
    )


def _add_lengths(
    known: Known,
    sight: Sight,
    other: int,
    kinds: tuple[Measured, Measured, Measured],
    found: list[Relation],
) -> None:
    """Zenith angle, DX with DY, and DZ of a plumb instrument."""
    if sight.zenith is not None and known.is_placed(other):
        found.append(Relation(kinds[0], other, sight.zenith[0], (sight.zenith[1],), lift=sight.lift))
    if sight.dx is not None and sight.dy is not None:
        length, rows = math.hypot(sight.dx[0], sight.dy[0]), (sight.dx[1], sight.dy[1])
        plumb = (
            (Measured.EAST, Measured.NORTH) if length == 0.0 else (kinds[1],)
        )  # a circle of no radius is a point
        found.extend(Relation(kind, other, length, rows) for kind in plumb)
    if sight.dz is not None and known.is_placed(other):
        found.append(Relation(kinds[2], other, sight.dz[0], (sight.dz[1],), lift=sight.lift))


def _add_free_sight(known: Known, sight: Sight, found: list[Relation]) -> None:
    """Measures of an oriented #BASC station, turned into azimuth, zenith angle and lengths at its origin."""
    rotation, vector = known.rotations[sight.station], free_direction(sight)
    if rotation is None or vector is None or not known.is_placed(sight.origin):
        return
    (local, rows), is_complete = vector
    east, north, up = times(known.vertical_of(sight.origin), times(rotation, local))
    flat = math.hypot(east, north)
    found.append(Relation(Measured.AZIMUTH, sight.origin, math.atan2(east, north), rows))
    if is_complete:
        found.append(Relation(Measured.HORIZONTAL, sight.origin, flat, rows))
        found.append(Relation(Measured.RISE, sight.origin, up, rows, lift=sight.lift))
    else:
        found.append(Relation(Measured.ZENITH, sight.origin, math.atan2(flat, up), rows, lift=sight.lift))


def free_direction(sight: Sight) -> tuple[tuple[Space, tuple[int, ...]], bool] | None:
    """Vector in the instrument, to the target, with its rows, and whether its length is real (else 1)."""
    if sight.vector is not None:
        (x, y, z), rows = sight.vector
        return ((x, y, z + sight.lift), rows), True
    if sight.hz is None or sight.zenith is None:
        return None
    return (direction(sight.hz[0], sight.zenith[0]), (sight.hz[1], sight.zenith[1])), False


def misfit(known: Known, relation: Relation, position: Space, vertical: Matrix, g0: float) -> float:
    """Computed - observed (rad or m) of one relation; `vertical` and `g0` are those at the position."""
    kind, other, value = relation.kind, relation.other, relation.value
    if kind == _LEVEL:
        return known.height_of(position, vertical) - value
    there = known.positions[other]
    assert there is not None
    if kind == _DISTANCE:
        return math.dist(position, there) - value
    x, y, z = position[0] - there[0], position[1] - there[1], position[2] - there[2]
    if kind in _AT:
        x, y, z, axes = -x, -y, -z, vertical
    else:
        axes = known.vertical_of(other)
    (a, b, c), (d, e, f), (g, h, i) = axes
    east, north = a * x + b * y + c * z, d * x + e * y + f * z
    if kind == _AZIMUTH:
        return math.remainder(math.atan2(east, north) - value, TURN)
    if kind == READING_AT:
        return math.remainder(math.atan2(east, north) - g0 - value, TURN)
    up = g * x + h * y + i * z + relation.lift
    if kind in _ZENITHS:
        return math.atan2(math.hypot(east, north), up) - value
    if kind in _PLUMB:
        return (east if kind == _EAST else north) - value
    return (up if kind in _RISES else math.hypot(east, north)) - value


def gradient(known: Known, relation: Relation, position: Space, vertical: Matrix) -> Space:
    """Derivatives (rad/m or m/m) of the misfit of one relation, by east, north and up at the position."""
    kind = relation.kind
    if kind == _LEVEL:
        return times(vertical, known.mean_up(vertical))
    offset = minus(position, known.position_of(relation.other))
    if kind == _DISTANCE:
        return scaled(times(vertical, offset), 1.0 / (math.hypot(*offset) or 1.0))
    if kind in _AT:
        return scaled(_local_gradient(relation, scaled(times(vertical, offset), -1.0)), -1.0)
    other = known.vertical_of(relation.other)
    local = _local_gradient(relation, times(other, offset))
    return local if other is vertical else times(vertical, transposed_times(other, local))


def _local_gradient(relation: Relation, seen: Space) -> Space:
    """Derivatives of a measure by the east, north and up of what is seen."""
    kind, (east, north, up) = relation.kind, seen
    if kind in _RISES:
        return 0.0, 0.0, 1.0
    if kind in _PLUMB:
        return (1.0, 0.0, 0.0) if kind == _EAST else (0.0, 1.0, 0.0)
    flat = math.hypot(east, north)
    if flat < _ON_VERTICAL:
        east = north = _ON_VERTICAL
        flat = math.hypot(east, north)
    if kind in _BEARINGS:
        return north / flat / flat, -east / flat / flat, 0.0
    if kind in _ZENITHS:
        up += relation.lift
        square = flat * flat + up * up
        return up * east / flat / square, up * north / flat / square, -flat / square
    return east / flat, north / flat, 0.0


def scaled_misfit(known: Known, relation: Relation, position: Space, vertical: Matrix, g0: float) -> float:
    """The misfit as an angle: lengths are divided by the distance to the known point."""
    size = misfit(known, relation, position, vertical, g0)
    if relation.kind in ANGLES:
        return size
    return size / distance_to(known, relation, position)


def distance_to(known: Known, relation: Relation, position: Space) -> float:
    """Distance to the known point; to the reference point when only the height of that point is known."""
    other = known.positions[relation.other]
    if other is None:
        other = known.position_of(known.reference or 0)
    return max(math.dist(position, other), 1e-3)


def station_g0s(
    known: Known, relations: Sequence[Relation], position: Space, vertical: Matrix
) -> dict[int, float]:
    """G0 of each station at the position: known, or from the first reading that no other contradicts."""
    differences: dict[int, list[float]] = {}
    for relation in relations:
        if relation.kind == READING_AT:
            angle = misfit(known, relation, position, vertical, 0.0)
            given = relation.g0
            differences.setdefault(relation.station, []).append(angle if given is None else given)
    return {station: central_angle(angles) for station, angles in differences.items()}


def central_angle(angles: list[float]) -> float:
    """The angle of a list that is nearest to the others (a median on the circle)."""
    if len(angles) <= 2:
        return angles[0]
    sample = angles[:9]
    return min(sample, key=lambda angle: sum([abs(math.remainder(other - angle, TURN)) for other in sample]))


def disagreement(known: Known, relations: Sequence[Relation], position: Space, vertical: Matrix) -> float:
    """How many relations speak against a position, counted softly; 0 for a perfect fit."""
    g0s = station_g0s(known, relations, position, vertical)
    total = 0.0
    for relation in relations:
        g0 = g0s.get(relation.station, 0.0)
        size = abs(scaled_misfit(known, relation, position, vertical, g0))
        total += size / (size + _LOSS_SCALE)
    return total
