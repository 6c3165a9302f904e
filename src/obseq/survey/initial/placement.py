"""Places points and orients stations, the surest first, until nothing more can be placed.

Work is driven by what is new: only points and stations next to a point just located, or to a station just
oriented, are looked at again. The time is therefore nearly proportional to the number of observations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from obseq.survey.initial.best_position import Choice, Fit, averaged, choose, choose_height
from obseq.survey.initial.known import Step, plus, transposed_times
from obseq.survey.initial.orienting import orient
from obseq.survey.initial.relations import collect, station_g0s
from obseq.survey.initial.traverse import (
    Link,
    Traverse,
    link_g0,
    link_rise,
    polar_vector,
    turned,
    vector_noise,
)
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.survey.initial.closed_forms import Space
    from obseq.survey.initial.known import State
    from obseq.survey.initial.sights import Graph, Sight

SOUND = 0.02
WEAK = 0.002
"""Least strengths of the geometry (see `constraints.Refined`): an intersection at about 2, and at 0.2 gon."""
_LARGEST_SPREAD = 1e6
_ALIKE = 2.0
"""Points whose expected errors differ by less than this factor are placed at the same time."""


@dataclass(frozen=True)
class Level:
    """What may be used at one stage.

    Attributes:
        spread: greatest expected error of a point (m).
        azimuth_spread: greatest expected error of G0 (rad).
        strength: least strength of the geometry.
        uses_hints: whether approximate positions may decide between two solutions.
    """

    spread: float
    azimuth_spread: float
    strength: float = SOUND
    uses_hints: bool = False


GOOD = (Level(0.3, 0.002),)
REST = (
    Level(3.0, 0.02, uses_hints=True),
    Level(math.inf, math.inf, uses_hints=True),
    Level(math.inf, math.inf, WEAK, uses_hints=True),
)


@dataclass(frozen=True)
class _Polar:
    """A vector (frame) from a station to a point, and its expected errors (m), alone and in all."""

    sight: Sight
    offset: Space
    rows: tuple[int, ...]
    noise: float
    spread: float


class Engine:
    """Works on a state until nothing more can be placed.

    Args:
        state: what is known at the start; it is completed.
        graph: the observations.
        hints: approximate positions, used only to decide between two solutions.
        stations: the stations that may be used; all when left out.
    """

    def __init__(
        self, state: State, graph: Graph, hints: dict[int, Space], stations: Iterable[int] | None = None
    ) -> None:
        self.state, self.graph, self.hints = state, graph, hints
        self.allowed = None if stations is None else frozenset(stations)
        self.traverse = Traverse(state, graph, self.allowed)
        self.dirty_polar: set[int] = set()
        self.dirty_geometry: set[int] = set()
        self.choices: dict[int, tuple[tuple[float, bool], Choice]] = {}
        self.touched_points: list[int] = []
        self.oriented: list[int] = []

    def start(self, located: Sequence[int]) -> None:
        """Begins with points whose position is known."""
        self._settle(list(located))

    def is_ambiguous(self, point: int) -> bool:
        """Whether several positions of a point fit its observations equally well."""
        cached = self.choices.get(point)
        return cached is not None and bool(cached[1].alternatives)

    def start_station(self, station: int) -> None:
        """Begins also with a station on a located point that the caller has oriented."""
        self._spread_orientation(station)

    def run(self, levels: Iterable[Level]) -> bool:
        """Places what these levels allow, in their order; true when something was placed or oriented."""
        done = False
        for level in levels:
            self.dirty_geometry.update(self.choices)
            while self._place_polar() or self._orient_next(level) or self._place_by_geometry(level):
                done = True
        return done

    def _orient_next(self, level: Level) -> bool:
        """Takes the surest link of the traverse."""
        found = self.traverse.next(level.azimuth_spread)
        if found is None:
            return False
        station, link = found
        origin = self.graph.origins[station]
        if self.state.verticals[origin] is None:
            self._place_by_link(station, origin, link)
        self.state.g0[station] = link_g0(self.state, self.graph, station, link)
        self.state.azimuth_spreads[station] = link.spread
        self.state.station_steps[station] = Step(link.method, link.rows)
        self._spread_orientation(station)
        return True

    def _place_by_link(self, station: int, origin: int, link: Link) -> None:
        """Places the origin of a station where its link puts it."""
        state = self.state
        state.positions[origin], state.has_height[origin] = link.origin, 1
        state.point_steps[origin] = Step(link.method, link.rows)
        state.noises[origin], state.parents[origin] = link.noise, link.parent
        if link.parent is not None:
            base = self.graph.origins[link.parent]
            distance = math.dist(state.known(base), state.known(origin))
            state.spreads[origin] = math.hypot(
                state.spreads[base] + distance * state.azimuth_spreads[link.parent], link.noise
            )
        self._settle([origin])
        if link.method == "free station":
            up = state.vertical_of(origin)[2]
            rise = link_rise(state, self.graph, station, link)
            x, y, z = state.known(origin)
            state.positions[origin] = (x + rise * up[0], y + rise * up[1], z + rise * up[2])

    def _place_polar(self) -> bool:
        """Places points at the end of complete vectors from oriented stations."""
        candidates, self.dirty_polar = sorted(self.dirty_polar), set()
        located = []
        for point in candidates:
            polar = None if self.state.is_placed(point) else self._best_polar(point)
            if polar is not None:
                self._take_polar(point, polar)
                located.append(point)
        self._settle(located)
        return bool(located)

    def _place_by_geometry(self, level: Level) -> bool:
        """Intersection, resection, trilateration...: the surest of the points that can be placed so."""
        candidates, self.dirty_geometry = sorted(self.dirty_geometry), set()
        found: list[tuple[int, Fit, float]] = []
        for point in candidates:
            if not self.state.is_placed(point):
                fit = self._choice(point, level).fit
                if fit is not None and self._spread_of(fit) <= level.spread and self._is_ripe(fit, level):
                    found.append((point, fit, self._spread_of(fit)))
        least = min((spread for _, _, spread in found), default=0.0)
        located = []
        for point, fit, spread in found:
            if spread <= _ALIKE * least:
                self._take_fit(point, self._averaged(point, fit))
                located.append(point)
            else:
                self.dirty_geometry.add(point)
        self._settle(located)
        return bool(located)

    def _spread_of(self, fit: Fit) -> float:
        base = min(self.state.spreads[constraint.other] for constraint in fit.candidate.used)
        return min(math.hypot(base, fit.refined.spread), _LARGEST_SPREAD)

    def _is_ripe(self, fit: Fit, level: Level) -> bool:
        """A horizontal position alone is taken only when nothing better comes."""
        return fit.candidate.has_height or level.uses_hints

    def _settle(self, located: list[int]) -> None:
        """Verticals of new points, then orientations, until no orientation places a further point."""
        while located:
            self.state.settle(located)
            self.touched_points.extend(located)
            for point in located:
                self._spread_height(point)
                self._touch_neighbours(point)
            located = self._orient_around(located)

    def _orient_around(self, located: list[int]) -> list[int]:
        """Orients stations at or towards new points; returns origins that this has placed."""
        placed = []
        new = set(located)
        for station in self._stations_around(located):
            origin = self.graph.origins[station]
            was_placed = self.state.is_placed(origin)
            if self.graph.orientations[station] == Orientation.VERT:
                self.traverse.add_azimuths(station, self._targets_of(station) if origin in new else new)
            elif orient(self.state, self.graph, station):
                if not was_placed and self.state.has_height[origin] and not self.state.is_placed(origin):
                    placed.append(origin)
                    self.state.settle([origin])
                self._spread_orientation(station)
        return sorted(set(placed))

    def _targets_of(self, station: int) -> set[int]:
        return {self.graph.sights[number].target for number in self.graph.sights_from[station]}

    def _stations_around(self, located: list[int]) -> list[int]:
        """Stations without orientation at or towards some points."""
        found: set[int] = set()
        for point in located:
            found.update(self.graph.stations_at[point])
            found.update(self.graph.sights[number].station for number in self.graph.sights_to[point])
        return sorted(s for s in found if self._may_use(s) and self.state.station_steps[s] is None)

    def _may_use(self, station: int) -> bool:
        return self.allowed is None or station in self.allowed

    def _spread_orientation(self, station: int) -> None:
        """Looks again at the targets of a station just oriented, and links its neighbours to it."""
        self.oriented.append(station)
        for target in self._targets_of(station):
            self._touch(target)
        if self.state.is_placed(self.graph.origins[station]):
            self.traverse.add_neighbours(station)

    def _touch(self, point: int) -> None:
        if not self.state.is_placed(point):
            self.dirty_polar.add(point)
            self.dirty_geometry.add(point)
            self.choices.pop(point, None)

    def _touch_neighbours(self, point: int) -> None:
        graph = self.graph
        self._touch(point)
        for station in graph.stations_at[point]:
            for target in self._targets_of(station):
                self._touch(target)
        for number in graph.sights_to[point]:
            self._touch(graph.sights[number].origin)
        for other, _, _ in (*graph.distances[point], *graph.flats[point]):
            self._touch(other)

    def _spread_height(self, point: int) -> None:
        """Carries heights along height differences, also to points without horizontal position."""
        waiting = [point]
        while waiting:
            known = waiting.pop()
            height = self.state.heights[known]
            if height is None:
                continue
            for other, above, _ in self.graph.height_differences[known]:
                self._touch(other)
                if self.state.heights[other] is None:
                    self.state.heights[other] = height - above
                    self.state.spreads[other] = self.state.spreads[known]
                    self.touched_points.append(other)
                    waiting.append(other)

    def _best_polar(self, point: int) -> _Polar | None:
        """The complete vector with the least expected error."""
        best: _Polar | None = None
        for number in self.graph.sights_to[point]:
            sight = self.graph.sights[number]
            is_oriented = self.state.station_steps[sight.station] is not None
            if is_oriented and self._may_use(sight.station) and self.state.is_placed(sight.origin):
                polar = self._polar(sight)
                if polar is not None and (best is None or polar.spread < best.spread):
                    best = polar
        return best

    def _polar(self, sight: Sight) -> _Polar | None:
        """Vector of one sight; a plumb station may borrow the zenith angle of another on the same point."""
        vector = sight.vector()
        found = polar_vector(self.state, self.graph, sight)
        if found is not None and vector is not None:
            return self._expected(sight, found[0], vector[1], found[1])
        g0, reading, lengths = self.state.g0[sight.station], sight.reading(), self._lengths(sight)
        if g0 is None or reading is None or lengths is None:
            return None
        (flat, rise), rows = lengths
        local = turned((flat * math.sin(reading[0]), flat * math.cos(reading[0]), rise), g0)
        every = tuple(dict.fromkeys(reading[1] + rows))
        offset = transposed_times(self.state.vertical_of(sight.origin), local)
        return self._expected(sight, offset, every, vector_noise(self.graph, local, every))

    def _expected(self, sight: Sight, offset: Space, rows: tuple[int, ...], noise: float) -> _Polar:
        """A vector with the expected error that orientation and origin add."""
        moved = math.hypot(*offset) * self.state.azimuth_spreads[sight.station]
        spread = math.hypot(self.state.spreads[sight.origin] + moved, noise)
        return _Polar(sight, offset, rows, noise, min(spread, _LARGEST_SPREAD))

    def _lengths(self, sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise of a plumb sight, perhaps from another plumb station on the point."""
        for number in self.graph.sights_to[sight.target]:
            other = self.graph.sights[number]
            is_plumb = self.graph.orientations[other.station] != Orientation.BASC
            if other.origin == sight.origin and is_plumb:
                lengths = other.lengths()
                if lengths is not None:
                    return lengths
        return self._levelled_lengths(sight)

    def _levelled_lengths(self, sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise from the slope distance and a levelled height of the target."""
        start, end = self.state.heights[sight.origin], self.state.heights[sight.target]
        if sight.distance is None or start is None or end is None or abs(end - start) >= sight.distance[0]:
            return None
        (distance, row), rise = sight.distance, end - start
        levelled = (
            line
            for other, _, line in self.graph.height_differences[sight.target]
            if self.state.heights[other] is not None
        )
        return (math.sqrt(distance**2 - rise**2), rise), (row, *list(levelled)[:1])

    def _take_polar(self, point: int, polar: _Polar) -> None:
        state, sight = self.state, polar.sight
        state.positions[point] = plus(state.known(sight.origin), polar.offset)
        state.has_height[point] = 1
        state.point_steps[point] = Step("azimuth and distance", polar.rows)
        state.parents[point], state.noises[point] = sight.station, polar.noise
        state.spreads[point] = polar.spread

    def _choice(self, point: int, level: Level) -> Choice:
        """What the constraints of a point say, computed anew only when something has changed around it."""
        key = (level.strength, level.uses_hints)
        cached = self.choices.get(point)
        if cached is not None and cached[0] == key:
            return cached[1]
        constraints = collect(self.state, self.graph, point, self.allowed)
        position, sigmas = self.state.positions[point], self.graph.sigmas
        if position is not None:
            choice = choose_height(self.state, constraints, sigmas, level.strength, position)
        else:
            hint = self.hints.get(point) if level.uses_hints else None
            choice = choose(self.state, constraints, sigmas, level.strength, hint)
        self.choices[point] = (key, choice)
        return choice

    def _averaged(self, point: int, fit: Fit) -> Fit:
        """The fit to everything that agrees with it; a height alone stays as it is."""
        if self.state.positions[point] is not None:
            return fit
        constraints = collect(self.state, self.graph, point, self.allowed)
        return averaged(self.state, constraints, self.graph.sigmas, fit)

    def _take_fit(self, point: int, fit: Fit) -> None:
        state, candidate, spread = self.state, fit.candidate, self._spread_of(fit)
        earlier = state.point_steps[point]
        rows = tuple(dict.fromkeys(row for constraint in candidate.used for row in constraint.rows))
        step = Step(candidate.method, rows)
        if earlier is not None:
            step = Step(f"{earlier.method}, then {candidate.method}", (*earlier.observations, *rows))
        state.positions[point], state.has_height[point] = candidate.position, candidate.has_height
        state.point_steps[point] = step
        state.spreads[point], state.noises[point] = spread, fit.refined.spread
        if fit.refined.azimuth_spreads:
            self._take_g0s(point, fit)

    def _take_g0s(self, point: int, fit: Fit) -> None:
        """Orients the stations whose readings have just placed them."""
        position = fit.candidate.position
        self.state.settle([point])
        g0s = station_g0s(self.state, fit.candidate.used, position, self.state.vertical_of(point))
        for station, azimuth_spread in fit.refined.azimuth_spreads.items():
            self.state.g0[station] = g0s[station]
            self.state.azimuth_spreads[station] = min(azimuth_spread, math.pi)
            self.state.station_steps[station] = Step("together with its position")
            self._spread_orientation(station)
