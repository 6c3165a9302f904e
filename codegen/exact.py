"""A formula read in many digits beside its kernel: the errors of values and of derivatives at one place."""

from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import numpy as np
from numpy.typing import NDArray

from obseq.formulas.base import Formula

FloatArray = NDArray[np.float64]
Numbers = list[mpmath.mpf]

DIGITS = 50
STEP = mpmath.mpf(10) ** (-DIGITS // 2)
"""Step of the differences: what they neglect, and what they cancel, is far below double precision."""

ULPS = 64
"""Inputs are moved by so many units of their last digit, to see how much of a result they determine."""

MOVES = 3
EPSILON = float(np.finfo(np.float64).eps)

KINK = 1e-6
"""Relative difference of the slopes on either side, or a jump, beyond which a formula has no derivative."""


@dataclass(frozen=True)
class Compared:
    """Errors of a kernel at one place, of its values and of its slopes along a direction.

    They are relative to the result. Where the last digits of the inputs change it by more than its own last
    digit, they are relative to a number whose last digit is that change.

    Attributes:
        value: largest error of a value; infinite where kernel or formula alone is a number.
        slope: largest error of a slope; None where the formula has no derivative.
    """

    value: float
    slope: float | None


def compare(
    formula: Formula,
    inputs: tuple[FloatArray, FloatArray],
    direction: FloatArray,
    values: FloatArray,
    jacobian: FloatArray,
) -> Compared:
    """The errors of a kernel against its formula in 50 digits.

    Args:
        formula: The formula.
        inputs: (n_unknowns,) unknowns and (n_observations,) observations.
        direction: (n_unknowns,) of the slopes.
        values: (n_residuals,) of the kernel.
        jacobian: (n_residuals, n_unknowns) of the kernel.
    """
    with mpmath.workdps(DIGITS):
        place = [mpmath.mpf(float(x)) for x in np.concatenate(inputs)]
        along = [mpmath.mpf(float(x)) for x in direction]
        exact = _values(formula, place)
        if exact is None:
            return Compared(float("inf") if np.isfinite(values).all() else 0.0, None)
        slopes = _slopes(formula, place, along, exact)
        if slopes is None and not np.isfinite(values).all():
            return Compared(0.0, None)
        moved = [_moved(place, k) for k in range(MOVES)]
        value = _error(values, exact, [_values(formula, other) for other in moved], np.zeros(len(exact)))
        if slopes is None:
            return Compared(value, None)
        others = [_slopes(formula, other, along, _values(formula, other)) for other in moved]
        size = np.abs(jacobian).max(axis=1, initial=0.0)
        return Compared(value, _error(jacobian @ direction, slopes, others, size))


def _values(formula: Formula, place: Numbers) -> Numbers | None:
    """The residuals; None where the formula is not defined."""
    n = len(formula.unknowns)
    try:
        found = [mpmath.mpf(residual) for residual in formula.evaluate(place[:n], place[n:])]
    except (ArithmeticError, TypeError, ValueError):
        return None
    return found if all(map(mpmath.isfinite, found)) else None


def _slopes(formula: Formula, place: Numbers, along: Numbers, middle: Numbers | None) -> Numbers | None:
    """The derivatives along a direction; None where those on either side differ."""
    n = len(along)
    ends = [
        _values(formula, [x + sign * STEP * d for x, d in zip(place, along, strict=False)] + place[n:])
        for sign in (1, -1)
    ]
    if middle is None or ends[0] is None or ends[1] is None:
        return None
    found = []
    for after, here, before in zip(ends[0], middle, ends[1], strict=True):
        forward, backward = (after - here) / STEP, (here - before) / STEP
        has_kink = abs(forward - backward) > KINK * (abs(forward) + abs(backward) + KINK)
        if has_kink or abs(after - before) > KINK * (1 + abs(here)):  # or a jump
            return None
        found.append((forward + backward) / 2)
    return found


def _moved(place: Numbers, seed: int) -> Numbers:
    """The inputs changed in their last digits."""
    shifts = np.random.default_rng(seed).uniform(-1, 1, len(place)) * ULPS * EPSILON
    return [x * (1 + mpmath.mpf(float(shift))) for x, shift in zip(place, shifts, strict=True)]


def _error(found: FloatArray, exact: Numbers, others: Sequence[Numbers | None], size: FloatArray) -> float:
    """The largest relative error; 0 where the last digits of the inputs decide whether there is a result."""
    if not np.isfinite(found).all():
        return float("inf")
    worst = 0.0
    for k, value in enumerate(exact):
        if any(other is None for other in others):
            continue
        change = max(abs(float(other[k] - value)) for other in others if other is not None)
        scale = max(abs(float(value)), float(size[k]), change / (ULPS * EPSILON), float(STEP))
        worst = max(worst, abs(float(mpmath.mpf(float(found[k])) - value)) / scale)
    return worst
