"""Sights: what each station measured to each target, and by which of them points and stations were placed.

When a quantity was measured several times, the first one is used: initial values need one, and the first is
the one that a reader of the file finds. All sights together are arrays; one of them is a `Sight`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from itertools import chain
from typing import NamedTuple, overload

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IndexRows, IntArray, IntRows
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start

Measure = tuple[float, int]
"""A measured value (m, rad) and the row of its observation."""

Vector = tuple[tuple[float, float, float], tuple[int, ...]]
"""A vector (m) and the rows of its observations."""

SLOTS = (Start.HZ, Start.ZENITH, Start.DISTANCE, Start.DX, Start.DY, Start.DZ)
"""What is measured of a sight, in the order of the rows of `Measures`."""
HZ, ZENITH, DISTANCE, DX, DY, DZ = range(6)
_POLAR, _SHIFTS = slice(HZ, DX), slice(DX, None)


@dataclass(slots=True)
class Sight:
    """Measures of one station to one target, in the frame of the instrument.

    `distance` is the slope distance between the two points, whoever measured it. `lift` is how much higher
    the target is above its ground than the instrument above its own. `vector` leads from ground to ground in
    the frame of the instrument, its last axis being taken for the vertical, with its observations.
    """

    station: int
    origin: int
    target: int
    hz: Measure | None = None
    zenith: Measure | None = None
    distance: Measure | None = None
    dx: Measure | None = None
    dy: Measure | None = None
    dz: Measure | None = None
    lift: float = 0.0
    vector: Vector | None = None

    def reading(self) -> tuple[float, tuple[int, ...]] | None:
        """Reading of the horizontal circle and its observations; from DX and DY when there is no Hz."""
        if self.hz is not None:
            return self.hz[0], (self.hz[1],)
        if self.dx is None or self.dy is None or self.dx[0] == self.dy[0] == 0.0:
            return None
        return math.atan2(self.dx[0], self.dy[0]), (self.dx[1], self.dy[1])

    def lengths(self) -> tuple[tuple[float, float], tuple[int, ...]] | None:
        """Horizontal distance and rise for a plumb instrument, with their observations."""
        if self.dx is not None and self.dy is not None and self.dz is not None:
            flat, rise = math.hypot(self.dx[0], self.dy[0]), self.dz[0] - self.lift
            return (flat, rise), (self.dx[1], self.dy[1], self.dz[1])
        if self.zenith is None or self.distance is None:
            return None
        _, flat, rise = direction(0.0, self.zenith[0], self.distance[0])
        return (flat, rise - self.lift), (self.zenith[1], self.distance[1])


def direction(azimuth: float, zenith: float, length: float = 1.0) -> tuple[float, float, float]:
    """Vector of a length, from an angle clockwise from y and a zenith angle."""
    flat = length * math.sin(zenith)
    return flat * math.sin(azimuth), flat * math.cos(azimuth), length * math.cos(zenith)


@dataclass(frozen=True, eq=False)
class Measures:
    """What was measured of n sights.

    Attributes:
        values: (6, n) m, rad, in the order of `SLOTS`; NaN where nothing was measured.
        rows: (6, n) of the observations; -1 where nothing was measured.
        lifts: (n,) how much higher the target is above its ground than the instrument above its own (m).
    """

    values: FloatRows
    rows: IntRows
    lifts: FloatArray

    @classmethod
    def none(cls, n: int) -> Measures:
        """Nothing measured yet of n sights."""
        shape = len(SLOTS), n
        return cls(np.full(shape, np.nan), np.full(shape, -1, np.int64), np.zeros(n))

    def followed_by(self, others: Measures) -> Measures:
        """These, then those of other sights."""
        return Measures(
            np.hstack((self.values, others.values)),
            np.hstack((self.rows, others.rows)),
            np.hstack((self.lifts, others.lifts)),
        )

    def vectors(self) -> tuple[FloatRows, IntRows]:
        """(3, n) targets in the frames of the instruments, NaN where unknown, and their observations."""
        hz, zenith, distance, dx, dy, dz = self.values
        flat = distance * np.sin(zenith)
        polar = np.array([flat * np.sin(hz), flat * np.cos(hz), distance * np.cos(zenith) - self.lifts])
        shifted = self.rows[_SHIFTS].min(axis=0) >= 0
        rows = np.where(shifted, self.rows[_SHIFTS], self.rows[_POLAR])
        return np.where(shifted, [dx, dy, dz - self.lifts], polar), rows

    def vector_sigmas(self, sigmas: FloatRows) -> FloatArray:
        """(n,) expected errors of the vectors (m), from those of the measures (6, n)."""
        distances = self.values[DISTANCE]
        polar = sigmas[HZ] * distances, sigmas[ZENITH] * distances, sigmas[DISTANCE]
        shifted = self.rows[_SHIFTS].min(axis=0) >= 0
        return lengths(np.where(shifted, sigmas[_SHIFTS], polar))

    def readings(self) -> FloatArray:
        """(n,) readings of the horizontal circles; from DX and DY without Hz, NaN without these."""
        dx, dy = self.values[DX], self.values[DY]
        shifts = np.where((dx == 0.0) & (dy == 0.0), np.nan, np.arctan2(dx, dy))
        return np.where(self.rows[HZ] >= 0, self.values[HZ], shifts)


def lengths(vectors: FloatRows) -> FloatArray:
    """(n,) lengths of vectors (2 or 3, n)."""
    return np.asarray(np.sqrt(np.square(vectors).sum(axis=0)))


@dataclass(frozen=True, eq=False)
class Sights:
    """All sights, in reading order, and what follows from their measures.

    Attributes:
        stations: (n,) of each sight.
        origins: (n,) points of the stations.
        targets: (n,) points.
        measures: of each sight.
        vectors: (n, 3) targets in the frames of the instruments (m); NaN where unknown.
        vector_rows: (n, 3) observations of the vectors.
        vector_sigmas: (n,) expected errors of the vectors (m).
        readings: (n,) of the horizontal circles (rad); NaN where there is none.
        reading_sigmas: (n,) expected errors of readings that were measured (rad), 0 for the others.
        shift_sigmas: (n,) those of DX and DY that stand for a reading (m), else 0.
    """

    stations: IntArray
    origins: IntArray
    targets: IntArray
    measures: Measures
    vectors: FloatRows
    vector_rows: IntRows
    vector_sigmas: FloatArray
    readings: FloatArray
    reading_sigmas: FloatArray
    shift_sigmas: FloatArray
    _seen: dict[int, Sight] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.stations)

    def __getitem__(self, number: int) -> Sight:
        """One sight; the same when asked again."""
        sight = self._seen.get(number)
        if sight is None:
            sight = self._seen[number] = self._made(number)
        return sight

    @cached_property
    def rows(self) -> IndexRows:
        """(n, 3) observations of the vector of each; of its reading where that is not complete; else -1."""
        measured, none = self.measures.rows, np.full(len(self), -1)
        readings = np.where(measured[HZ] >= 0, [measured[HZ], none, none], [measured[DX], measured[DY], none])
        readings = np.where(np.isnan(self.readings), -1, readings)
        return np.where(np.isnan(self.vectors[:, :1]), readings.T, self.vector_rows).astype(np.int32)

    def _made(self, number: int) -> Sight:
        columns = self.measures.values[:, number].tolist(), self.measures.rows[:, number].tolist()
        measures = (None if row < 0 else (value, row) for value, row in zip(*columns, strict=True))
        sight = Sight(int(self.stations[number]), int(self.origins[number]), int(self.targets[number]))
        sight.hz, sight.zenith, sight.distance, sight.dx, sight.dy, sight.dz = measures
        sight.lift = float(self.measures.lifts[number])
        x, y, z = self.vectors[number].tolist()
        if not math.isnan(x):
            sight.vector = (x, y, z), tuple(self.vector_rows[number].tolist())
        return sight


def make_sights(ends: IntRows, measures: Measures, sigmas: FloatArray) -> Sights:
    """Sights: stations, origins and targets (3, n), measures, and the sigmas of all observations (m, rad)."""
    measured = measures.rows >= 0
    of_measures = np.where(measured, sigmas[measures.rows], 0.0) if len(sigmas) else np.zeros(measured.shape)
    vectors, rows = measures.vectors()
    stations, origins, targets = ends
    return Sights(
        stations,
        origins,
        targets,
        measures,
        np.ascontiguousarray(vectors.T),
        np.ascontiguousarray(rows.T),
        measures.vector_sigmas(of_measures),
        measures.readings(),
        of_measures[HZ],
        np.where(measured[HZ], 0.0, np.maximum(of_measures[DX], of_measures[DY])),
    )


class Step(NamedTuple):
    """How a point was placed or a station oriented: the method and the rows of its observations."""

    method: str
    observations: tuple[int, ...] = ()


GIVEN = Step("given")
FREE_STATION = "free station"

Sighted = tuple[int, ...]
"""Sights at whose end something is: one or two that meet there; more are those of a free station."""

Cause = Step | Sighted


class Steps(Sequence[Step | None]):
    """The steps of points or of stations, None where there is none; of a large network in columns.

    Args:
        causes: of each.
        rows: (n, 3) observations of each sight, as of `Sights.rows`.
    """

    def __init__(self, causes: Sequence[Cause | None], rows: IndexRows) -> None:
        self._rows = rows
        self._told = {k: cause for k, cause in enumerate(causes) if isinstance(cause, Step)}
        sights = [() if cause is None or k in self._told else cause for k, cause in enumerate(causes)]
        self._starts = np.append(0, np.cumsum(list(map(len, sights)), dtype=np.int64))
        self._sights = np.fromiter(chain.from_iterable(sights), np.int32, int(self._starts[-1]))

    def __len__(self) -> int:
        return len(self._starts) - 1

    @overload
    def __getitem__(self, which: int) -> Step | None: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Step | None, ...]: ...
    def __getitem__(self, which: int | slice) -> Step | tuple[Step | None, ...] | None:
        """One of them, or several."""
        if isinstance(which, slice):
            return tuple(self[k] for k in range(len(self))[which])
        number = range(len(self))[which]
        own = self._sights[self._starts[number] : self._starts[number + 1]].tolist()
        return step_of(tuple(own), self._rows) if own else self._told.get(number)


def step_of(cause: Cause, rows: IndexRows) -> Step:
    """A cause in words, with its observations, those of each sight (n, 3) being known."""
    if isinstance(cause, Step):
        return cause
    own = [row for row in rows[list(cause)].ravel().tolist() if row >= 0]
    return Step(FREE_STATION if len(cause) > 2 else "azimuth and distance", tuple(dict.fromkeys(own)))
