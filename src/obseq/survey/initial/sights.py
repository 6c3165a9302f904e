"""Sights: what each station measured to each target, and who is linked to whom.

Only active observations count. When a quantity was measured several times, the first one is used: initial
values need one, and the first is the one that a reader of the file finds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE
from obseq.survey.model import FieldBook, Orientation

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Measure = tuple[float, int]
"""A measured value (m, rad) and the row of its observation."""


@dataclass(slots=True)
class Sight:
    """Measures of one station to one target, in the frame of the instrument.

    `distance` is the slope distance between the two points, whoever measured it.
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

    def reading(self) -> tuple[float, tuple[int, ...]] | None:
        """Reading of the horizontal circle and its observations; from DX and DY when there is no Hz."""
        if self.hz is not None:
            return self.hz[0], (self.hz[1],)
        if self.dx is None or self.dy is None or self.dx[0] == self.dy[0] == 0.0:
            return None
        return math.atan2(self.dx[0], self.dy[0]), (self.dx[1], self.dy[1])

    def vector(self) -> tuple[tuple[float, float, float], tuple[int, ...]] | None:
        """Target in the frame of the instrument and the observations it comes from."""
        if self.dx is not None and self.dy is not None and self.dz is not None:
            return (self.dx[0], self.dy[0], self.dz[0]), (self.dx[1], self.dy[1], self.dz[1])
        if self.hz is None or self.zenith is None or self.distance is None:
            return None
        rows = (self.hz[1], self.zenith[1], self.distance[1])
        return direction(self.hz[0], self.zenith[0], self.distance[0]), rows

    def lengths(self) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise for a plumb instrument, with their observations."""
        if self.dx is not None and self.dy is not None and self.dz is not None:
            return (math.hypot(self.dx[0], self.dy[0]), self.dz[0]), (self.dx[1], self.dy[1], self.dz[1])
        if self.zenith is None or self.distance is None:
            return None
        _, flat, rise = direction(0.0, self.zenith[0], self.distance[0])
        return (flat, rise), (self.zenith[1], self.distance[1])


def direction(azimuth: float, zenith: float, length: float = 1.0) -> tuple[float, float, float]:
    """Vector of a length, from an angle clockwise from y and a zenith angle."""
    flat = length * math.sin(zenith)
    return flat * math.sin(azimuth), flat * math.cos(azimuth), length * math.cos(zenith)


@dataclass
class Graph:
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
        stations_at: of each point, its stations.
        distances: of each point, (other point, distance, row), one per pair.
        height_differences: of each point, (other point, height above it, row).
    """

    orientations: list[Orientation]
    origins: list[int]
    sigmas: list[float]
    is_angle: list[bool]
    sights: list[Sight] = field(default_factory=list)
    sight_of: dict[tuple[int, int], int] = field(default_factory=dict)
    sights_from: list[list[int]] = field(default_factory=list)
    sights_to: list[list[int]] = field(default_factory=list)
    stations_at: list[list[int]] = field(default_factory=list)
    distances: list[list[tuple[int, float, int]]] = field(default_factory=list)
    height_differences: list[list[tuple[int, float, int]]] = field(default_factory=list)


def build_graph(book: FieldBook, n_points: int, orientations: npt.NDArray[np.int8]) -> Graph:
    """The graph of a field book whose rows are rows of `n_points` points."""
    graph = Graph(
        orientations=[Orientation(value) for value in orientations.tolist()],
        origins=book.stations.origins.tolist(),
        sigmas=book.observations.sigmas.tolist(),
        is_angle=IS_ANGLE[book.observations.types].tolist(),
        sights_from=[[] for _ in range(len(book.stations))],
        sights_to=[[] for _ in range(n_points)],
        stations_at=[[] for _ in range(n_points)],
        distances=[[] for _ in range(n_points)],
        height_differences=[[] for _ in range(n_points)],
    )
    for station, origin in enumerate(graph.origins):
        graph.stations_at[origin].append(station)
    distances = _collect(graph, book)
    for sight in graph.sights:
        sight.distance = distances.get(_pair(sight.origin, sight.target))
    return graph


def _pair(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _collect(graph: Graph, book: FieldBook) -> dict[tuple[int, int], Measure]:
    """Fills the graph from the columns; returns the first distance of each pair of points."""
    columns = book.observations
    distances: dict[tuple[int, int], Measure] = {}
    rows = zip(
        columns.types.tolist(),
        columns.from_points.tolist(),
        columns.to_points.tolist(),
        columns.values.tolist(),
        columns.from_heights.tolist(),
        columns.to_heights.tolist(),
        columns.stations.tolist(),
        columns.active.tolist(),
        strict=True,
    )
    for row, (code, origin, target, measured, low, high, station, active) in enumerate(rows):
        kind = BY_CODE[code]
        if not active or kind.start is Start.NOTHING:
            continue
        value = kind.start_value(measured, low, high)
        if kind.start is Start.DISTANCE:
            if distances.setdefault(_pair(origin, target), (value, row)) == (value, row):
                graph.distances[origin].append((target, value, row))
                graph.distances[target].append((origin, value, row))
        elif kind.start is Start.RISE:
            graph.height_differences[origin].append((target, -value, row))
            graph.height_differences[target].append((origin, value, row))
        else:
            sight = _sight(graph, station, origin, target)
            if getattr(sight, kind.start.value) is None:
                setattr(sight, kind.start.value, (value, row))
    return distances


def _sight(graph: Graph, station: int, origin: int, target: int) -> Sight:
    number = graph.sight_of.setdefault((station, target), len(graph.sights))
    if number == len(graph.sights):
        graph.sights.append(Sight(station, origin, target))
        graph.sights_from[station].append(number)
        graph.sights_to[target].append(number)
    return graph.sights[number]
