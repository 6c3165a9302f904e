"""Carries orientation from station to station, as a traverse does, the surest link first.

Where a network closes on itself, two points placed along different paths disagree by the drift of both paths.
A station oriented on such a pair would pass the disagreement on, larger at each step. So a plumb station is
linked to an oriented one by the raw observations that both made: of each other, and of common targets. The
drift then grows slowly and never feeds itself. Where these have no lengths, the readings there and back
link a station that is placed. Azimuths between known points are links too.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from obseq.survey.initial.closed_forms import Space, minus, plus, wrap
from obseq.survey.initial.known import Known, times, transposed_times, turned
from obseq.survey.model import Orientation
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import GIVEN, Cause, Step
from obseq.survey.sights.ways import PlumbWays, Views, Ways, find_ways

_DRIFT = 3.0
"""Spreads of points that were not given are enlarged by this factor: their errors are not independent."""


class Link(NamedTuple):
    """A way to orient a plumb station.

    `origin` is the station where the oriented station sees it (frame), None when its known position is used;
    `targets` are sights of the station, with their targets where the oriented station sees these.
    """

    origin: Space | None
    targets: tuple[tuple[int, Space], ...]
    azimuth_sigma: float
    relative_sigma: float
    parent: int | None
    cause: Cause


class Traverse:
    """The queue of links; the surest comes out first.

    Args:
        known: what is known; it is not changed here.
        graph: the observations.
        ways: between its stations.
        stations: the stations that may be used; all when None.
    """

    def __init__(
        self, known: Known, graph: SightGraph, ways: PlumbWays, stations: frozenset[int] | None
    ) -> None:
        self.known, self.graph, self.plumb_ways = known, graph, ways
        self.stations = stations
        self.surest = [math.inf] * len(graph.origins)
        self.first_open = 0
        self.queue: list[tuple[float, int, int, Callable[..., Link], tuple[object, ...]]] = []
        self.count = itertools.count()

    def next(self, limit: float) -> tuple[int, Link] | None:
        """The surest link to a station that is not oriented; None when none is as sure as the limit (rad)."""
        while self.queue and self.queue[0][0] <= limit:
            azimuth_sigma, station, _, make, arguments = heapq.heappop(self.queue)
            if self.known.station_steps[station] is None:
                return station, make(self, azimuth_sigma, *arguments)
        return None

    def _push(
        self, station: int, azimuth_sigma: float, make: Callable[..., Link], *arguments: object
    ) -> None:
        """Adds the surest link of a station; links are made only when it is their turn."""
        self.surest[station] = azimuth_sigma
        heapq.heappush(self.queue, (azimuth_sigma, station, next(self.count), make, arguments))

    def _is_open(self, station: int) -> bool:
        is_plumb = self.graph.orientations[station] == Orientation.VERT.value
        is_open = is_plumb and self.known.station_steps[station] is None
        return is_open and (self.stations is None or station in self.stations)

    def add_azimuths(self, station: int, numbers: Iterable[int]) -> None:
        """Links of an open plumb station on a located point by its azimuths of located targets."""
        known, target_of = self.known, self.graph.target_of
        origin = self.graph.origins[station]
        is_settled, positions, start = known.is_settled, known.positions, known.positions[origin]
        if not is_settled[origin] or start is None:
            return
        origin_sigma = _honest_sigma(known, origin)
        for number in numbers:
            target = target_of[number]
            position = positions[target]
            if is_settled[target] and position is not None:
                for other in self.graph.stations_at[target]:
                    self._add_back(station, number, other, self.graph.sight_between(other, origin))
                moved = math.hypot(origin_sigma, _honest_sigma(known, target))
                # what is not surer in space is not surer along the horizon, which is shorter
                if moved < self.surest[station] * math.dist(start, position):
                    self._add_azimuth(station, number, position, moved)

    def _add_azimuth(self, station: int, number: int, position: Space, moved: float) -> None:
        graph, surest = self.graph, self.surest[station]
        distance = _flat_distance(self.known, graph.origins[station], position)
        if math.isnan(graph.reading_of[number]) or distance == 0.0:
            return
        azimuth_sigma = _azimuth_sigma(graph, number, moved, distance)
        if azimuth_sigma < surest:
            self._push(station, azimuth_sigma, Traverse._azimuth_link, number, position)

    def _azimuth_link(self, azimuth_sigma: float, number: int, position: Space) -> Link:
        step = Step("azimuth of a known point", self.graph.reading_rows(number))
        return Link(None, ((number, position),), azimuth_sigma, 0.0, None, step)

    def _add_back(self, station: int, number: int | None, other: int, back: int | None) -> None:
        """Links an open station that is placed to one that is oriented, by their readings of each other."""
        known, graph = self.known, self.graph
        if number is None or back is None or known.g0[other] is None or known.rotations[other] is not None:
            return
        distance = math.dist(*(known.position_of(graph.origins[k]) for k in (station, other)))
        if distance > 0.0 and not math.isnan(graph.reading_of[number] + graph.reading_of[back]):
            read = (graph.reading_sigma(k, distance) for k in (number, back))
            azimuth_sigma = math.hypot(known.azimuth_sigmas[other], *read)
            if azimuth_sigma < self.surest[station]:
                self._push(station, azimuth_sigma, Traverse._link_back, number, back)

    def _link_back(self, azimuth_sigma: float, number: int, back: int) -> Link:
        graph, other = self.graph, self.graph.station_of[back]
        reading, there = graph.reading_of[back], self.known.position_of(graph.origins[other])
        origin = self._in_frame(other, (math.sin(reading), math.cos(reading), 0.0))
        rows = (*graph.reading_rows(back), *graph.reading_rows(number))
        step = Step("readings there and back", rows)
        return Link(origin, ((number, there),), azimuth_sigma, 0.0, None, step)

    def add_neighbours(self, station: int) -> None:
        """Links from a station that has just been oriented and placed."""
        if not self._is_one_open():
            return
        graph, is_settled = self.graph, self.known.is_settled
        for number in graph.sights_from[station]:
            for other in graph.stations_at[graph.target_of[number]]:
                if is_settled[graph.origins[other]] and self._is_open(other):
                    self._add_back(other, graph.sight_between(other, graph.origins[station]), station, number)
        ways, least = self._ways(station), self.known.azimuth_sigmas[station]
        mine, steps, surest = ways.of(station), self.known.station_steps, self.surest
        columns = ways.others[mine].tolist(), ways.azimuth_sigmas[mine].tolist()
        for way, (other, azimuth_sigma) in enumerate(zip(*columns, strict=True), mine.start):
            if steps[other] is None and (self.stations is None or other in self.stations):
                total = math.hypot(least, azimuth_sigma)
                if total < surest[other]:
                    self._push(other, total, Traverse._link, station, ways, way)

    def _is_one_open(self) -> bool:
        """Whether there is a station that links may still orient."""
        while self.first_open < len(self.surest) and not self._is_open(self.first_open):
            self.first_open += 1
        return self.first_open < len(self.surest)

    def _ways(self, station: int) -> Ways:
        """Ways from a station; those of a #BASC station once it is turned."""
        rotation = self.known.rotations[station]
        if rotation is None:
            return self.plumb_ways.of(station)
        vertical = np.array(self.known.vertical_of(self.graph.origins[station]))
        return find_ways(self.graph, Views.of(self.graph, [station]).turned(vertical @ np.array(rotation)))

    def _link(self, azimuth_sigma: float, station: int, ways: Ways, way: int) -> Link:
        """A link by a way, in the frame."""
        targets, cause = [], []
        for number, view in zip(ways.sights[way].tolist(), ways.seen[way].tolist(), strict=True):
            if number >= 0:
                targets.append((number, self._in_frame(station, ways.views.vectors[view].tolist())))
                cause += [number, ways.views.numbers.item(view)]
        return Link(
            self._in_frame(station, ways.positions[way].tolist()),
            tuple(targets),
            azimuth_sigma,
            ways.relative_sigmas.item(way),
            station,
            tuple(number for number in cause if number >= 0),
        )

    def _in_frame(self, station: int, vector: Space) -> Space:
        """Where something is that a station sees in plumb axes."""
        origin = self.graph.origins[station]
        local = turned(vector, self.known.g0[station] or 0.0)
        return plus(self.known.position_of(origin), transposed_times(self.known.vertical_of(origin), local))


def link_g0(known: Known, graph: SightGraph, station: int, link: Link) -> float:
    """G0 of a station by a link, once the vertical of its origin is known."""
    origin = graph.origins[station]
    vertical = known.vertical_of(origin)
    start = known.position_of(origin) if link.origin is None else link.origin
    angles = []
    for number, position in link.targets:
        east, north, _ = times(vertical, minus(position, start))
        angles.append(math.atan2(east, north) - graph.reading_of[number])
    return wrap(angles[0] + sum(wrap(angle - angles[0]) for angle in angles) / len(angles))


def link_rise(known: Known, graph: SightGraph, station: int, link: Link) -> float:
    """How much too low a free station is, from its own rises to the common targets and its own vertical."""
    origin = graph.origins[station]
    vertical, start = known.vertical_of(origin), known.position_of(origin)
    rises = [
        times(vertical, minus(position, start))[2] - float(graph.sights.vectors[number, 2])
        for number, position in link.targets
    ]
    return sum(rises) / len(rises)


def _azimuth_sigma(graph: SightGraph, number: int, moved: float, distance: float) -> float:
    """Expected error (rad) of G0 by the azimuth of a sight, over a distance between doubtful points."""
    if distance == 0.0:
        return math.pi
    return min(math.hypot(moved / distance, graph.reading_sigma(number, distance)), math.pi)


def _flat_distance(known: Known, origin: int, target: Space) -> float:
    """Horizontal distance to a target, 0 when it is on the vertical."""
    (a, b, c), (d, e, f), (g, h, i) = known.vertical_of(origin)
    px, py, pz = known.position_of(origin)
    x, y, z = target[0] - px, target[1] - py, target[2] - pz
    up = g * x + h * y + i * z
    distance = math.hypot(a * x + b * y + c * z, d * x + e * y + f * z)
    return distance if distance > 1e-6 * abs(up) + 1e-9 else 0.0


def _honest_sigma(known: Known, point: int) -> float:
    return known.point_sigmas[point] * (1.0 if known.point_steps[point] is GIVEN else _DRIFT)
