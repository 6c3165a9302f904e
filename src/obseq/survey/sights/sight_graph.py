"""Who is linked to whom: the active observations of a field book as a graph of points and stations."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.model import Orientation
from obseq.survey.sights.sights import Sights, lengths

_OF_LINKS = ("is_plumb", "station_of", "origin_of", "target_of", "sights_from", "sights_to", "stations_at")
"""What graphs that differ in numbers only have in common."""

Joined = tuple[int, float, int]
"""What joins a point with another: the other point, the value (m) seen from there, and the row."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Observations between two points: (k,) rows, first points, second points, and values (m, rad)."""

    rows: IntArray
    origins: IntArray
    targets: IntArray
    values: FloatArray

    def chosen(self, which: IntArray) -> Measured:
        """Some of them."""
        return Measured(self.rows[which], self.origins[which], self.targets[which], self.values[which])

    def ends(self) -> Iterator[tuple[int, int]]:
        """The two points of each."""
        return zip(self.origins.tolist(), self.targets.tolist(), strict=True)

    def by_points(self, n_points: int, sign: float = 1.0) -> list[list[Joined]]:
        """Of each point, those that join it with others; with a sign where they are seen from the first."""
        found: list[list[Joined]] = [[] for _ in range(n_points)]
        columns = zip(self.ends(), self.values.tolist(), self.rows.tolist(), strict=True)
        for (origin, target), value, row in columns:
            found[origin].append((target, sign * value, row))
            found[target].append((origin, value, row))
        return found


def _integers(column: IntArray) -> array[int]:
    return array("q", column.tobytes())


def decimals(column: FloatArray) -> array[float]:
    """A column of plain numbers: looked up as fast as in a list, in a quarter of the memory."""
    return array("d", column.tobytes())


def _numbers_by(groups: Iterable[int], n: int) -> list[tuple[int, ...]]:
    """Of each of n groups, the numbers of its members."""
    found: list[list[int]] = [[] for _ in range(n)]
    for number, group in enumerate(groups):
        found[group].append(number)
    return list(map(tuple, found))


@dataclass(frozen=True, eq=False)
class SightGraph:
    """The field book as a graph: for each point and station, its sights, distances and height differences.

    What is looked at one by one is kept as columns of plain numbers too, each made when it is first needed.

    Attributes:
        orientations: of each station, after the automatic-FIX rule.
        origins: point of each station.
        n_points: number of points.
        sigmas: of each observation (m, rad).
        is_angle: (k,) of each observation, true for Hz and Zen.
        sights: all of them.
        slopes: slope distances, one per pair of points.
        flats: horizontal distances.
        rises: height differences.
        bend: what zenith angles have been corrected by for each metre of a distance (rad / m).
    """

    orientations: list[int]
    origins: list[int]
    n_points: int
    sigmas: array[float]
    is_angle: BoolArray
    sights: Sights
    slopes: Measured
    flats: Measured
    rises: Measured
    bend: float = 0.0

    def with_numbers(
        self, sigmas: array[float], sights: Sights, slopes: Measured, flats: Measured, rises: Measured
    ) -> SightGraph:
        """The same graph with other numbers; who is linked to whom is not looked up again."""
        graph = replace(self, sigmas=sigmas, sights=sights, slopes=slopes, flats=flats, rises=rises)
        vars(graph).update({name: found for name, found in vars(self).items() if name in _OF_LINKS})
        return graph

    @cached_property
    def is_plumb(self) -> BoolArray:
        """Of each station, whether it is plumb with an unknown zero (#VERT)."""
        return np.asarray(np.array(self.orientations) == Orientation.VERT.value)

    @cached_property
    def station_of(self) -> array[int]:
        """Station of each sight."""
        return _integers(self.sights.stations)

    @cached_property
    def origin_of(self) -> array[int]:
        """Point of the station of each sight."""
        return _integers(self.sights.origins)

    @cached_property
    def target_of(self) -> array[int]:
        """Target of each sight."""
        return _integers(self.sights.targets)

    @cached_property
    def length_of(self) -> array[float]:
        """Length of the vector of each sight (m); NaN where it is not complete."""
        return decimals(lengths(self.sights.vectors.T))

    @cached_property
    def vector_sigma_of(self) -> array[float]:
        """Expected error of the vector of each sight (m)."""
        return decimals(self.sights.vector_sigmas)

    @cached_property
    def reading_of(self) -> array[float]:
        """Reading of each sight (rad); NaN where there is none."""
        return decimals(self.sights.readings)

    @cached_property
    def reading_sigma_of(self) -> array[float]:
        """Sigma of the reading of each sight (rad), 0 where DX and DY stand for it."""
        return decimals(self.sights.reading_sigmas)

    @cached_property
    def shift_sigma_of(self) -> array[float]:
        """Sigma of the DX and DY that stand for the reading of each sight (m), else 0."""
        return decimals(self.sights.shift_sigmas)

    @cached_property
    def sights_from(self) -> list[tuple[int, ...]]:
        """Sights of each station."""
        return _numbers_by(self.station_of, len(self.origins))

    @cached_property
    def sights_to(self) -> list[tuple[int, ...]]:
        """Sights to each point."""
        return _numbers_by(self.target_of, self.n_points)

    @cached_property
    def stations_at(self) -> list[tuple[int, ...]]:
        """Stations on each point."""
        return _numbers_by(self.origins, self.n_points)

    def neighbours(self, point: int) -> list[int]:
        """Points that observations join with one, some of them twice."""
        found = [target for station in self.stations_at[point] for target in self.targets(station)]
        found += [self.origin_of[number] for number in self.sights_to[point]]
        for joined in (self.distances, self.height_differences, self.flat_distances):
            found += [other for other, _, _ in joined[point]]
        return found

    def beside(self, points: BoolArray) -> BoolArray:
        """(n,) the points that observations join with some of a mask (n,)."""
        found = np.zeros(self.n_points, np.bool_)
        for joined in (self.sights, self.slopes, self.flats, self.rises):
            found[joined.targets[points[joined.origins]]] = True
            found[joined.origins[points[joined.targets]]] = True
        return found

    @cached_property
    def distances(self) -> list[list[Joined]]:
        """Of each point, the slope distances to others."""
        return self.slopes.by_points(self.n_points)

    @cached_property
    def flat_distances(self) -> list[list[Joined]]:
        """Of each point, the horizontal distances to others."""
        return self.flats.by_points(self.n_points)

    @cached_property
    def height_differences(self) -> list[list[Joined]]:
        """Of each point, how much higher it is than others."""
        return self.rises.by_points(self.n_points, -1.0)

    def targets(self, station: int) -> list[int]:
        """The points that a station sights."""
        return [self.target_of[number] for number in self.sights_from[station]]

    def sight_between(self, station: int, target: int) -> int | None:
        """The first sight of a station to a target, if there is one."""
        return self._sights_between.get((station, target))

    @cached_property
    def _sights_between(self) -> dict[tuple[int, int], int]:
        pairs = zip(self.station_of, self.target_of, strict=True)
        return {pair: number for number, pair in reversed(list(enumerate(pairs)))}

    def reading_between(self, station: int, target: int) -> float:
        """Reading of a station to a target (rad); NaN where there is none."""
        number = self.sight_between(station, target)
        return math.nan if number is None else self.reading_of[number]

    def reading_rows(self, number: int) -> tuple[int, ...]:
        """The observations of the reading of a sight; none when it has none."""
        reading = self.sights[number].reading()
        return () if reading is None else reading[1]

    def reading_sigma(self, number: int, distance: float) -> float:
        """Sigma of the reading of a sight (rad), also of one made from DX and DY over a distance (m)."""
        return self.reading_sigma_of[number] + self.shift_sigma_of[number] / distance
