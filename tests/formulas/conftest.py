"""Shared by the tests of formulas: exact derivatives, from high precision."""

from collections.abc import Callable, Sequence

import mpmath
import numpy as np
import pytest

from obseq.formulas import Formula

DIGITS = 80

Exact = Callable[[Formula, Sequence[float], Sequence[float]], tuple[np.ndarray, np.ndarray]]


@pytest.fixture(scope="package")
def exact() -> Exact:
    """(formula, unknowns, observations) -> values and Jacobian, from differences in 80 digits."""
    return _exact


def _exact(
    formula: Formula, unknowns: Sequence[float], observations: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    with mpmath.workdps(DIGITS):
        u = [mpmath.mpf(float(x)) for x in unknowns]
        o = [mpmath.mpf(float(x)) for x in observations]
        step = mpmath.mpf(10) ** (-DIGITS // 3)
        columns = []
        for j in range(len(u)):
            ends = [formula.evaluate([*u[:j], u[j] + h, *u[j + 1 :]], o) for h in (-step, step)]
            columns.append([(high - low) / (2 * step) for low, high in zip(*ends, strict=True)])
        values = formula.evaluate(u, o)
    return np.array(values, dtype=float), np.array(columns, dtype=float).T
