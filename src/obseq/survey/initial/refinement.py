"""Least squares on one point: a position made to fit its relations, the strength of their geometry."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.initial.known import Known, Matrix, plus, transposed_times
from obseq.survey.initial.relations import (
    ANGLES,
    READING_AT,
    Relation,
    distance_to,
    gradient,
    misfit,
    scaled_misfit,
    station_g0s,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.survey.initial.closed_forms import Space

_ITERATIONS = 4
_SINGULAR = 1e-6
_CONVERGED = 1e-8
"""Step, in mean distances, after which the next one is of the size of its square."""
_AGREES = 5.0
"""A relation agrees with a position when its misfit is at most so many times what is expected."""


@dataclass(frozen=True)
class Refined:
    """A position made to fit its relations, and the strength of their geometry.

    The strength is the smallest singular value of the derivatives of the scaled misfits with respect to the
    position (in units of the mean distance) and to the unknown G0s: about 1 for a right angle at equal
    distances, 0 where the relations do not determine the position. `point_sigma` is the expected error of the
    position relative to its neighbours (m); `azimuth_sigmas` are those of G0 (rad), by station.
    """

    position: Space
    strength: float
    point_sigma: float = math.inf
    azimuth_sigmas: dict[int, float] = field(default_factory=dict)


def refine(
    known: Known,
    relations: Sequence[Relation],
    start: Space,
    sigmas: Sequence[float],
    axes: tuple[int, ...] = (0, 1, 2),
    *,
    weighted: bool = False,
) -> Refined:
    """Least squares on a few relations from a good start.

    Args:
        known: known points.
        relations: those that determine the position.
        start: position in the frame.
        sigmas: of all observations (m, rad).
        axes: what may move: east (0), north (1), up (2).
        weighted: weigh the relations by the misfits expected of them, for more of them than needed; the
            strength is then that of the weighted system.
    """
    position = start
    free_stations = sorted({c.station for c in relations if c.kind == READING_AT and c.g0 is None})
    if len(relations) < len(axes) + len(free_stations):
        return Refined(position, 0.0)
    length = _mean_distance(known, relations, start)
    layout = (axes, length, free_stations)
    weights = np.ones(len(relations))
    if weighted:
        expected = np.maximum(_expected_misfits(known, relations, start, sigmas, length), 1e-12)
        weights = expected.min() / expected
    for _ in range(_ITERATIONS):
        vertical = known.vertical_at(position)
        g0s = station_g0s(known, relations, position, vertical)
        jacobian, residuals = _linearised(known, relations, position, vertical, g0s, layout)
        left, singular, right = np.linalg.svd(jacobian * weights[:, None], full_matrices=False)
        if not singular[-1] > _SINGULAR:
            return Refined(position, _SINGULAR)
        step = -(right.T @ ((left.T @ (weights * residuals)) / singular))[: len(axes)]
        largest = np.abs(step).max()
        if not largest < 1.0:
            return Refined(position, _SINGULAR)
        position = plus(position, _to_frame(vertical, axes, step.tolist(), length))
        if largest < _CONVERGED:
            break
    inverse = (right.T / singular) @ left.T * weights
    relative_sigmas = np.array(_expected_misfits(known, relations, position, sigmas, length))
    point_sigmas = np.sqrt(np.square(inverse * relative_sigmas).sum(axis=1))
    azimuths = dict(zip(free_stations, point_sigmas[len(axes) :].tolist(), strict=True))
    point_sigma = float(np.hypot.reduce(point_sigmas[: len(axes)])) * length
    return Refined(position, float(singular[-1]), point_sigma, azimuths)


def agreeing(
    known: Known,
    relations: Sequence[Relation],
    used: Sequence[Relation],
    refined: Refined,
    sigmas: Sequence[float],
) -> list[Relation]:
    """The relations that a position found from some of them agrees with, these included."""
    vertical = known.vertical_at(refined.position)
    g0s = station_g0s(known, used, refined.position, vertical)
    found = list(used)
    for c in relations:
        is_known = c.kind != READING_AT or c.station in g0s
        if c in used or known.positions[c.other] is None or not is_known:
            continue
        if _relative_misfit(known, c, refined, vertical, g0s, sigmas) <= _AGREES:
            found.append(c)
    return found


def contradictions(
    known: Known, relations: Sequence[Relation], refined: Refined, sigmas: Sequence[float]
) -> float:
    """How many relations speak against a position by more than is expected of them, counted softly."""
    vertical = known.vertical_at(refined.position)
    g0s = station_g0s(known, relations, refined.position, vertical)
    sizes = (_relative_misfit(known, c, refined, vertical, g0s, sigmas) for c in relations)
    return sum(size**2 / (size**2 + _AGREES**2) for size in sizes)


def _relative_misfit(
    known: Known,
    c: Relation,
    refined: Refined,
    vertical: Matrix,
    g0s: dict[int, float],
    sigmas: Sequence[float],
) -> float:
    """Size of a misfit over what its sigma and the expected errors of both points explain."""
    distance = distance_to(known, c, refined.position)
    size = abs(scaled_misfit(known, c, refined.position, vertical, g0s.get(c.station, 0.0)))
    sigma = c.sigma(sigmas) / (1.0 if c.kind in ANGLES else distance)
    moved = math.hypot(refined.point_sigma, known.point_sigmas[c.other]) / distance
    return size / math.hypot(sigma, moved)


def _expected_misfits(
    known: Known, relations: Sequence[Relation], position: Space, sigmas: Sequence[float], length: float
) -> list[float]:
    """Expected size of the scaled misfits: noise of observations, and of points relative to the best one.

    The best one is among those that have a position, and not only a height, if there are such.
    """
    best = min(
        (c.other for c in relations),
        key=lambda other: (known.positions[other] is None, known.point_sigmas[other]),
    )
    expected = []
    for c in relations:
        moved = 0.0 if c.other == best else known.relative_sigma(best, c.other, _apart(known, best, c.other))
        sigma = c.sigma(sigmas)
        if c.kind in ANGLES:
            expected.append(math.hypot(sigma, moved / distance_to(known, c, position)))
        else:
            expected.append(math.hypot(sigma, moved) / length)
    return expected


def _apart(known: Known, a: int, b: int) -> float:
    """Distance of two points, 0 where one has only a height."""
    first, second = known.positions[a], known.positions[b]
    return 0.0 if first is None or second is None else math.dist(first, second)


def _mean_distance(known: Known, relations: Sequence[Relation], position: Space) -> float:
    lengths = [distance_to(known, relation, position) for relation in relations]
    return sum(lengths) / len(lengths)


def _to_frame(vertical: Matrix, axes: tuple[int, ...], step: list[float], length: float) -> Space:
    """A displacement given along some of east, north and up, in units of `length`."""
    moved = dict(zip(axes, step, strict=True))
    east, north, up = (moved.get(axis, 0.0) * length for axis in range(3))
    return transposed_times(vertical, (east, north, up))


def _linearised(
    known: Known,
    relations: Sequence[Relation],
    position: Space,
    vertical: Matrix,
    g0s: dict[int, float],
    layout: tuple[tuple[int, ...], float, list[int]],
) -> tuple[FloatArray, FloatArray]:
    """Derivatives and values of the scaled misfits."""
    axes, length, free_stations = layout
    rows, residuals = [], []
    for relation in relations:
        unit = 1.0 if relation.kind in ANGLES else 1.0 / length
        x, y, z = gradient(known, relation, position, vertical)
        along = [(x * a + y * b + z * c) * length * unit for a, b, c in map(vertical.__getitem__, axes)]
        is_reading = relation.kind == READING_AT
        own = [-1.0 if is_reading and station == relation.station else 0.0 for station in free_stations]
        rows.append(along + own)
        residuals.append(misfit(known, relation, position, vertical, g0s.get(relation.station, 0.0)) * unit)
    return np.array(rows), np.array(residuals)
