"""Least squares on one point: a position made to fit its relations, the strength of their geometry.

A handful of equations with two to five unknowns: plain numbers are quicker than arrays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from operator import mul
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from obseq.survey.initial.closed_forms import Space, plus
from obseq.survey.initial.known import Known, Matrix, transposed_times
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

Column = list[float]
"""A number for each relation."""

_ITERATIONS = 4
_SINGULAR = 1e-6
_LEAST_EXPECTED = 1e-12
"""Expected misfit that stands for smaller ones."""
_CONVERGED = 1e-8
"""Step, in mean distances, after which the next one is of the size of its square."""
_AGREES = 5.0
"""A relation agrees with a position when its misfit is at most so many times what is expected."""
NO_AZIMUTHS: Mapping[int, float] = MappingProxyType({})


class Refined(NamedTuple):
    """A position made to fit its relations, and the strength of their geometry.

    The strength is the smallest singular value of the derivatives of the scaled misfits with respect to the
    position (in units of the mean distance) and to the unknown G0s: about 1 for a right angle at equal
    distances, 0 where the relations do not determine the position. `point_sigma` is the expected error of the
    position relative to its neighbours (m); `azimuth_sigmas` are those of G0 (rad), by station.
    """

    position: Space
    strength: float
    point_sigma: float = math.inf
    azimuth_sigmas: Mapping[int, float] = NO_AZIMUTHS


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
    weights = [1.0] * len(relations)
    if weighted:
        expected = _expected_misfits(known, relations, start, sigmas, length)
        least = max(min(expected), _LEAST_EXPECTED)
        weights = [least / max(size, _LEAST_EXPECTED) for size in expected]
    turns = [
        [-weight if _turns(c, station) else 0.0 for c, weight in zip(relations, weights, strict=True)]
        for station in free_stations
    ]
    for _ in range(_ITERATIONS):
        vertical = known.vertical_at(position)
        moves, residuals = _linearised(known, relations, position, vertical, length, weights)
        inverse, corner = _inverted([moves[axis] for axis in axes] + turns)
        if not inverse:
            return Refined(position, _SINGULAR)
        step = [-sum(map(mul, row, residuals)) for row in inverse[: len(axes)]]
        largest = max(map(abs, step))
        if not largest < 1.0:
            return Refined(position, _SINGULAR)
        position = plus(position, _to_frame(vertical, axes, step, length))
        if largest < _CONVERGED:
            break
    strength = _least_singular(corner)
    if not strength > _SINGULAR:
        return Refined(position, _SINGULAR)
    relative_sigmas = _expected_misfits(known, relations, position, sigmas, length)
    scaled = list(map(mul, weights, relative_sigmas))
    point_sigmas = [math.hypot(*map(mul, row, scaled)) for row in inverse]
    azimuths = dict(zip(free_stations, point_sigmas[len(axes) :], strict=True))
    return Refined(position, strength, math.hypot(*point_sigmas[: len(axes)]) * length, azimuths)


def _turns(c: Relation, station: int) -> bool:
    """Whether the unknown G0 of a station turns a relation."""
    return c.kind == READING_AT and c.station == station


def _inverted(columns: list[Column]) -> tuple[list[Column], list[Column]]:
    """The rows of the pseudo-inverse of a matrix given by its n columns, and R (n, n) of its factors Q R.

    Both are empty where the columns depend on each other. By the modified method of Gram and Schmidt.
    """
    rows, corner = [], []
    for k, column in enumerate(columns):
        size = math.sqrt(sum(map(mul, column, column)))
        if not size > _SINGULAR:
            return [], []
        unit = [value / size for value in column]
        others = [0.0] * k + [size]
        for j in range(k + 1, len(columns)):
            share = sum(map(mul, unit, columns[j]))
            columns[j] = [value - share * part for value, part in zip(columns[j], unit, strict=True)]
            others.append(share)
        rows.append(unit)
        corner.append(others)
    for k in range(len(rows) - 1, -1, -1):
        row, factors = rows[k], corner[k]
        for j in range(k + 1, len(rows)):
            share = factors[j]
            row = [value - share * part for value, part in zip(row, rows[j], strict=True)]
        rows[k] = [value / factors[k] for value in row]
    return rows, corner


def _least_singular(corner: list[Column]) -> float:
    """The smallest singular value of a triangular matrix (n, n)."""
    if len(corner) == 1:
        return corner[0][0]
    if len(corner) > 2:
        return float(np.linalg.svd(corner, compute_uv=False)[-1])
    (a, b), (_, d) = corner
    largest = (math.hypot(a + d, b) + math.hypot(a - d, b)) / 2.0
    return a * d / largest


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
    length: float,
    weights: Column,
) -> tuple[list[Column], Column]:
    """Derivatives of the scaled and weighted misfits by east, north and up, and their values."""
    g0s = station_g0s(known, relations, position, vertical)
    easts, norths, ups, residuals = [], [], [], []
    for relation, weight in zip(relations, weights, strict=True):
        unit = weight if relation.kind in ANGLES else weight / length
        east, north, up = gradient(known, relation, position, vertical)
        scale = length * unit
        easts.append(east * scale)
        norths.append(north * scale)
        ups.append(up * scale)
        residuals.append(misfit(known, relation, position, vertical, g0s.get(relation.station, 0.0)) * unit)
    return [easts, norths, ups], residuals
