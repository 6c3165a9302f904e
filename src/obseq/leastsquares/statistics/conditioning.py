"""How well a system determines its unknowns, as one number: the condition number of its normal matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.solvers import choose_solver

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray
    from obseq.leastsquares.system import LeastSquares


MOST_STEPS = 300


def condition_number(system: LeastSquares, scaled: bool = True, accuracy: float = 1e-3) -> float:
    """Ratio of the extreme eigenvalues of the normal matrix at the current values, frozen unknowns apart.

    Costs an assembly, a factorisation, and some tens of solutions: power iterations on N and on its
    inverse. What is lost to rounding in the unknowns is about this number times 1e-16, in standard
    deviations.

    Args:
        system: unknowns and equations, without hard constraints and datum.
        scaled: for the matrix scaled to a unit diagonal, which does not depend on the units of unknowns.
        accuracy: relative accuracy of each eigenvalue.

    Raises:
        SingularMatrixError: some unknowns are undetermined.
    """
    equations = system.equations()
    values = equations.assemble().values.copy()
    pattern = equations.pattern
    if scaled:
        root = np.sqrt(values[pattern.diagonal])
        values /= root[pattern.indices] * root[pattern.columns()]
    solver = choose_solver(pattern)
    solver.analyse(pattern)
    solver.factor(values)
    matrix = pattern.matrix(values)
    largest = _largest(lambda x: np.asarray(matrix @ x), pattern.n, accuracy)
    return largest * _largest(solver.solve, pattern.n, accuracy)


def _largest(apply: Callable[[FloatArray], FloatArray], n: int, accuracy: float) -> float:
    """Largest eigenvalue of a symmetric positive definite operator, by power iterations."""
    vector = np.random.default_rng(0).normal(size=n)
    previous = 0.0
    for _ in range(MOST_STEPS):
        vector /= np.linalg.norm(vector)
        image = apply(vector)
        value = float(np.linalg.norm(image))
        if abs(value - previous) <= 0.01 * accuracy * value:
            return value
        previous, vector = value, image
    return previous
