"""Points at the end of a complete vector from an oriented station: azimuth, zenith angle and distance."""

from __future__ import annotations

import math

from obseq.survey.initial.closed_forms import Space, plus, scaled
from obseq.survey.initial.known import Known, times, transposed_times, turned
from obseq.survey.model import Orientation
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import Cause, Sight, Step

Polar = tuple[Space, float, Cause]
"""A vector (instrument) from a station to a point, its expected error (m) and where it comes from."""

LARGEST_SIGMA = 1e6
"""The expected error (m) of what is not known any better."""


class PolarSights:
    """Places single points by the surest of the sights to them.

    Args:
        known: what is known; the points that are placed are added to it, and remain to be settled.
        graph: the observations.
        stations: the stations that may be used; all when None.
    """

    def __init__(self, known: Known, graph: SightGraph, stations: frozenset[int] | None) -> None:
        self.known, self.graph, self.stations = known, graph, stations

    def place(self, point: int) -> bool:
        """Places a point by the vector with the least expected error, if there is one."""
        steps, station_of = self.known.station_steps, self.graph.station_of
        best, least = -1, math.inf
        for number in self.graph.sights_to[point]:
            station = station_of[number]
            if steps[station] is not None and (self.stations is None or station in self.stations):
                point_sigma = self._point_sigma(number, station, self.graph.origins[station])
                if point_sigma < least:
                    best, least = number, point_sigma
        if best >= 0:
            self._take(point, best, least)
        return best >= 0

    def _point_sigma(self, number: int, station: int, origin: int) -> float:
        """Expected error of the end of a sight (m), infinite where nothing gives its vector or its start."""
        if not self.known.is_placed(origin):
            return math.inf
        length, relative_sigma = self.graph.length_of[number], self.graph.vector_sigma_of[number]
        if math.isnan(length):
            polar = self._borrowed(number, station)
            if polar is None:
                return math.inf
            length, relative_sigma = math.hypot(*polar[0]), polar[1]
        moved = length * self.known.azimuth_sigmas[station]
        return min(math.hypot(self.known.point_sigmas[origin] + moved, relative_sigma), LARGEST_SIGMA)

    def _polar(self, number: int, station: int) -> Polar:
        """The vector of a sight that has one, perhaps with the help of others."""
        polar = self._borrowed(number, station) if math.isnan(self.graph.length_of[number]) else None
        if polar is not None:
            return polar
        return self.graph.sights.vectors[number].tolist(), self.graph.vector_sigma_of[number], (number,)

    def _borrowed(self, number: int, station: int) -> Polar | None:
        """Vector of a plumb sight that borrows the zenith angle of another station on the same point."""
        sight = self.graph.sights[number]
        reading, lengths = sight.reading(), self._lengths(sight)
        if self.known.g0[station] is None or reading is None or lengths is None:
            return None
        (flat, rise), rows = lengths
        local = flat * math.sin(reading[0]), flat * math.cos(reading[0]), rise
        every = tuple(dict.fromkeys(reading[1] + rows))
        return local, vector_sigma(self.graph, local, every), Step("azimuth and distance", every)

    def _lengths(self, sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise of a plumb sight, perhaps from another plumb station on the point."""
        graph = self.graph
        for number in graph.sights_to[sight.target]:
            is_plumb = graph.orientations[graph.station_of[number]] != Orientation.BASC.value
            if is_plumb and graph.origin_of[number] == sight.origin:
                lengths = graph.sights[number].lengths()
                if lengths is not None:
                    return lengths
        return self._levelled_lengths(sight)

    def _levelled_lengths(self, sight: Sight) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise from the slope distance and a levelled height of the target."""
        if sight.distance is None:
            return None
        start, end = self.known.height(sight.origin), self.known.height(sight.target)
        if start is None or end is None or abs(end - start) >= sight.distance[0]:
            return None
        (distance, row), rise = sight.distance, end - start
        levelled = (
            line
            for other, _, line in self.graph.height_differences[sight.target]
            if self.known.height(other) is not None
        )
        return (math.sqrt(distance**2 - rise**2), rise), (row, *list(levelled)[:1])

    def _take(self, point: int, number: int, point_sigma: float) -> None:
        known, station, origin = self.known, self.graph.station_of[number], self.graph.origin_of[number]
        local, relative_sigma, cause = self._polar(number, station)
        moved = in_frame(known, station, origin, local, float(self.graph.sights.measures.lifts[number]))
        known.positions[point] = plus(known.position_of(origin), moved)
        known.has_height[point], known.point_steps[point] = 1, cause
        known.parents[point], known.relative_sigmas[point] = station, relative_sigma
        known.point_sigmas[point] = point_sigma


def in_frame(known: Known, station: int, origin: int, local: Space, lift: float) -> Space:
    """A vector of an oriented instrument on a located point, in the frame, from ground to ground."""
    rotation = known.rotations[station]
    if rotation is not None:
        x, y, z = local
        seen = times(rotation, (x, y, z + lift))
        return plus(seen, scaled(known.vertical_of(origin)[2], -lift))
    return transposed_times(known.vertical_of(origin), turned(local, known.g0[station] or 0.0))


def vector_sigma(graph: SightGraph, vector: Space, rows: tuple[int, ...]) -> float:
    """Expected error (m) of a vector from the sigmas of its observations."""
    length = math.hypot(*vector)
    return math.hypot(*(graph.sigmas[row] * (length if graph.is_angle[row] else 1.0) for row in rows))
