"""Places points and orients stations, one wave after another, the strongest geometries first.

Work is driven by what is new: only points and stations next to a point just located, or a station just
oriented, are looked at again. The time is therefore nearly proportional to the number of observations.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from obseq.survey.choice import Choice, choose, choose_height
from obseq.survey.constraints import collect
from obseq.survey.model import Orientation
from obseq.survey.orienting import orient
from obseq.survey.placement_state import Step, plus, times, transposed_times
from obseq.survey.sights import Sight, direction

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.survey.closed_forms import Space
    from obseq.survey.placement_state import State
    from obseq.survey.sights import Graph

STRENGTHS = (0.1, 0.02, 0.002)
"""Least strength of the geometry, tier after tier; about 10, 2 and 0.2 gon for an intersection."""


class Engine:
    """Works on a state until nothing more can be placed.

    Args:
        state: what is known at the start; it is completed.
        graph: the observations.
        is_constrained: for each point, true when its coordinates are constrained.
        hints: approximate positions, used only to decide between two solutions.
        stations: the stations that may be used; all when left out.
    """

    def __init__(
        self,
        state: State,
        graph: Graph,
        is_constrained: list[bool],
        hints: dict[int, Space],
        stations: Iterable[int] | None = None,
    ) -> None:
        self.state, self.graph = state, graph
        self.is_constrained, self.hints = is_constrained, hints
        self.allowed = None if stations is None else frozenset(stations)
        self.dirty: list[set[int]] = [set() for _ in range(len(STRENGTHS) + 1)]
        self.choices: dict[int, Choice] = {}
        self.touched_points: list[int] = []
        self.oriented: list[int] = []

    def start(self, located: Sequence[int]) -> None:
        """Begins with points whose position is known."""
        self._settle(list(located))

    def start_station(self, station: int) -> None:
        """Begins also with a station that the caller has oriented."""
        self.oriented.append(station)
        self._touch_targets(station)

    def run(self, tiers: Iterable[int]) -> bool:
        """Places what these tiers can place; true when something was placed.

        Tier 0 is the polar point; the others are the tiers of `STRENGTHS`.
        """
        done, order = False, sorted(tiers)
        while any(self._run_tier(tier) for tier in order):
            done = True
        return done

    def _run_tier(self, tier: int) -> bool:
        candidates, self.dirty[tier] = sorted(self.dirty[tier]), set()
        attempt = self._place_polar if tier == 0 else self._place_by_geometry
        located = [point for point in candidates if not self.state.is_placed(point) and attempt(point, tier)]
        self._settle(located)
        return bool(located)

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
        for station in self._stations_around(located):
            origin = self.graph.origins[station]
            was_placed = self.state.is_placed(origin)
            if orient(self.state, self.graph, station, self.is_constrained):
                self.oriented.append(station)
                self._touch_targets(station)
                if not was_placed and self.state.has_height[origin] and not self.state.is_placed(origin):
                    placed.append(origin)
        return sorted(set(placed))

    def _stations_around(self, located: list[int]) -> list[int]:
        found: set[int] = set()
        for point in located:
            found.update(self.graph.stations_at[point])
            found.update(self.graph.sights[number].station for number in self.graph.sights_to[point])
        return sorted(s for s in found if self._may_use(s) and self.state.station_steps[s] is None)

    def _may_use(self, station: int) -> bool:
        return self.allowed is None or station in self.allowed

    def _touch(self, point: int) -> None:
        if not self.state.is_placed(point):
            for points in self.dirty:
                points.add(point)

    def _touch_targets(self, station: int) -> None:
        for number in self.graph.sights_from[station]:
            self._touch(self.graph.sights[number].target)

    def _touch_neighbours(self, point: int) -> None:
        graph = self.graph
        self._touch(point)
        for station in graph.stations_at[point]:
            self._touch_targets(station)
        for number in graph.sights_to[point]:
            self._touch(graph.sights[number].origin)
        for other, _, _ in graph.distances[point]:
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
                    self.touched_points.append(other)
                    waiting.append(other)

    def _place_polar(self, point: int, tier: int) -> bool:
        """First complete vector from an oriented station (MMVII's two methods)."""
        for number in self.graph.sights_to[point]:
            sight = self.graph.sights[number]
            if not self._may_use(sight.station) or not self.state.is_placed(sight.origin):
                continue
            found = self._polar(sight)
            if found is not None:
                self._locate(point, found[0], Step("azimuth and distance", found[1]))
                return True
        return False

    def _polar(self, sight: Sight) -> tuple[Space, tuple[int, ...]] | None:
        state = self.state
        start, vertical = state.known(sight.origin), state.verticals[sight.origin]
        rotation, g0 = state.rotations[sight.station], state.g0[sight.station]
        if rotation is not None:
            vector = sight.vector()
            return None if vector is None else (plus(start, times(rotation, vector[0])), vector[1])
        reading = sight.reading()
        if g0 is None or reading is None or vertical is None:
            return None
        lengths = _flat_and_rise(sight) or self._borrowed_lengths(sight)
        if lengths is None:
            return None
        (flat, rise), rows = lengths
        azimuth = g0 + reading[0]
        local = (flat * math.sin(azimuth), flat * math.cos(azimuth), rise)
        return plus(start, transposed_times(vertical, local)), tuple(dict.fromkeys(reading[1] + rows))

    def _borrowed_lengths(self, sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Zenith angle or DZ measured by another plumb station on the same point."""
        for number in self.graph.sights_to[sight.target]:
            other = self.graph.sights[number]
            is_plumb = self.graph.orientations[other.station] != Orientation.BASC
            if other.origin == sight.origin and is_plumb and _flat_and_rise(other) is not None:
                return _flat_and_rise(other)
        return None

    def _locate(self, point: int, position: Space, step: Step, *, has_height: bool = True) -> None:
        self.state.positions[point] = position
        self.state.has_height[point] = has_height
        self.state.point_steps[point] = step

    def _place_by_geometry(self, point: int, tier: int) -> bool:
        """Intersection, resection, trilateration...: `choice.choose` with the strength of the tier."""
        state, least = self.state, STRENGTHS[tier - 1]
        constraints = collect(state, self.graph, point, self.allowed)
        position = state.positions[point]
        if position is not None:
            choice = choose_height(state, constraints, position, least)
        else:
            hint = self.hints.get(point) if tier > 1 else None
            choice = choose(state, constraints, least, hint)
        self.choices[point] = choice
        if choice.candidate is None or (position is None and not choice.candidate.has_height and tier == 1):
            return False
        self._take(point, choice)
        return True

    def _take(self, point: int, choice: Choice) -> None:
        candidate = choice.candidate
        assert candidate is not None
        earlier = self.state.point_steps[point]
        rows = tuple(dict.fromkeys(row for constraint in candidate.used for row in constraint.rows))
        step = Step(candidate.method, rows)
        if earlier is not None:
            step = Step(f"{earlier.method}, then {candidate.method}", (*earlier.observations, *rows))
        self._locate(point, candidate.position, step, has_height=candidate.has_height)


def _flat_and_rise(sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
    """Horizontal distance and rise of a sight of a plumb instrument, with their observations."""
    if sight.dx is not None and sight.dy is not None and sight.dz is not None:
        return (math.hypot(sight.dx[0], sight.dy[0]), sight.dz[0]), (sight.dx[1], sight.dy[1], sight.dz[1])
    if sight.zenith is None or sight.distance is None:
        return None
    _, flat, rise = direction(0.0, sight.zenith[0], sight.distance[0])
    return (flat, rise), (sight.zenith[1], sight.distance[1])
