"""Carries orientation from station to station, as a traverse does, the surest link first.

Where a network closes on itself, two points placed along different paths disagree by the drift of both paths.
A station oriented on such a pair would pass the disagreement on, larger at each step. So a plumb station is
linked to an oriented one by the raw observations that both made: of each other, and of common targets. The
drift then grows slowly and never feeds itself. Azimuths between known points are links too.
"""

from __future__ import annotations

import heapq
import itertools
import math
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from obseq.survey.initial.closed_forms import wrap
from obseq.survey.initial.known import Step, minus, plus, times, transposed_times
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.survey.initial.closed_forms import Space
    from obseq.survey.initial.known import Known
    from obseq.survey.initial.sights import Sight, SightGraph

_MOST_STATIONS = 50
"""Stations that are linked through one common target."""
_DRIFT = 3.0
"""Spreads of points that were not given are enlarged by this factor: their errors are not independent."""


class Link(NamedTuple):
    """A way to orient a plumb station.

    `origin` and `targets` are the station and its targets where the oriented station sees them (frame); the
    origin is None when its known position is used.
    """

    origin: Space | None
    targets: tuple[tuple[int, Space], ...]
    azimuth_sigma: float
    relative_sigma: float
    parent: int | None
    method: str
    rows: tuple[int, ...]


class _Shared(NamedTuple):
    """One target of two stations: seen from the oriented one (local east, north, up), and by the other."""

    point: int
    seen: Space
    relative_sigma: float
    sight: Sight


class _Way(NamedTuple):
    """How an oriented station sees another: where (local east, north, up), and what gives its azimuth."""

    position: Space
    relative_sigma: float
    shared: list[_Shared]
    azimuth_sigma: float
    method: str


def in_frame(known: Known, sight: Sight, local: Space) -> Space:
    """A vector of an oriented instrument on a located point, in the frame."""
    rotation = known.rotations[sight.station]
    if rotation is not None:
        return times(rotation, local)
    return transposed_times(known.vertical_of(sight.origin), turned(local, known.g0[sight.station] or 0.0))


def turned(vector: Space, g0: float) -> Space:
    """A vector of a plumb instrument in local east, north, up."""
    (x, y, z), cosine, sine = vector, math.cos(g0), math.sin(g0)
    return x * cosine + y * sine, y * cosine - x * sine, z


def vector_sigma(graph: SightGraph, vector: Space, rows: tuple[int, ...]) -> float:
    """Expected error (m) of a vector from the sigmas of its observations."""
    length = math.hypot(*vector)
    return math.hypot(*(graph.sigmas[row] * (length if graph.is_angle[row] else 1.0) for row in rows))


class Traverse:
    """The queue of links; the surest comes out first.

    Args:
        known: what is known; it is not changed here.
        graph: the observations.
        stations: the stations that may be used; all when None.
    """

    def __init__(self, known: Known, graph: SightGraph, stations: frozenset[int] | None) -> None:
        self.known, self.graph = known, graph
        self.stations = stations
        self.surest: dict[int, float] = {}
        self.queue: list[tuple[float, int, int, Callable[[], Link]]] = []
        self.count = itertools.count()

    def next(self, limit: float) -> tuple[int, Link] | None:
        """The surest link to a station that is not oriented; None when none is as sure as the limit (rad)."""
        while self.queue and self.queue[0][0] <= limit:
            _, station, _, make = heapq.heappop(self.queue)
            if self.known.station_steps[station] is None:
                return station, make()
        return None

    def _is_surest(self, station: int, azimuth_sigma: float) -> bool:
        """Whether a link is surer than those before it; one that is not never has its turn."""
        return azimuth_sigma < self.surest.get(station, math.inf)

    def _push(self, station: int, azimuth_sigma: float, make: Callable[[], Link]) -> None:
        """Adds the surest link of a station; links are made only when it is their turn."""
        self.surest[station] = azimuth_sigma
        heapq.heappush(self.queue, (azimuth_sigma, station, next(self.count), make))

    def _is_open(self, station: int) -> bool:
        return self._may_link(station) and self.known.station_steps[station] is None

    def _may_link(self, station: int) -> bool:
        is_plumb = self.graph.orientations[station] == Orientation.VERT
        return is_plumb and (self.stations is None or station in self.stations)

    def add_azimuths(self, station: int, numbers: list[int]) -> None:
        """Links of a station on a located point by the azimuths of some of its sights, to located targets."""
        origin, verticals, sights = self.graph.origins[station], self.known.verticals, self.graph.sights
        if verticals[origin] is None or not self._is_open(station):
            return
        origin_sigma = _honest_sigma(self.known, origin)
        for number in numbers:
            sight = sights[number]
            if verticals[sight.target] is not None:
                self._add_azimuth(sight, origin_sigma)

    def _add_azimuth(self, sight: Sight, origin_sigma: float) -> None:
        known, reading = self.known, sight.reading()
        target = known.position_of(sight.target)
        distance = _flat_distance(known, sight.origin, target)
        if reading is None or distance == 0.0:
            return
        moved = math.hypot(origin_sigma, _honest_sigma(known, sight.target))
        azimuth_sigma = min(math.hypot(moved / distance, reading_sigma(self.graph, sight, distance)), math.pi)
        if self._is_surest(sight.station, azimuth_sigma):
            link = partial(_azimuth_link, sight.target, target, azimuth_sigma, reading[1])
            self._push(sight.station, azimuth_sigma, link)

    def add_neighbours(self, station: int) -> None:
        """Links from a station that has just been oriented and placed."""
        seen = self._seen_from(station)
        sights, steps, least = self.graph.sights, self.known.station_steps, self.known.azimuth_sigmas[station]
        may_link, surest = self._may_link, self.surest.get
        found: dict[int, list[_Shared]] = {}
        for point, (vector, relative_sigma) in seen.items():
            for number in self.graph.sights_to[point][:_MOST_STATIONS]:
                other = (sight := sights[number]).station
                is_open = steps[other] is None and other != station and may_link(other)
                if is_open and least < surest(other, math.inf):
                    found.setdefault(other, []).append(_Shared(point, vector, relative_sigma, sight))
        for other, shared in found.items():
            self._add_link(station, other, seen, shared)

    def _seen_from(self, station: int) -> dict[int, tuple[Space, float]]:
        """Local east, north, up of the origin and of the targets with a complete vector, with their sigma."""
        origin, rotation = self.graph.origins[station], self.known.rotations[station]
        vertical, g0 = self.known.vertical_of(origin), self.known.g0[station] or 0.0
        seen: dict[int, tuple[Space, float]] = {origin: ((0.0, 0.0, 0.0), 0.0)}
        for number in self.graph.sights_from[station]:
            sight = self.graph.sights[number]
            if (vector := sight.vector()) is not None:
                local = turned(vector[0], g0)
                if rotation is not None:
                    local = times(vertical, times(rotation, vector[0]))
                seen[sight.target] = local, sight.vector_sigma
        return seen

    def _add_link(
        self, station: int, other: int, seen: dict[int, tuple[Space, float]], shared: list[_Shared]
    ) -> None:
        origin = self.graph.origins[other]
        found = self._by_sight(seen[origin], shared) if origin in seen else None
        found = found or self._by_two_targets(shared)
        if found is not None:
            total = math.hypot(self.known.azimuth_sigmas[station], found.azimuth_sigma)
            if self._is_surest(other, total):
                self._push(other, total, partial(self._link, station, found, total))

    def _by_sight(self, origin: tuple[Space, float], shared: list[_Shared]) -> _Way | None:
        """The oriented station sees the other; a common target, or the sight back, gives the azimuth."""
        position, relative_sigma = origin
        best: tuple[float, _Shared] | None = None
        for item in shared:
            distance = math.dist(position[:2], item.seen[:2])
            if distance > 0.0 and item.sight.reading() is not None:
                sigma = reading_sigma(self.graph, item.sight, distance)
                azimuth_sigma = math.hypot(math.hypot(relative_sigma, item.relative_sigma) / distance, sigma)
                if best is None or azimuth_sigma < best[0]:
                    best = (azimuth_sigma, item)
        if best is None:
            return None
        return _Way(position, relative_sigma, [best[1]], best[0], "azimuth and distance")

    def _by_two_targets(self, shared: list[_Shared]) -> _Way | None:
        """Free station on two common targets that are far apart."""
        complete = [(item, vector[0]) for item in shared if (vector := item.sight.vector()) is not None]
        if len(complete) < 2:
            return None
        b, own_b = _farthest(complete, complete[0][0].seen)
        a, own_a = _farthest(complete, b.seen)
        base, own_base = math.dist(a.seen[:2], b.seen[:2]), math.dist(own_a[:2], own_b[:2])
        relative_sigma = math.hypot(
            a.relative_sigma, b.relative_sigma, a.sight.vector_sigma, b.sight.vector_sigma
        )
        if base <= 0.0 or own_base <= 0.0 or abs(base - own_base) > 0.02 * base + 5.0 * relative_sigma:
            return None
        g0 = _azimuth(a.seen, b.seen) - _azimuth(own_a, own_b)
        ends = minus(a.seen, turned(own_a, g0)), minus(b.seen, turned(own_b, g0))
        middle = tuple((p + q) / 2.0 for p, q in zip(ends[0], ends[1], strict=True))
        position = (middle[0], middle[1], middle[2])
        azimuth_sigma = relative_sigma / base
        away = math.dist(position[:2], ((a.seen[0] + b.seen[0]) / 2.0, (a.seen[1] + b.seen[1]) / 2.0))
        return _Way(
            position,
            math.hypot(relative_sigma, azimuth_sigma * away),
            [a, b],
            azimuth_sigma,
            "free station",
        )

    def _link(self, station: int, way: _Way, total: float) -> Link:
        """A link whose local positions are put in the frame."""
        start = self.known.position_of(self.graph.origins[station])
        vertical = self.known.vertical_of(self.graph.origins[station])
        targets = tuple(
            (item.point, plus(start, transposed_times(vertical, item.seen))) for item in way.shared
        )
        rows: list[int] = []
        for item in way.shared:
            both = [item.sight]
            if (station, item.point) in self.graph.sight_of:
                both.append(self.graph.sights[self.graph.sight_of[station, item.point]])
            for sight in both:
                rows.extend((sight.vector() or sight.reading() or ((), ()))[1])
        origin = plus(start, transposed_times(vertical, way.position))
        return Link(
            origin, targets, total, way.relative_sigma, station, way.method, tuple(dict.fromkeys(rows))
        )


def _azimuth_link(point: int, position: Space, azimuth_sigma: float, rows: tuple[int, ...]) -> Link:
    return Link(None, ((point, position),), azimuth_sigma, 0.0, None, "azimuth of a known point", rows)


def _farthest(complete: list[tuple[_Shared, Space]], place: Space) -> tuple[_Shared, Space]:
    """The one of some targets, with their own vectors, that is horizontally farthest from a place."""
    x, y, _ = place
    away = [(item.seen[0] - x) ** 2 + (item.seen[1] - y) ** 2 for item, _ in complete]
    return complete[away.index(max(away))]


def link_g0(known: Known, graph: SightGraph, station: int, link: Link) -> float:
    """G0 of a station by a link, once the vertical of its origin is known."""
    origin = graph.origins[station]
    start = known.position_of(origin) if link.origin is None else link.origin
    angles = []
    for point, position in link.targets:
        reading = graph.sights[graph.sight_of[station, point]].reading()
        if reading is not None:
            east, north, _ = times(known.vertical_of(origin), minus(position, start))
            angles.append(math.atan2(east, north) - reading[0])
    return wrap(angles[0] + sum(wrap(angle - angles[0]) for angle in angles) / len(angles))


def link_rise(known: Known, graph: SightGraph, station: int, link: Link) -> float:
    """How much too low a free station is, from its own rises to the common targets and its own vertical."""
    origin = graph.origins[station]
    rises = []
    for point, position in link.targets:
        vector = graph.sights[graph.sight_of[station, point]].vector()
        if vector is not None:
            computed = times(known.vertical_of(origin), minus(position, known.position_of(origin)))[2]
            rises.append(computed - vector[0][2])
    return sum(rises) / len(rises)


def reading_sigma(graph: SightGraph, sight: Sight, distance: float) -> float:
    """Sigma of a reading (rad), also of one made from DX and DY."""
    if sight.hz is not None:
        return graph.sigmas[sight.hz[1]]
    return max((graph.sigmas[m[1]] for m in (sight.dx, sight.dy) if m is not None), default=0.0) / distance


def _azimuth(a: Space, b: Space) -> float:
    return math.atan2(b[0] - a[0], b[1] - a[1])


def _flat_distance(known: Known, origin: int, target: Space) -> float:
    """Horizontal distance to a target, 0 when it is on the vertical."""
    (a, b, c), (d, e, f), (g, h, i) = known.vertical_of(origin)
    px, py, pz = known.position_of(origin)
    x, y, z = target[0] - px, target[1] - py, target[2] - pz
    up = g * x + h * y + i * z
    distance = math.hypot(a * x + b * y + c * z, d * x + e * y + f * z)
    return distance if distance > 1e-6 * abs(up) + 1e-9 else 0.0


def _honest_sigma(known: Known, point: int) -> float:
    step: Step | None = known.point_steps[point]
    is_given = step is not None and step.method == "given"
    return known.point_sigmas[point] * (1.0 if is_given else _DRIFT)
