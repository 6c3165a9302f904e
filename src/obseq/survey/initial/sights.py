"""Sights: what each station measured to each target, and who is linked to whom.

Only active observations count. When a quantity was measured several times, the first one is used: initial
values need one, and the first is the one that a reader of the file finds.
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import IS_ANGLE, KINDS
from obseq.survey.model import FieldBook, Orientation

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from obseq.survey.kinds.kind import ObservationKind

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_OF_SIGHTS = frozenset((Start.HZ, Start.ZENITH, Start.DX, Start.DY, Start.DZ))
Measure = tuple[float, int]
"""A measured value (m, rad) and the row of its observation."""


Measured = tuple[int, int, int, float]
"""Row, first point, second point and value (m, rad) of an observation."""

Vector = tuple[tuple[float, float, float], tuple[int, ...]]
"""A vector (m) and the rows of its observations."""


@dataclass(slots=True)
class Sight:
    """Measures of one station to one target, in the frame of the instrument.

    `distance` is the slope distance between the two points, whoever measured it. `lift` is how much higher
    the target is above its ground than the instrument above its own. `vector_sigma` is the expected error of
    the vector.
    """

    station: int
    origin: int
    target: int
    hz: Measure | None = None
    zenith: Measure | None = None
    dx: Measure | None = None
    dy: Measure | None = None
    dz: Measure | None = None
    distance: Measure | None = None
    lift: float = 0.0
    vector_sigma: float = 0.0
    _vector: Vector | None = None

    def complete(self, sigmas: Sequence[float]) -> None:
        """Makes the vector and its sigma from the measures, once they are all there."""
        hz, zenith, distance = self.hz, self.zenith, self.distance
        if self.dx is not None and self.dy is not None and self.dz is not None:
            rows = (self.dx[1], self.dy[1], self.dz[1])
            self._vector = (self.dx[0], self.dy[0], self.dz[0]), rows
            self.vector_sigma = math.hypot(*(sigmas[row] for row in rows))
        elif hz is not None and zenith is not None and distance is not None:
            length = distance[0]
            x, y, z = direction(hz[0], zenith[0], length)
            self._vector = (x, y, z - self.lift), (hz[1], zenith[1], distance[1])
            across, around, along = sigmas[hz[1]] * length, sigmas[zenith[1]] * length, sigmas[distance[1]]
            self.vector_sigma = math.hypot(across, around, along)

    def reading(self) -> tuple[float, tuple[int, ...]] | None:
        """Reading of the horizontal circle and its observations; from DX and DY when there is no Hz."""
        if self.hz is not None:
            return self.hz[0], (self.hz[1],)
        if self.dx is None or self.dy is None or self.dx[0] == self.dy[0] == 0.0:
            return None
        return math.atan2(self.dx[0], self.dy[0]), (self.dx[1], self.dy[1])

    def vector(self) -> Vector | None:
        """Target in the frame of the instrument and the observations it comes from."""
        return self._vector

    def lengths(self) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise for a plumb instrument, with their observations."""
        if self.dx is not None and self.dy is not None and self.dz is not None:
            return (math.hypot(self.dx[0], self.dy[0]), self.dz[0]), (self.dx[1], self.dy[1], self.dz[1])
        if self.zenith is None or self.distance is None:
            return None
        _, flat, rise = direction(0.0, self.zenith[0], self.distance[0])
        return (flat, rise - self.lift), (self.zenith[1], self.distance[1])


def direction(azimuth: float, zenith: float, length: float = 1.0) -> tuple[float, float, float]:
    """Vector of a length, from an angle clockwise from y and a zenith angle."""
    flat = length * math.sin(zenith)
    return flat * math.sin(azimuth), flat * math.cos(azimuth), length * math.cos(zenith)


@dataclass
class SightGraph:
    """The field book as a graph: for each point and station, its sights, distances and height differences.

    Attributes:
        orientations: of each station, after the automatic-FIX rule.
        origins: point of each station.
        sigmas: of each observation (m, rad).
        is_angle: of each observation, true for Hz and Zen.
        sights: all of them, in reading order.
        sight_of: index in `sights` of a station and a target.
        sights_from: of each station, indices in `sights`.
        sights_to: of each point, indices in `sights`.
        targets: of each station, the points that it sights.
        neighbours: of each point, the points that sights or distances join with it.
        stations_at: of each point, its stations.
        distances: of each point, (other point, distance, row), one per pair.
        height_differences: of each point, (other point, height above it, row).
        flats: of each point, (other point, horizontal distance, row), one per pair.
    """

    orientations: list[Orientation]
    origins: list[int]
    sigmas: list[float]
    is_angle: list[bool]
    sights: list[Sight] = field(default_factory=list)
    sight_of: dict[tuple[int, int], int] = field(default_factory=dict)
    sights_from: list[list[int]] = field(default_factory=list)
    sights_to: list[list[int]] = field(default_factory=list)
    targets: list[set[int]] = field(default_factory=list)
    neighbours: list[set[int]] = field(default_factory=list)
    stations_at: list[list[int]] = field(default_factory=list)
    distances: list[list[tuple[int, float, int]]] = field(default_factory=list)
    height_differences: list[list[tuple[int, float, int]]] = field(default_factory=list)
    flats: list[list[tuple[int, float, int]]] = field(default_factory=list)


def build_graph(
    book: FieldBook, n_points: int, orientations: npt.NDArray[np.int8], *, is_level: bool = False
) -> SightGraph:
    """The graph of a field book whose rows are rows of `n_points` points.

    The angles at a point from one backsight become a plumb station with the reading 0 there; such stations
    come after those of the field book.

    Args:
        book: the field book.
        n_points: number of points.
        orientations: of its stations.
        is_level: whether all points have the same height: every sight is level then.
    """
    graph = SightGraph(
        orientations=[Orientation(value) for value in orientations.tolist()],
        origins=book.stations.origins.tolist(),
        sigmas=book.observations.sigmas.tolist(),
        is_angle=IS_ANGLE[book.observations.types].tolist(),
        sights_from=[[] for _ in range(len(book.stations))],
        sights_to=[[] for _ in range(n_points)],
        targets=[set() for _ in range(len(book.stations))],
        neighbours=[set() for _ in range(n_points)],
        stations_at=[[] for _ in range(n_points)],
        distances=[[] for _ in range(n_points)],
        height_differences=[[] for _ in range(n_points)],
        flats=[[] for _ in range(n_points)],
    )
    for station, origin in enumerate(graph.origins):
        graph.stations_at[origin].append(station)
    _collect(graph, book, is_level=is_level)
    return graph


def _pair(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _collect(graph: SightGraph, book: FieldBook, *, is_level: bool) -> None:
    """Fills the graph from the columns, kind by kind."""
    observations = book.observations
    usable = np.flatnonzero(observations.active)
    of_sights = [kind.code for kind in KINDS if kind.start in _OF_SIGHTS]
    sight_of = _add_sights(graph, book, usable[np.isin(observations.types[usable], of_sights)])
    distances: dict[tuple[int, int], Measure] = {}
    for kind in KINDS:
        rows = usable[observations.types[usable] == kind.code]
        if not len(rows) or kind.start is Start.NOTHING:
            continue
        measured = _start_values(book, kind, rows)
        if kind.start is Start.DISTANCE or (kind.start is Start.FLAT and is_level):
            _add_distances(graph, measured, distances, graph.distances)
        elif kind.start is Start.FLAT:
            _add_distances(graph, measured, {}, graph.flats)
        elif kind.start is Start.ANGLE:
            _add_angles(graph, measured, observations.backsights[rows].tolist())
        elif kind.start is Start.RISE:
            _add_rises(graph, measured)
        else:
            _add_measures(graph, book, kind, measured, sight_of[rows])
    for sight in graph.sights:
        if is_level and sight.zenith is None and sight.hz is not None:
            sight.zenith = math.pi / 2.0, sight.hz[1]
        sight.distance = distances.get(_pair(sight.origin, sight.target))
        sight.complete(graph.sigmas)


def _start_values(book: FieldBook, kind: ObservationKind, rows: Rows) -> list[Measured]:
    """Row, first point, second point and value of observations of one kind."""
    observations = book.observations
    heights = observations.from_heights[rows], observations.to_heights[rows]
    values = kind.start_values(observations.values[rows], *heights)
    columns = rows, observations.from_points[rows], observations.to_points[rows], values
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _add_sights(graph: SightGraph, book: FieldBook, rows: Rows) -> Rows:
    """One sight for each station and target, in reading order; returns the one of each observation."""
    observations = book.observations
    pairs = observations.stations[rows].astype(np.int64) * len(graph.sights_to) + observations.to_points[rows]
    _, firsts, pair_of = np.unique(pairs, return_index=True, return_inverse=True)
    order = np.argsort(firsts)
    numbers = np.empty(len(order), np.intp)
    numbers[order] = np.arange(len(order))
    chosen = rows[firsts[order]]
    columns = observations.stations[chosen], observations.from_points[chosen], observations.to_points[chosen]
    stations, origins, targets = (column.tolist() for column in columns)
    graph.sights.extend(map(Sight, stations, origins, targets))
    graph.sight_of.update(zip(zip(stations, targets, strict=True), range(len(stations)), strict=True))
    for number, sight in enumerate(graph.sights):
        _link_sight(graph, number, sight)
    sight_of = np.full(len(observations), -1, np.intp)
    sight_of[rows] = numbers[pair_of]
    return sight_of


def _add_measures(
    graph: SightGraph, book: FieldBook, kind: ObservationKind, measured: list[Measured], numbers: Rows
) -> None:
    """Gives each sight, by its number, the first of its measures of a kind."""
    slot, is_zenith, sights = kind.start.value, kind.start is Start.ZENITH, graph.sights
    firsts = np.unique(numbers, return_index=True)[1].tolist()
    for k, number in zip(firsts, numbers[firsts].tolist(), strict=True):
        row, _, _, value = measured[k]
        sight = sights[number]
        if getattr(sight, slot) is None:
            setattr(sight, slot, (value, row))
            if is_zenith:
                heights = book.observations.from_heights[row], book.observations.to_heights[row]
                sight.lift = float(heights[1] - heights[0])


def _add_distances(
    graph: SightGraph,
    measured: list[Measured],
    first: dict[tuple[int, int], Measure],
    of_points: list[list[tuple[int, float, int]]],
) -> None:
    for row, origin, target, value in measured:
        pair = _pair(origin, target)
        if pair not in first:
            first[pair] = value, row
            of_points[origin].append((target, value, row))
            of_points[target].append((origin, value, row))
            graph.neighbours[origin].add(target)
            graph.neighbours[target].add(origin)


def _add_angles(graph: SightGraph, measured: list[Measured], backsights: list[int]) -> None:
    """Stations of their own: the backsight reads 0, the others their angles."""
    stations: dict[tuple[int, int], int] = {}
    for (row, origin, target, value), backsight in zip(measured, backsights, strict=True):
        station = stations.get((origin, backsight))
        if station is None:
            station = stations[origin, backsight] = len(graph.origins)
            graph.origins.append(origin)
            graph.orientations.append(Orientation.VERT)
            graph.stations_at[origin].append(station)
            graph.sights_from.append([])
            graph.targets.append(set())
            _add_sight(graph, station, target=backsight, origin=origin, hz=(0.0, row))
        if (station, target) not in graph.sight_of:
            _add_sight(graph, station, target=target, origin=origin, hz=(value, row))


def _add_sight(graph: SightGraph, station: int, target: int, origin: int, hz: Measure | None = None) -> None:
    number = graph.sight_of[station, target] = len(graph.sights)
    graph.sights.append(Sight(station, origin, target, hz))
    _link_sight(graph, number, graph.sights[number])


def _link_sight(graph: SightGraph, number: int, sight: Sight) -> None:
    station, origin, target = sight.station, sight.origin, sight.target
    graph.sights_from[station].append(number)
    graph.sights_to[target].append(number)
    graph.targets[station].add(target)
    graph.neighbours[target].add(origin)
    graph.neighbours[origin].add(target)


def _add_rises(graph: SightGraph, measured: list[Measured]) -> None:
    for row, origin, target, value in measured:
        graph.height_differences[origin].append((target, -value, row))
        graph.height_differences[target].append((origin, value, row))
