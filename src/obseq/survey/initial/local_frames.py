"""Groups of points and stations that hang together but touch known points only by common points.

Two known stations that do not see each other, a traverse between two known points without any azimuth, one
known point and an azimuth elsewhere: no point of such a group can be placed alone. The group is computed in a
frame of its own (a station at the origin, its circle at zero, parallel plumb lines), then turned and moved
onto the points it shares with what is known; where these are too near to each other, azimuths turn it. A body
of tilted set-ups is first turned upright by the heights of its points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.initial.closed_forms import Space, minus, plus, wrap
from obseq.survey.initial.known import Known, times, transposed_times
from obseq.survey.initial.orienting import LEAST_SPREAD
from obseq.survey.initial.placement import Level, Placement
from obseq.survey.initial.relations import central_angle
from obseq.survey.initial.tilted_frames import Body, bodies, uprights
from obseq.survey.model import Orientation
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import Sight, Step, step_of
from obseq.survey.sights.ways import PlumbWays

_LEVELS = (Level(1.0, 0.01), Level(math.inf, math.inf))
_FLAT_LEVELS = (Level(math.inf, math.inf, uses_hints=True),)
_BASE = 100.0
"""Length (m) of the base of a group without lengths: any does."""

_LEAST_BASE = 0.05
"""Least distance between the common points, in parts of the size of the group."""


@dataclass(frozen=True)
class _Tie:
    """Motion of a plumb local frame: turned by `angle` clockwise, scaled, moved; in the frame at `origin`."""

    origin: int
    angle: float
    local_centre: tuple[float, float]
    centre: tuple[float, float]
    rise: float | None
    point_sigma: float
    scale: float = 1.0

    def move(self, known: Known, position: Space) -> Space:
        """A position of the local frame, in the frame of the computation."""
        east, north = position[0] - self.local_centre[0], position[1] - self.local_centre[1]
        cosine, sine = self.scale * math.cos(self.angle), self.scale * math.sin(self.angle)
        turned = (
            self.centre[0] + east * cosine + north * sine,
            self.centre[1] - east * sine + north * cosine,
            position[2] + (self.rise or 0.0),
        )
        return plus(known.position_of(self.origin), transposed_times(known.vertical_of(self.origin), turned))


class LocalFrames:
    """Tries each group of stations once, until something else has been placed."""

    def __init__(self, known: Known, graph: SightGraph, ways: PlumbWays) -> None:
        self.known, self.graph, self.ways = known, graph, ways
        self.scratch = Known(known.names, len(graph.origins), None)
        self.scratch.origins, self.scratch.level = graph.origins, known.level
        self._in_vain: dict[int, tuple[list[int], list[int]]] = {}

    def place(self) -> list[int]:
        """Points that local frames have placed; they remain to be settled."""
        allowed = [s for s in range(len(self.graph.origins)) if self._is_usable(s)]
        groups = self._groups_with_ties(allowed)
        tried: set[int] = set()
        placed: list[int] = []
        for station in allowed:
            if station in groups and station not in tried and self._has_vector(station):
                if self._is_in_vain(station, tried):
                    continue
                placed.extend(self._try_from(station, frozenset(allowed), tried))
        for station in allowed:
            partner = self._partner(station) if station in groups and station not in tried else None
            if partner is not None:
                placed.extend(self._try_between(station, *partner, frozenset(allowed), tried))
        tilted = [s for s in allowed if self.graph.orientations[s] == Orientation.BASC.value and s in groups]
        for body in bodies(self.graph, tilted) if tilted else ():
            if not self._is_in_vain(body.stations[0], tried):
                placed.extend(self._try_tilted(body))
        return sorted(set(placed))

    def _is_usable(self, station: int) -> bool:
        """Not oriented, and not bound to the real north."""
        if self.known.station_steps[station] is not None:
            return False
        if self.graph.orientations[station] != Orientation.FIX.value:
            return True
        return all(math.isnan(self.graph.reading_of[number]) for number in self.graph.sights_from[station])

    def _is_in_vain(self, station: int, tried: set[int]) -> bool:
        """Whether its group was tried, and nothing that it reaches has been placed since then."""
        reached, oriented = self._in_vain.get(station, ([], []))
        if not reached or any(self.known.is_settled[point] for point in reached):
            return False
        tried.update(oriented)
        return True

    def _has_vector(self, station: int) -> bool:
        """A plumb station with at least one complete vector, or one that levelling completes, can begin."""
        if self.graph.orientations[station] != Orientation.VERT.value:
            return False
        return any(
            not math.isnan(self.graph.length_of[number]) or self._is_levelled(self.graph.sights[number])
            for number in self.graph.sights_from[station]
        )

    def _is_levelled(self, sight: Sight) -> bool:
        """Whether a reading with a distance has a height difference between its ends."""
        if sight.reading() is None or sight.distance is None:
            return False
        return any(other == sight.target for other, _, _ in self.graph.height_differences[sight.origin])

    def _partner(self, station: int) -> tuple[int, float, float] | None:
        """A plumb station that it sees and that sees it, with the readings there and back."""
        graph = self.graph
        if graph.orientations[station] != Orientation.VERT.value:
            return None
        for number in graph.sights_from[station]:
            for other in graph.stations_at[graph.target_of[number]]:
                back = graph.reading_between(other, graph.origins[station])
                is_plumb = graph.orientations[other] == Orientation.VERT.value
                if is_plumb and not math.isnan(graph.reading_of[number]) and not math.isnan(back):
                    return other, graph.reading_of[number], back
        return None

    def _groups_with_ties(self, allowed: list[int]) -> set[int]:
        """Stations whose connected group of sights has two located points, or one and an azimuth."""
        parent: dict[int, int] = {}

        def root(point: int) -> int:
            while parent.setdefault(point, point) != point:
                parent[point] = parent[parent[point]]
                point = parent[point]
            return point

        for station in allowed:
            for target in self.graph.targets(station):
                parent[root(target)] = root(self.graph.origins[station])
        ties: dict[int, int] = {}
        for point in parent:
            if self.known.is_settled[point]:
                ties[root(point)] = ties.get(root(point), 0) + 1
        turned = {root(a) for a, b, _ in self._azimuths if a in parent and b in parent and root(a) == root(b)}
        least = {group: 1 if group in turned else 2 for group in ties}
        found = {group for group, count in ties.items() if count >= least[group]}
        return {s for s in allowed if root(self.graph.origins[s]) in found}

    @cached_property
    def _azimuths(self) -> list[tuple[int, int, float]]:
        """From which point to which, and the azimuth (rad) that an instrument with the real north reads."""
        graph = self.graph
        fixed = [s for s, kind in enumerate(graph.orientations) if kind == Orientation.FIX.value]
        sights = [number for station in fixed for number in graph.sights_from[station]]
        every = [(graph.origin_of[n], graph.target_of[n], graph.reading_of[n]) for n in sights]
        return [azimuth for azimuth in every if not math.isnan(azimuth[2])]

    def _try_from(self, station: int, allowed: frozenset[int], tried: set[int]) -> list[int]:
        """Computes the group of one station in its own frame and moves it to its place."""
        local, origin = self.scratch, self.graph.origins[station]
        placement = Placement(local, self.graph, self.ways, {}, allowed)
        local.positions[origin], local.has_height[origin] = (0.0, 0.0, 0.0), 1
        local.point_steps[origin] = Step("origin")
        local.g0[station], local.station_steps[station] = 0.0, Step("local frame")
        placement.start([origin])
        placement.start_station(station)
        placement.run(_LEVELS)
        tried.update(placement.oriented)
        return self._tied(station, placement)

    def _try_between(
        self, station: int, other: int, there: float, back: float, allowed: frozenset[int], tried: set[int]
    ) -> list[int]:
        """Computes a group without lengths from two stations that see each other, in the horizontal."""
        local, ends = self.scratch, [self.graph.origins[k] for k in (station, other)]
        placement = Placement(local, self.graph, self.ways, {}, allowed)
        places = (0.0, 0.0, 0.0), (_BASE * math.sin(there), _BASE * math.cos(there), 0.0)
        for point, place in zip(ends, places, strict=True):
            local.positions[point], local.point_steps[point] = place, Step("origin")
        for oriented, g0 in ((station, 0.0), (other, there + math.pi - back)):
            local.g0[oriented], local.station_steps[oriented] = g0, Step("local frame")
        placement.start(ends)
        for oriented in (station, other):
            placement.start_station(oriented)
        placement.run(_FLAT_LEVELS)
        tried.update(placement.oriented)
        return self._tied(station, placement, is_scaled=True)

    def _try_tilted(self, body: Body) -> list[int]:
        """Turns a body upright and moves it to its place, if what is known contradicts its mirror image."""
        heights = {point: self._height(point) for point in body.places}
        levelled = [point for point, height in heights.items() if height is not None]
        turns = uprights(
            np.array([body.places[point] for point in levelled]),
            np.array([heights[point] for point in levelled], np.float64),
        )
        ways = []
        for turn in turns:
            self._lay(body, turn)
            ways.append((self._misfit(list(body.places), heights), turn))
        ways.sort(key=lambda way: way[0])
        placed: list[int] = []
        size = max(map(math.hypot, *zip(*body.places.values(), strict=True)))
        if ways and max(2.0 * ways[0][0], LEAST_SPREAD * size) < ways[1][0]:
            self._lay(body, ways[0][1])
            placed = self._tie(body.stations[0], list(body.places), is_scaled=False)
        reached = [] if placed else [p for p in body.places if not self.known.is_settled[p]]
        self._in_vain[body.stations[0]] = reached, body.stations
        for point in body.places:
            self.scratch.forget_point(point)
        return placed

    def _height(self, point: int) -> float | None:
        """Height of a point above the reference point, where it is known or given."""
        height, given = self.known.height(point), self.known.given_heights.get(point)
        return given - self.known.reference_height if height is None and given is not None else height

    def _lay(self, body: Body, turn: FloatArray) -> None:
        """Puts a body into the scratch, turned upright."""
        for point, place in body.places.items():
            east, north, up = (turn @ place).tolist()
            self.scratch.positions[point], self.scratch.has_height[point] = (east, north, up), 1
            self.scratch.point_steps[point] = Step("axes of the instrument", body.rows[point])

    def _misfit(self, located: list[int], heights: Mapping[int, float | None]) -> float:
        """How far (m) what is laid in the scratch is from what is known; infinite where nothing ties it."""
        common = [point for point in located if self.known.is_settled[point]]
        tie = self._solve(common, located, is_scaled=False) if common else None
        if tie is None:
            return math.inf
        away = []
        for point in common:
            there = tie.move(self.known, self.scratch.position_of(point))
            vertical = self.known.vertical_of(point)
            away.append(math.hypot(*times(vertical, minus(there, self.known.position_of(point)))[:2]))
        ups = [self.scratch.position_of(point)[2] - h for point, h in heights.items() if h is not None]
        return math.hypot(*away, *(up - sum(ups) / len(ups) for up in ups))

    def _tied(self, station: int, placement: Placement, *, is_scaled: bool = False) -> list[int]:
        """Moves what was placed in the scratch to what is known, and empties the scratch."""
        touched = dict.fromkeys(placement.touched_points)
        located = [point for point in touched if self.scratch.is_settled[point]]
        placed = self._tie(station, located, is_scaled=is_scaled)
        reached = [] if placed or is_scaled else [p for p in located if not self.known.is_settled[p]]
        self._in_vain[station] = reached, placement.oriented
        self._forget(placement)
        return placed

    def _forget(self, placement: Placement) -> None:
        """Empties the scratch for the next group."""
        for point in placement.touched_points:
            self.scratch.forget_point(point)
        for station in placement.oriented:
            self.scratch.forget_station(station)
        self.scratch.reference = None

    def _tie(self, station: int, located: list[int], *, is_scaled: bool) -> list[int]:
        """Moves the located points of the scratch that are new to what is known."""
        common = [point for point in located if self.known.is_settled[point]]
        tie = self._solve(common, located, is_scaled=is_scaled) if common else None
        if tie is None:
            return []
        name = self.known.names[self.graph.origins[station]]
        anchors = ", ".join(self.known.names[point] for point in common[:3])
        placed = []
        for point in located:
            if not self.known.is_settled[point] and self.known.positions[point] is None:
                step = step_of(self.scratch.point_steps[point] or Step(""), self.graph.sights.rows)
                method = f"local frame of station {name} tied to {anchors}"
                self.known.positions[point] = tie.move(self.known, self.scratch.position_of(point))
                self.known.has_height[point] = tie.rise is not None and bool(self.scratch.has_height[point])
                self.known.point_steps[point] = Step(method, step.observations)
                self._take_point_sigma(point, tie)
                placed.append(point)
        return placed

    def _take_point_sigma(self, point: int, tie: _Tie) -> None:
        """The errors of the local frame and of the tie; the local relations remain those of the group."""
        known, local = self.known, self.scratch
        known.point_sigmas[point] = math.hypot(local.point_sigmas[point], tie.point_sigma)
        known.relative_sigmas[point], known.parents[point] = (
            local.relative_sigmas[point],
            local.parents[point],
        )

    def _solve(self, common: list[int], located: list[int], *, is_scaled: bool) -> _Tie | None:
        """Least-squares rotation about the vertical and translation; None where nothing gives them.

        With scale, if it `is_scaled`; heights have no part in that. Where the base is too short, azimuths
        give the rotation, and nothing a scale.
        """
        origin = common[0]
        vertical, start = self.known.vertical_of(origin), self.known.position_of(origin)
        weights = [1.0 / (self._common_point_sigma(point) ** 2 + 1e-12) for point in common]
        real = [times(vertical, minus(self.known.position_of(point), start)) for point in common]
        local = [self.scratch.position_of(point) for point in common]
        local_centre, centre = _centre(local, weights), _centre(real, weights)
        base = max(math.dist(position[:2], local_centre) for position in local)
        size = max(math.dist(self.scratch.position_of(point)[:2], local_centre) for point in located)
        point_sigma = max(self.known.point_sigmas[point] for point in common)
        if base <= max(_LEAST_BASE * size, 1e-3):
            angle = None if is_scaled else self._angle_by_azimuths(located)
            rise = self._rise(common, local, real)
            return None if angle is None else _Tie(origin, angle, local_centre, centre, rise, point_sigma)
        cross = dot = square = 0.0
        for p, q, weight in zip(local, real, weights, strict=True):
            a, b = (p[0] - local_centre[0], p[1] - local_centre[1]), (q[0] - centre[0], q[1] - centre[1])
            cross += weight * (b[0] * a[1] - b[1] * a[0])
            dot += weight * (a[0] * b[0] + a[1] * b[1])
            square += weight * (a[0] * a[0] + a[1] * a[1])
        scale = math.hypot(cross, dot) / square if is_scaled else 1.0
        rise = None if is_scaled else self._rise(common, local, real)
        return _Tie(origin, math.atan2(cross, dot), local_centre, centre, rise, point_sigma, scale)

    def _angle_by_azimuths(self, located: list[int]) -> float | None:
        """The turn that azimuths between located points of the scratch ask for; None where there are none."""
        angles, ends = [], set(located)
        for a, b, azimuth in self._azimuths:
            if a in ends and b in ends:
                east, north, _ = minus(self.scratch.position_of(b), self.scratch.position_of(a))
                angles.append(wrap(azimuth - math.atan2(east, north)))
        return central_angle(angles) if angles else None

    def _common_point_sigma(self, point: int) -> float:
        return math.hypot(self.known.point_sigmas[point], self.scratch.point_sigmas[point])

    def _rise(self, common: list[int], local: list[Space], real: list[Space]) -> float | None:
        """Mean height of the real points above the local ones."""
        rises = [
            q[2] - p[2]
            for point, p, q in zip(common, local, real, strict=True)
            if self.known.is_placed(point) and self.scratch.has_height[point]
        ]
        return sum(rises) / len(rises) if rises else None


def _centre(points: list[Space], weights: list[float]) -> tuple[float, float]:
    total = sum(weights)
    east = sum(weight * point[0] for point, weight in zip(points, weights, strict=True))
    north = sum(weight * point[1] for point, weight in zip(points, weights, strict=True))
    return east / total, north / total
