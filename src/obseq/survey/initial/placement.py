"""Places points and orients stations, the surest first, until nothing more can be placed.

Work is driven by what is new: only points and stations next to a point just located, or to a station just
oriented, are looked at again. The time is therefore nearly proportional to the number of observations.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from obseq.dataclass import dataclass
from obseq.survey.initial.best_position import BestPosition, Fit, averaged, best_height, best_position
from obseq.survey.initial.known import Step, plus
from obseq.survey.initial.orienting import orient
from obseq.survey.initial.relations import collect, station_g0s
from obseq.survey.initial.traverse import (
    Link,
    Traverse,
    in_frame,
    link_g0,
    link_rise,
    vector_sigma,
)
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.survey.initial.closed_forms import Space
    from obseq.survey.initial.known import Known
    from obseq.survey.initial.sights import Sight, SightGraph

SOUND = 0.02
WEAK = 0.002
"""Least strengths of the geometry (see `relations.Refined`): an intersection at about 2, and at 0.2 gon."""
_LARGEST_SIGMA = 1e6
_ALIKE = 2.0
"""Points whose expected errors differ by less than this factor are placed at the same time."""


@dataclass(frozen=True)
class Level:
    """What may be used at one stage.

    Attributes:
        point_sigma: greatest expected error of a point (m).
        azimuth_sigma: greatest expected error of G0 (rad).
        strength: least strength of the geometry.
        uses_hints: whether approximate positions may decide between two solutions.
    """

    point_sigma: float
    azimuth_sigma: float
    strength: float = SOUND
    uses_hints: bool = False


GOOD = (Level(0.3, 0.002),)
REST = (
    Level(3.0, 0.02, uses_hints=True),
    Level(math.inf, math.inf, uses_hints=True),
    Level(math.inf, math.inf, WEAK, uses_hints=True),
)


class _Polar(NamedTuple):
    """A vector (instrument) from a station to a point, and its expected errors (m), alone and in all."""

    sight: Sight
    local: Space
    rows: tuple[int, ...]
    relative_sigma: float
    point_sigma: float


class Placement:
    """Works on what is known until nothing more can be placed.

    Args:
        known: what is known at the start; it is completed.
        graph: the observations.
        hints: approximate positions, used only to decide between two solutions.
        stations: the stations that may be used; all when left out.
    """

    def __init__(
        self, known: Known, graph: SightGraph, hints: dict[int, Space], stations: Iterable[int] | None = None
    ) -> None:
        self.known, self.graph, self.hints = known, graph, hints
        self.allowed = None if stations is None else frozenset(stations)
        self.traverse = Traverse(known, graph, self.allowed)
        self.placed: set[int] = set()
        self.dirty_polar: set[int] = set()
        self.dirty_geometry: set[int] = set()
        self.best_positions: dict[int, tuple[tuple[float, bool], BestPosition]] = {}
        self.touched_points: list[int] = []
        self.oriented: list[int] = []

    def start(self, located: Sequence[int]) -> None:
        """Begins with points whose position is known."""
        self._settle(list(located))

    def is_ambiguous(self, point: int) -> bool:
        """Whether several positions of a point fit its observations equally well."""
        cached = self.best_positions.get(point)
        return cached is not None and bool(cached[1].alternatives)

    def start_station(self, station: int) -> None:
        """Begins also with a station on a located point that the caller has oriented."""
        self._spread_orientation(station)

    def run(self, levels: Iterable[Level]) -> bool:
        """Places what these levels allow, in their order; true when something was placed or oriented."""
        done = False
        for level in levels:
            self.dirty_geometry.update(self.best_positions)
            while self._place_polar() or self._orient_next(level) or self._place_by_geometry(level):
                done = True
        return done

    def _orient_next(self, level: Level) -> bool:
        """Takes the surest link of the traverse."""
        found = self.traverse.next(level.azimuth_sigma)
        if found is None:
            return False
        station, link = found
        origin = self.graph.origins[station]
        if self.known.verticals[origin] is None:
            self._place_by_link(station, origin, link)
        self.known.g0[station] = link_g0(self.known, self.graph, station, link)
        self.known.azimuth_sigmas[station] = link.azimuth_sigma
        self.known.station_steps[station] = Step(link.method, link.rows)
        self._spread_orientation(station)
        return True

    def _place_by_link(self, station: int, origin: int, link: Link) -> None:
        """Places the origin of a station where its link puts it."""
        known = self.known
        known.positions[origin], known.has_height[origin] = link.origin, 1
        known.point_steps[origin] = Step(link.method, link.rows)
        known.relative_sigmas[origin], known.parents[origin] = link.relative_sigma, link.parent
        if link.parent is not None:
            base = self.graph.origins[link.parent]
            distance = math.dist(known.position_of(base), known.position_of(origin))
            known.point_sigmas[origin] = math.hypot(
                known.point_sigmas[base] + distance * known.azimuth_sigmas[link.parent],
                link.relative_sigma,
            )
        self._settle([origin])
        if link.method == "free station":
            up = known.vertical_of(origin)[2]
            rise = link_rise(known, self.graph, station, link)
            x, y, z = known.position_of(origin)
            known.positions[origin] = (x + rise * up[0], y + rise * up[1], z + rise * up[2])

    def _place_polar(self) -> bool:
        """Places points at the end of complete vectors from oriented stations."""
        candidates, self.dirty_polar = sorted(self.dirty_polar), set()
        located = []
        for point in candidates:
            polar = None if self.known.is_placed(point) else self._best_polar(point)
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
            if not self.known.is_placed(point):
                fit = self._best_position(point, level).fit
                if (
                    fit is not None
                    and self._point_sigma_of(fit) <= level.point_sigma
                    and self._is_ripe(fit, level)
                ):
                    found.append((point, fit, self._point_sigma_of(fit)))
        least = min((point_sigma for _, _, point_sigma in found), default=0.0)
        located = []
        for point, fit, point_sigma in found:
            if point_sigma <= _ALIKE * least:
                self._take_fit(point, self._averaged(point, fit))
                located.append(point)
            else:
                self.dirty_geometry.add(point)
        self._settle(located)
        return bool(located)

    def _point_sigma_of(self, fit: Fit) -> float:
        base = min(self.known.point_sigmas[relation.other] for relation in fit.candidate.used)
        return min(math.hypot(base, fit.refined.point_sigma), _LARGEST_SIGMA)

    def _is_ripe(self, fit: Fit, level: Level) -> bool:
        """A horizontal position alone is taken only when nothing better comes."""
        return fit.candidate.has_height or level.uses_hints

    def _settle(self, located: list[int]) -> None:
        """Verticals of new points, then orientations, until no orientation places a further point."""
        while located:
            self.known.settle(located)
            self.placed.update(filter(self.known.is_placed, located))
            self.touched_points.extend(located)
            self._touch(set(located).union(*[self.graph.neighbours[point] for point in located]))
            for point in located:
                self._spread_height(point)
            located = self._orient_around(located)

    def _orient_around(self, located: list[int]) -> list[int]:
        """Orients stations at or towards new points; returns origins that this has placed."""
        placed: list[int] = []
        orientations = self.graph.orientations
        for station, sights in sorted(self._sights_around(located).items()):
            if orientations[station] == Orientation.VERT:
                self.traverse.add_azimuths(station, sorted(sights))
            else:
                self._orient_freely(station, placed)
        return sorted(set(placed))

    def _orient_freely(self, station: int, placed: list[int]) -> None:
        """Orients a station that is not plumb; its origin is one of those placed when this has placed it."""
        origin = self.graph.origins[station]
        was_placed = self.known.is_placed(origin)
        if not orient(self.known, self.graph, station):
            return
        if not was_placed and self.known.has_height[origin] and not self.known.is_placed(origin):
            placed.append(origin)
            self.known.settle([origin])
        self._spread_orientation(station)

    def _sights_around(self, located: list[int]) -> dict[int, list[int]]:
        """Stations without orientation at or towards some points, with their sights that concern these."""
        graph, steps, sights = self.graph, self.known.station_steps, self.graph.sights
        found: dict[int, list[int]] = {}
        for point in located:
            for number in graph.sights_to[point]:
                if steps[station := sights[number].station] is None:
                    found.setdefault(station, []).append(number)
        for point in located:
            for station in graph.stations_at[point]:
                if steps[station] is None:
                    found[station] = graph.sights_from[station]
        if self.allowed is None:
            return found
        return {station: numbers for station, numbers in found.items() if station in self.allowed}

    def _may_use(self, station: int) -> bool:
        return self.allowed is None or station in self.allowed

    def _spread_orientation(self, station: int) -> None:
        """Looks again at the targets of a station just oriented, and links its neighbours to it."""
        self.oriented.append(station)
        self._touch(self.graph.targets[station])
        if self.known.is_placed(self.graph.origins[station]):
            self.traverse.add_neighbours(station)

    def _touch(self, points: set[int]) -> None:
        """Looks again at points that are not placed; others are passed over when it is their turn."""
        points = points - self.placed
        self.dirty_polar |= points
        self.dirty_geometry |= points
        for point in self.best_positions.keys() & points:
            del self.best_positions[point]

    def _spread_height(self, point: int) -> None:
        """Carries heights along height differences, also to points without horizontal position."""
        waiting = [point] if self.graph.height_differences[point] else []
        while waiting:
            start = waiting.pop()
            height = self.known.heights[start]
            if height is None:
                continue
            for other, above, _ in self.graph.height_differences[start]:
                self._touch({other})
                if self.known.heights[other] is None:
                    self.known.heights[other] = height - above
                    self.known.point_sigmas[other] = self.known.point_sigmas[start]
                    self.touched_points.append(other)
                    waiting.append(other)

    def _best_polar(self, point: int) -> _Polar | None:
        """The complete vector with the least expected error."""
        best: _Polar | None = None
        sights, steps, is_placed = self.graph.sights, self.known.station_steps, self.known.is_placed
        for number in self.graph.sights_to[point]:
            sight = sights[number]
            if steps[sight.station] is None:
                continue
            if self._may_use(sight.station) and is_placed(sight.origin):
                polar = self._polar(sight)
                if polar is not None and (best is None or polar.point_sigma < best.point_sigma):
                    best = polar
        return best

    def _polar(self, sight: Sight) -> _Polar | None:
        """Vector of one sight; a plumb station may borrow the zenith angle of another on the same point."""
        vector, g0 = sight.vector(), self.known.g0[sight.station]
        if vector is not None and (g0 is not None or self.known.rotations[sight.station] is not None):
            return self._expected(sight, vector[0], vector[1], sight.vector_sigma)
        reading, lengths = sight.reading(), self._lengths(sight)
        if g0 is None or reading is None or lengths is None:
            return None
        (flat, rise), rows = lengths
        local = flat * math.sin(reading[0]), flat * math.cos(reading[0]), rise
        every = tuple(dict.fromkeys(reading[1] + rows))
        return self._expected(sight, local, every, vector_sigma(self.graph, local, every))

    def _expected(self, sight: Sight, local: Space, rows: tuple[int, ...], relative_sigma: float) -> _Polar:
        """A vector with the expected error that orientation and origin add."""
        moved = math.hypot(*local) * self.known.azimuth_sigmas[sight.station]
        point_sigma = math.hypot(self.known.point_sigmas[sight.origin] + moved, relative_sigma)
        return _Polar(sight, local, rows, relative_sigma, min(point_sigma, _LARGEST_SIGMA))

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
        start, end = self.known.heights[sight.origin], self.known.heights[sight.target]
        if sight.distance is None or start is None or end is None or abs(end - start) >= sight.distance[0]:
            return None
        (distance, row), rise = sight.distance, end - start
        levelled = (
            line
            for other, _, line in self.graph.height_differences[sight.target]
            if self.known.heights[other] is not None
        )
        return (math.sqrt(distance**2 - rise**2), rise), (row, *list(levelled)[:1])

    def _take_polar(self, point: int, polar: _Polar) -> None:
        known, sight = self.known, polar.sight
        offset = in_frame(known, sight, polar.local)
        known.positions[point] = plus(known.position_of(sight.origin), offset)
        known.has_height[point] = 1
        known.point_steps[point] = Step("azimuth and distance", polar.rows)
        known.parents[point], known.relative_sigmas[point] = sight.station, polar.relative_sigma
        known.point_sigmas[point] = polar.point_sigma

    def _best_position(self, point: int, level: Level) -> BestPosition:
        """What the relations of a point say, computed anew only when something has changed around it."""
        key = (level.strength, level.uses_hints)
        cached = self.best_positions.get(point)
        if cached is not None and cached[0] == key:
            return cached[1]
        relations = collect(self.known, self.graph, point, self.allowed)
        position, sigmas = self.known.positions[point], self.graph.sigmas
        if position is not None:
            best = best_height(self.known, relations, sigmas, level.strength, position)
        else:
            hint = self.hints.get(point) if level.uses_hints else None
            best = best_position(self.known, relations, sigmas, level.strength, hint)
        self.best_positions[point] = (key, best)
        return best

    def _averaged(self, point: int, fit: Fit) -> Fit:
        """The fit to everything that agrees with it; a height alone stays as it is."""
        if self.known.positions[point] is not None:
            return fit
        relations = collect(self.known, self.graph, point, self.allowed)
        return averaged(self.known, relations, self.graph.sigmas, fit)

    def _take_fit(self, point: int, fit: Fit) -> None:
        known, candidate, point_sigma = self.known, fit.candidate, self._point_sigma_of(fit)
        earlier = known.point_steps[point]
        rows = tuple(dict.fromkeys(row for relation in candidate.used for row in relation.rows))
        step = Step(candidate.method, rows)
        if earlier is not None:
            step = Step(f"{earlier.method}, then {candidate.method}", (*earlier.observations, *rows))
        known.positions[point], known.has_height[point] = candidate.position, candidate.has_height
        known.point_steps[point] = step
        known.point_sigmas[point], known.relative_sigmas[point] = (
            point_sigma,
            fit.refined.point_sigma,
        )
        if fit.refined.azimuth_sigmas:
            self._take_g0s(point, fit)

    def _take_g0s(self, point: int, fit: Fit) -> None:
        """Orients the stations whose readings have just placed them."""
        position = fit.candidate.position
        self.known.settle([point])
        g0s = station_g0s(self.known, fit.candidate.used, position, self.known.vertical_of(point))
        for station, azimuth_sigma in fit.refined.azimuth_sigmas.items():
            self.known.g0[station] = g0s[station]
            self.known.azimuth_sigmas[station] = min(azimuth_sigma, math.pi)
            self.known.station_steps[station] = Step("together with its position")
            self._spread_orientation(station)
