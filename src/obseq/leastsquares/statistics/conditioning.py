"""How well a system determines its unknowns, as one number: the condition number of its normal matrix."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import LinearOperator, aslinearoperator, eigsh

from obseq.leastsquares.solvers import choose_solver
from obseq.leastsquares.system import LeastSquares

SMALL = 20
"""Unknowns up to which the eigenvalues are those of the whole matrix."""


def condition_number(system: LeastSquares, scaled: bool = True, accuracy: float = 1e-3) -> float:
    """Ratio of the extreme eigenvalues of the normal matrix at the current values, frozen unknowns apart.

    Costs an assembly, a factorisation, and some tens of products and solutions: SciPy's Lanczos iterations
    (ARPACK) on N and on its inverse. What is lost to rounding in the unknowns is about this number times
    1e-16, in standard deviations.

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
    inverse = LinearOperator((pattern.n, pattern.n), matvec=solver.solve, dtype=np.float64)
    return _largest(aslinearoperator(pattern.matrix(values)), accuracy) * _largest(inverse, accuracy)


def _largest(operator: LinearOperator, accuracy: float) -> float:
    """Largest eigenvalue of a symmetric positive definite operator."""
    n = operator.shape[0]
    if n <= SMALL:
        return float(np.linalg.eigvalsh(operator @ np.eye(n))[-1])
    start = np.random.default_rng(0).normal(size=n)
    return float(eigsh(operator, k=1, tol=accuracy, v0=start, return_eigenvectors=False)[0])
