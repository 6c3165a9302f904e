"""Places points and orients stations, the surest first, until nothing more can be placed.

Work is driven by what is new: only points and stations next to a point just located, or to a station just
oriented, are looked at again. The time is therefore nearly proportional to the number of observations.
"""

from __future__ import annotations

import math
from itertools import chain, filterfalse
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.stopwatch import Tally
from obseq.survey.initial.orienting import orient
from obseq.survey.initial.polar_sights import LARGEST_SIGMA, PolarSights
from obseq.survey.initial.relations import collect, station_g0s
from obseq.survey.initial.traverse import Link, Traverse, link_g0, link_rise
from obseq.survey.model import Orientation
from obseq.survey.sights.sights import Step, step_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.survey.initial.best_position import BestPosition, Fit
    from obseq.survey.initial.closed_forms import Space
    from obseq.survey.initial.known import Known
    from obseq.survey.sights.sight_graph import SightGraph
    from obseq.survey.sights.ways import PlumbWays

    Sought = tuple[tuple[float, Space | None], BestPosition]
    """The least strength and the hint with which a position was looked for, and what was found."""

SOUND = 0.02
WEAK = 0.002
"""Least strengths of the geometry (see `relations.Refined`): an intersection at about 2, and at 0.2 gon."""
_ALIKE = 2.0
"""Points whose expected errors differ by less than this factor are placed at the same time."""
_MANY = 100
"""Points just placed from which on those beside them are found by arrays."""


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


class Placement:
    """Works on what is known until nothing more can be placed.

    Args:
        known: what is known at the start; it is completed.
        graph: the observations.
        ways: between its stations.
        hints: approximate positions, used only to decide between two solutions.
        stations: the stations that may be used; all when left out.
    """

    def __init__(
        self,
        known: Known,
        graph: SightGraph,
        ways: PlumbWays,
        hints: dict[int, Space],
        stations: Iterable[int] | None = None,
    ) -> None:
        self.known, self.graph, self.hints = known, graph, hints
        self.allowed = None if stations is None else frozenset(stations)
        self.polar_sights = PolarSights(known, graph, self.allowed)
        self.traverse = Traverse(known, graph, ways, self.allowed)
        self.dirty_polar: set[int] = set()
        self.dirty_geometry: set[int] = set()
        self.best_positions: dict[int, Sought] = {}
        self.seen_anew: set[int] = set()
        self.located_anew: list[int] = []
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
        done, tally = False, Tally("initial values: point", len(self.known.positions))
        for level in levels:
            if self.known.is_complete():
                break
            self._look_around()
            self.dirty_geometry.update(self.best_positions)
            while self._place_polar() or self._orient_next(level) or self._place_by_geometry(level):
                done = True
                if tally.is_due:
                    tally.tell(sum(position is not None for position in self.known.positions))
        return done

    def _orient_next(self, level: Level) -> bool:
        """Takes the surest link of the traverse."""
        found = self.traverse.next(level.azimuth_sigma)
        if found is None:
            return False
        station, link = found
        origin = self.graph.origins[station]
        if not self.known.is_settled[origin]:
            self._place_by_link(station, origin, link)
        self.known.g0[station] = link_g0(self.known, self.graph, station, link)
        self.known.azimuth_sigmas[station] = link.azimuth_sigma
        self.known.station_steps[station] = link.cause
        self._spread_orientation(station)
        return True

    def _place_by_link(self, station: int, origin: int, link: Link) -> None:
        """Places the origin of a station where its link puts it."""
        known = self.known
        known.positions[origin], known.has_height[origin] = link.origin, 1
        known.point_steps[origin] = link.cause
        known.relative_sigmas[origin], known.parents[origin] = link.relative_sigma, link.parent
        if link.parent is not None:
            base = self.graph.origins[link.parent]
            distance = math.dist(known.position_of(base), known.position_of(origin))
            known.point_sigmas[origin] = math.hypot(
                known.point_sigmas[base] + distance * known.azimuth_sigmas[link.parent],
                link.relative_sigma,
            )
        self._settle([origin])
        if len(link.targets) > 1:
            up = known.vertical_of(origin)[2]
            rise = link_rise(known, self.graph, station, link)
            x, y, z = known.position_of(origin)
            known.positions[origin] = (x + rise * up[0], y + rise * up[1], z + rise * up[2])

    def _place_polar(self) -> bool:
        """Places points at the end of complete vectors from oriented stations."""
        if not self.dirty_polar:
            return False
        candidates = sorted(filterfalse(self.known.is_placed, self.dirty_polar))
        located = [point for point in candidates if self.polar_sights.place(point)]
        self.dirty_polar = set()
        if len(located) < len(candidates):
            self.seen_anew.update(candidates)
        self._settle(located)
        return bool(located)

    def _place_by_geometry(self, level: Level) -> bool:
        """Intersection, resection, trilateration...: the surest of the points that can be placed so."""
        self._look_around()
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
        return min(math.hypot(base, fit.refined.point_sigma), LARGEST_SIGMA)

    def _is_ripe(self, fit: Fit, level: Level) -> bool:
        """A horizontal position alone is taken only when nothing better comes."""
        return fit.candidate.has_height or level.uses_hints

    def _settle(self, located: list[int]) -> None:
        """Verticals of new points, then orientations, until no orientation places a further point."""
        while located:
            self.known.settle(located)
            self.touched_points.extend(located)
            self.located_anew.extend(located)
            self._look_from(located)
            if len(self.graph.rises.rows):
                for point in located:
                    self._spread_height(point)
            located = self._orient_around(located)

    def _look_from(self, located: list[int]) -> None:
        """Looks again at the targets of oriented stations on new points, and at those that want a height."""
        self._touch(filterfalse(self.known.has_height.__getitem__, located))
        steps, stations_at = self.known.station_steps, self.graph.stations_at
        for point in located:
            for station in stations_at[point]:
                if steps[station] is not None:
                    self._touch(self.graph.targets(station))

    def _orient_around(self, located: list[int]) -> list[int]:
        """Orients stations at or towards new points; returns origins that this has placed."""
        placed: list[int] = []
        orientations = self.graph.orientations
        for station, sights in sorted(self._sights_around(located).items()):
            if orientations[station] == Orientation.VERT.value:
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
        """Stations without orientation at or towards some points, with their sights that concern these.

        Those on points that are not located themselves are of use when they are #BASC.
        """
        graph, steps, station_of = self.graph, self.known.station_steps, self.graph.station_of
        origin_of, is_settled, orientations = graph.origin_of, self.known.is_settled, graph.orientations
        found: dict[int, list[int]] = {}
        for point in located:
            for number in graph.sights_to[point]:
                station = station_of[number]
                is_free = steps[station] is None
                if is_free and (
                    is_settled[origin_of[number]] or orientations[station] == Orientation.BASC.value
                ):
                    found.setdefault(station, []).append(number)
        for point in located:
            for station in graph.stations_at[point]:
                if steps[station] is None:
                    found[station] = list(graph.sights_from[station])
        if self.allowed is None:
            return found
        return {station: numbers for station, numbers in found.items() if station in self.allowed}

    def _spread_orientation(self, station: int) -> None:
        """Looks again at the targets of a station just oriented, and links its neighbours to it."""
        self.oriented.append(station)
        self._touch(self.graph.targets(station))
        if self.known.is_placed(self.graph.origins[station]):
            self.traverse.add_neighbours(station)

    def _touch(self, points: Iterable[int]) -> None:
        """Looks again at points; those that are placed are passed over when it is their turn."""
        self.dirty_polar.update(points)

    def _look_around(self) -> None:
        """Looks again at the geometry of what was touched, and of all neighbours of new points."""
        if not (self.seen_anew or self.located_anew):
            return
        touched = set(filterfalse(self.known.is_placed, self.seen_anew)) | self._beside(self.located_anew)
        self.seen_anew, self.located_anew = set(), []
        self.dirty_geometry |= touched
        for point in self.best_positions.keys() & touched:
            del self.best_positions[point]

    def _beside(self, located: list[int]) -> set[int]:
        """The points without a place that observations join with new ones."""
        if not located or self.known.has_all_points():
            return set()
        if len(located) >= _MANY:
            anew = np.zeros(self.graph.n_points, np.bool_)
            anew[located] = True
            return set(np.flatnonzero(self.graph.beside(anew) & ~self.known.are_placed()).tolist())
        every = chain.from_iterable(map(self.graph.neighbours, located))
        return set(filterfalse(self.known.is_placed, every))

    def _spread_height(self, point: int) -> None:
        """Carries heights along height differences, also to points without horizontal position."""
        known, waiting = self.known, [point]
        while waiting:
            start = waiting.pop()
            height = known.height(start)
            if height is None:
                continue
            for other, above, _ in self.graph.height_differences[start]:
                self._touch((other,))
                if known.height(other) is None:
                    known.take_height(other, height - above)
                    known.point_sigmas[other] = known.point_sigmas[start]
                    self.touched_points.append(other)
                    waiting.append(other)

    def _best_position(self, point: int, level: Level) -> BestPosition:
        """What the relations of a point say, computed anew only when something has changed around it."""
        hint = self.hints.get(point) if level.uses_hints else None
        cached = self.best_positions.get(point)
        if cached is not None and _says_the_same(cached, level.strength, hint):
            return cached[1]
        from obseq.survey.initial.best_position import best_height, best_position

        relations = collect(self.known, self.graph, point, self.allowed)
        position, sigmas = self.known.positions[point], self.graph.sigmas
        if position is not None:
            best = best_height(self.known, relations, sigmas, level.strength, position)
        else:
            best = best_position(self.known, relations, sigmas, level.strength, hint)
        self.best_positions[point] = (level.strength, hint), best
        return best

    def _averaged(self, point: int, fit: Fit) -> Fit:
        """The fit to everything that agrees with it; a height alone stays as it is."""
        if self.known.positions[point] is not None:
            return fit
        from obseq.survey.initial.best_position import averaged

        relations = collect(self.known, self.graph, point, self.allowed)
        return averaged(self.known, relations, self.graph.sigmas, fit)

    def _take_fit(self, point: int, fit: Fit) -> None:
        known, candidate, point_sigma = self.known, fit.candidate, self._point_sigma_of(fit)
        earlier = known.point_steps[point]
        rows = tuple(dict.fromkeys(row for relation in candidate.used for row in relation.rows))
        step = Step(candidate.method, rows)
        if earlier is not None:
            earlier = step_of(earlier, self.graph.sights.rows)
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


def _says_the_same(cached: Sought, strength: float, hint: Space | None) -> bool:
    """Whether a position looked for before is what this strength and this hint would give.

    A hint decides between alternatives only; where all geometry is weaker than asked for, there is nothing.
    """
    (least, decided_by), best = cached
    if best.fit is None and not best.alternatives:
        return strength == least or best.strength < strength
    return strength == least and (hint == decided_by or (decided_by is None and not best.alternatives))
