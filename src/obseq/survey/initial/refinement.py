"""Least squares on one point: a position made to fit its constraints, the strength of their geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.initial.closed_forms import Space, wrap
from obseq.survey.initial.known import Matrix, State, minus, plus, transposed_times
from obseq.survey.initial.relations import (
    ANGLES,
    Constraint,
    Kind,
    distance_to,
    misfit,
    scaled_misfit,
    station_g0s,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray

_ITERATIONS = 4
_SINGULAR = 1e-6
_AGREES = 5.0
"""A constraint agrees with a position when its misfit is at most so many times what is expected."""


@dataclass(frozen=True)
class Refined:
    """A position made to fit its constraints, and the strength of their geometry.

    The strength is the smallest singular value of the derivatives of the scaled misfits with respect to the
    position (in units of the mean distance) and to the unknown G0s: about 1 for a right angle at equal
    distances, 0 where the constraints do not determine the position. The spread is the expected error of the
    position relative to its neighbours (m); the azimuth spreads are those of G0 (rad), by station.
    """

    position: Space
    strength: float
    spread: float = math.inf
    azimuth_spreads: dict[int, float] = field(default_factory=dict)


def refine(
    state: State,
    constraints: Sequence[Constraint],
    start: Space,
    sigmas: Sequence[float],
    axes: tuple[int, ...] = (0, 1, 2),
    *,
    weighted: bool = False,
) -> Refined:
    """Least squares on a few constraints from a good start.

    Args:
        state: known points.
        constraints: those that determine the position.
        start: position in the frame.
        sigmas: of all observations (m, rad).
        axes: what may move: east (0), north (1), up (2).
        weighted: weigh the constraints by the misfits expected of them, for more of them than needed; the
            strength is then that of the weighted system.
    """
    position = start
    free_stations = sorted({c.station for c in constraints if c.kind == Kind.READING_AT and c.g0 is None})
    length = _mean_distance(state, constraints, start)
    layout = (axes, length, free_stations)
    weights = np.ones(len(constraints))
    if weighted:
        expected = np.maximum(_expected_misfits(state, constraints, start, sigmas, length), 1e-12)
        weights = expected.min() / expected
    for _ in range(_ITERATIONS):
        vertical = state.vertical_at(position)
        g0s = station_g0s(state, constraints, position, vertical)
        jacobian, residuals = _linearised(state, constraints, position, vertical, g0s, layout)
        left, singular, right = np.linalg.svd(jacobian * weights[:, None], full_matrices=False)
        if jacobian.shape[0] < jacobian.shape[1]:
            return Refined(position, 0.0)
        if not singular[-1] > _SINGULAR:
            return Refined(position, _SINGULAR)
        step = -(right.T @ ((left.T @ (weights * residuals)) / singular))[: len(axes)]
        if not np.abs(step).max() < 1.0:
            return Refined(position, _SINGULAR)
        position = plus(position, _to_frame(vertical, axes, step.tolist(), length))
        if np.abs(step).max() < 1e-10:
            break
    inverse = (right.T / singular) @ left.T * weights
    noises = np.array(_expected_misfits(state, constraints, position, sigmas, length))
    spreads = np.sqrt(np.square(inverse * noises).sum(axis=1))
    azimuths = dict(zip(free_stations, spreads[len(axes) :].tolist(), strict=True))
    spread = float(np.hypot.reduce(spreads[: len(axes)])) * length
    return Refined(position, float(singular[-1]), spread, azimuths)


def agreeing(
    state: State,
    constraints: Sequence[Constraint],
    used: Sequence[Constraint],
    refined: Refined,
    sigmas: Sequence[float],
) -> list[Constraint]:
    """The constraints that a position found from some of them agrees with, these included."""
    vertical = state.vertical_at(refined.position)
    g0s = station_g0s(state, used, refined.position, vertical)
    found = list(used)
    for c in constraints:
        is_known = c.kind != Kind.READING_AT or c.station in g0s
        if c in used or state.positions[c.other] is None or not is_known:
            continue
        if _relative_misfit(state, c, refined, vertical, g0s, sigmas) <= _AGREES:
            found.append(c)
    return found


def contradictions(
    state: State, constraints: Sequence[Constraint], refined: Refined, sigmas: Sequence[float]
) -> float:
    """How many constraints speak against a position by more than is expected of them, counted softly."""
    vertical = state.vertical_at(refined.position)
    g0s = station_g0s(state, constraints, refined.position, vertical)
    sizes = (_relative_misfit(state, c, refined, vertical, g0s, sigmas) for c in constraints)
    return sum(size**2 / (size**2 + _AGREES**2) for size in sizes)


def _relative_misfit(
    state: State,
    c: Constraint,
    refined: Refined,
    vertical: Matrix,
    g0s: dict[int, float],
    sigmas: Sequence[float],
) -> float:
    """Size of a misfit over what its sigma and the expected errors of both points explain."""
    distance = distance_to(state, c, refined.position)
    size = abs(scaled_misfit(state, c, refined.position, vertical, g0s.get(c.station, 0.0)))
    sigma = c.sigma(sigmas) / (1.0 if c.kind in ANGLES else distance)
    moved = math.hypot(refined.spread, state.spreads[c.other]) / distance
    return size / math.hypot(sigma, moved)


def _expected_misfits(
    state: State, constraints: Sequence[Constraint], position: Space, sigmas: Sequence[float], length: float
) -> list[float]:
    """Expected size of the scaled misfits: noise of observations, and of points relative to the best one."""
    located = [c.other for c in constraints if state.positions[c.other] is not None]
    best = min(located, key=lambda other: state.spreads[other])
    expected = []
    for c in constraints:
        other = state.positions[c.other]
        away = 0.0 if other is None else math.hypot(*minus(other, state.known(best)))
        moved = 0.0 if c.other == best else state.relative_spread(best, c.other, away)
        sigma = c.sigma(sigmas)
        if c.kind in ANGLES:
            expected.append(math.hypot(sigma, moved / distance_to(state, c, position)))
        else:
            expected.append(math.hypot(sigma, moved) / length)
    return expected


def _mean_distance(state: State, constraints: Sequence[Constraint], position: Space) -> float:
    lengths = [distance_to(state, constraint, position) for constraint in constraints]
    return sum(lengths) / len(lengths)


def _to_frame(vertical: Matrix, axes: tuple[int, ...], step: list[float], length: float) -> Space:
    """A displacement given along some of east, north and up, in units of `length`."""
    moved = dict(zip(axes, step, strict=True))
    east, north, up = (moved.get(axis, 0.0) * length for axis in range(3))
    return transposed_times(vertical, (east, north, up))


def _linearised(
    state: State,
    constraints: Sequence[Constraint],
    position: Space,
    vertical: Matrix,
    g0s: dict[int, float],
    layout: tuple[tuple[int, ...], float, list[int]],
) -> tuple[FloatArray, FloatArray]:
    """Derivatives (by differences) and values of the scaled misfits."""
    axes, length, free_stations = layout
    step = 1e-6
    moved = [plus(position, _to_frame(vertical, (axis,), [step], length)) for axis in axes]
    jacobian = np.zeros((len(constraints), len(axes) + len(free_stations)))
    residuals = np.zeros(len(constraints))
    for row, constraint in enumerate(constraints):
        g0 = g0s.get(constraint.station, 0.0)
        unit = 1.0 if constraint.kind in ANGLES else 1.0 / length
        here = misfit(state, constraint, position, vertical, g0)
        residuals[row] = here * unit
        for column, there in enumerate(moved):
            difference = misfit(state, constraint, there, vertical, g0) - here
            if constraint.kind in ANGLES:
                difference = wrap(difference)
            jacobian[row, column] = difference * unit / step
        if constraint.station in free_stations and constraint.kind == Kind.READING_AT:
            jacobian[row, len(axes) + free_stations.index(constraint.station)] = -1.0
    return jacobian, residuals
