"""Points that fit where another is written: what an observation would have been to, or from, every point."""

from __future__ import annotations

import enum
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import IntArray, Observations
    from obseq.survey.screening.robust import Estimate

_TOLERANCE = 5.0
"""Sigmas within which an explanation must hit."""
_NEAR, _WIDEST = 1.0, 0.1
"""How far from its place approximate coordinates (m) may put a point, and angles (rad) to it at most."""
_BENT = 1e-7
"""What the curvature of the Earth and refraction may change in a zenith angle (rad for each m)."""
_LEAST_SIGHT = 1e-6
"""Length of a sight (m) below which it has no direction."""


class End(enum.StrEnum):
    """Which of its points an observation may name wrongly."""

    TARGET = "target"
    ORIGIN = "first point"
    BACKSIGHT = "backsight"


@dataclass(frozen=True)
class Substitutes:
    """The points that fit all of some observations in place of the one that is written.

    Attributes:
        rows: The observations.
        end: What of them names the point.
        points: Rows of the points that fit.
        chance: How many would fit by accident.
    """

    rows: tuple[int, ...]
    end: End
    points: tuple[int, ...]
    chance: float


def tolerance_of(found: Estimate, row: int) -> float:
    """How far from what the others give a good value of an observation may be (m, rad)."""
    return _TOLERANCE * found.scale * sigma_of(found, row)


def sigma_of(found: Estimate, row: int) -> float:
    """Sigma of an observation (m, rad), its relative part included where it takes part."""
    ratio = float(found.ratios[row])
    if ratio > 0.0:
        return abs(float(found.misfits[row])) / ratio
    return float(found.book.observations.sigmas[row])


def substitutes(found: Estimate, rows: Sequence[int], end: End, *, near: float = 0.0) -> Substitutes | None:
    """What fits, within twice the tolerance, at one end of observations; None where that cannot be said.

    Args:
        found: the network.
        rows: the observations.
        end: which of their points is another.
        near: how far (m) from their places points may be.
    """
    observations, n = found.book.observations, len(found.points)
    kinds = [BY_CODE[int(observations.types[row])] for row in rows]
    if any(kind.start is Start.NOTHING or not _names(end, kind.start, row, observations)
           for kind, row in zip(kinds, rows, strict=True)):  # fmt: skip
        return None
    fits, chance = _candidates(found, rows), 1.0
    for row, kind in zip(rows, kinds, strict=True):
        values, value = with_every_point(found, row, end), float(observations.values[row])
        tolerance = 2.0 * tolerance_of(found, row)
        fits &= _gaps(kind, values, value) <= tolerance + _seen(found, row, end, near)
        chance *= 2.0 * tolerance / (2.0 * math.pi if kind.is_angle else max(2.0 * abs(value), tolerance))
    located = np.count_nonzero(np.isfinite(found.coordinates).all(axis=1))
    return Substitutes(tuple(rows), end, tuple(np.flatnonzero(fits[:n]).tolist()), float(located * chance))


def near_approximate(found: Estimate, rows: Sequence[int], end: End) -> IntArray:
    """(n,) how many observations fit each point that nothing determines, by its approximate coordinates."""
    points, observations = found.points, found.book.observations
    count, is_located = (
        np.zeros(len(points), np.int32),
        np.asarray(np.isfinite(found.coordinates).all(axis=1)),
    )
    is_given = np.asarray(np.isfinite(points.coordinates).all(axis=1))
    if not (is_given & ~is_located).any():
        return count
    there = replace(found, coordinates=np.where(is_located[:, None], found.coordinates, points.coordinates))
    for row in rows:
        kind, value = BY_CODE[int(observations.types[row])], float(observations.values[row])
        allowed = _seen(there, row, end, _NEAR) + 2.0 * tolerance_of(found, row)
        count += _gaps(kind, with_every_point(there, row, end), value) <= allowed
    return np.asarray(np.where(is_given & ~is_located, count, 0))


def _gaps(kind: ObservationKind, computed: FloatArray, value: float) -> FloatArray:
    """(n,) how far a value is from what it would have been (m, rad)."""
    gaps = np.abs(computed - value)
    return np.abs(np.remainder(gaps + math.pi, 2.0 * math.pi) - math.pi) if kind.is_angle else gaps


def _seen(found: Estimate, row: int, end: End, near: float) -> FloatArray | float:
    """(n,) what a shift (m) of each point at one end, and refraction, may change (m, rad)."""
    kind = BY_CODE[int(found.book.observations.types[row])]
    if not near or not kind.is_angle:
        return near
    lengths = np.linalg.norm(_offsets(found, row, end), axis=1)
    bent = _BENT * lengths if kind.is_refracted else 0.0
    return np.asarray(np.minimum(near / np.maximum(lengths, _LEAST_SIGHT) + bent, _WIDEST))


def _names(end: End, start: Start, row: int, observations: Observations) -> bool:
    """Whether an observation names a point at an end that may be another by itself."""
    if end is End.BACKSIGHT:
        return start is Start.ANGLE
    return end is End.TARGET or bool(observations.stations[row] < 0)


def _candidates(found: Estimate, rows: Sequence[int]) -> BoolArray:
    """(n,) the points that have a place and that the observations do not name."""
    fits = np.asarray(np.isfinite(found.coordinates).all(axis=1))
    observations = found.book.observations
    for ends in (observations.from_points, observations.to_points, observations.backsights):
        named = ends[list(rows)]
        fits[named[(named >= 0) & (named < len(fits))]] = False
    return fits


def with_every_point(found: Estimate, row: int, end: End) -> FloatArray:
    """(n,) what an observation would have been with every point at one end; NaN where it cannot be said."""
    kind = BY_CODE[int(found.book.observations.types[row])]
    if kind.start is Start.ANGLE:
        return _angles(found, row, end)
    offsets = _offsets(found, row, end)
    if kind.start is Start.DISTANCE:
        return np.asarray(np.linalg.norm(offsets, axis=1))
    if kind.start is Start.FLAT:
        return np.asarray(np.hypot(offsets[:, 0], offsets[:, 1]))
    if kind.start is Start.RISE:
        return _rises(found, row, end)
    return _in_instrument(found, row, offsets, kind.start)


def _offsets(found: Estimate, row: int, end: End) -> FloatArray:
    """(n, 3) the sight from instrument to target, with every point at one end."""
    observations = found.book.observations
    ends = observations.from_points, observations.to_points
    base = _place(found, ends, row, of_target=end is End.ORIGIN)
    offsets = (found.coordinates - base) * (-1.0 if end is End.ORIGIN else 1.0)
    offsets[:, 2] += float(observations.to_heights[row] - observations.from_heights[row])
    return np.asarray(offsets)


def _place(found: Estimate, ends: tuple[IntArray, IntArray], row: int, *, of_target: bool) -> FloatArray:
    """(3,) where one of the two ends of an observation is."""
    point = int(ends[1 if of_target else 0][row])
    return np.asarray(found.coordinates[point] if point < len(found.coordinates) else np.full(3, np.nan))


def _angles(found: Estimate, row: int, end: End) -> FloatArray:
    """Angles from backsight to target; NaN where a point would see itself."""
    observations, places = found.book.observations, found.coordinates
    origin, target, back = (
        places if end is which else places[int(rows[row])]
        for which, rows in (
            (End.ORIGIN, observations.from_points),
            (End.TARGET, observations.to_points),
            (End.BACKSIGHT, observations.backsights),
        )
    )
    forth, backwards = (np.atleast_2d(sight - origin)[:, :2] for sight in (target, back))
    angles = np.arctan2(forth[:, 0], forth[:, 1]) - np.arctan2(backwards[:, 0], backwards[:, 1])
    shortest = np.minimum(np.hypot(*forth.T), np.hypot(*backwards.T))
    return np.where(shortest > _LEAST_SIGHT, angles, np.nan)


def _rises(found: Estimate, row: int, end: End) -> FloatArray:
    """Height differences: what was computed and how much higher every point is than the one written."""
    observations, computed = found.book.observations, float(found.computed[row])
    ends = observations.from_points, observations.to_points
    sign = -1.0 if end is End.ORIGIN else 1.0
    if not math.isfinite(computed):
        other = _place(found, ends, row, of_target=end is End.ORIGIN)
        return np.asarray(sign * (found.coordinates[:, 2] - other[2]))
    there = _place(found, ends, row, of_target=end is End.TARGET)
    return np.asarray(computed + sign * (found.coordinates[:, 2] - there[2]))


def _in_instrument(found: Estimate, row: int, offsets: FloatArray, start: Start) -> FloatArray:
    """Directions, zenith angles and components of sights (n, 3) in the axes of the instrument."""
    station = int(found.book.observations.stations[row])
    if station < 0:
        return np.full(len(offsets), np.nan)
    local = offsets @ found.rotations[station]
    if start is Start.ZENITH:
        return np.asarray(np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]))
    if BY_CODE[int(found.book.observations.types[row])].is_angle:
        return np.asarray(np.arctan2(local[:, 0], local[:, 1]))
    return np.asarray(local[:, {Start.DX: 0, Start.DY: 1}.get(start, 2)])
