"""Dense Cholesky: small systems and nearly full matrices; no compilation, no analysis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs

from obseq.leastsquares.solvers.base import BaseSolver
from obseq.leastsquares.solvers.protocol import SolverStatistics
from obseq.leastsquares.solvers.rank import defect_of, relative_pivots, replacement_pivots

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.leastsquares.solvers.protocol import Defect, SymmetricPattern


class DenseCholesky(BaseSolver):
    """LAPACK's Cholesky of the whole matrix, unknowns in their own order."""

    name = "dense"

    def _analyse(self, pattern: SymmetricPattern) -> None:
        self._entries = (pattern.indices, pattern.columns())
        self._lower = np.zeros((pattern.n, pattern.n), order="F")

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        diagonal = values[self._pattern.diagonal]
        self._fill(values)
        self._lower, info = dpotrf(self._lower, lower=True, clean=False, overwrite_a=True)
        pivots = relative_pivots(np.square(np.diagonal(self._lower)), diagonal)
        if info != 0 or not np.all(pivots > tolerance):
            self._fill(values)
            pivots = factor_replacing(self._lower, tolerance)
        return defect_of(pivots, tolerance)

    def _fill(self, values: FloatArray) -> None:
        self._lower[:] = 0.0
        self._lower[self._entries] = values

    def _solve(self, rhs: FloatArray) -> FloatArray:
        return np.asarray(dpotrs(self._lower, rhs, lower=True)[0])

    def _selected_inverse(self) -> FloatArray:
        inverse, _ = dpotri(self._lower, lower=True)
        return np.asarray(inverse[self._entries])

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        n = self._pattern.n
        return SolverStatistics(
            solver=self.name,
            ordering="natural",
            n=n,
            nnz_pattern=self._pattern.nnz,
            nnz_factor=n * (n + 1) // 2,
            flops=n**3 / 3,
            memory=self._lower.nbytes,
        )


def factor_replacing(lower: FloatArray, tolerance: float) -> FloatArray:
    """Factors in place, column by column, replacing vanishing pivots; returns the relative pivots (n,).

    Args:
        lower: (n, n) lower triangle of the matrix; becomes the factor.
        tolerance: a pivot vanishes below this share of its diagonal entry.
    """
    diagonal = np.diagonal(lower).copy()
    replacements = replacement_pivots(diagonal)
    pivots = np.empty_like(diagonal)
    for j in range(len(diagonal)):
        column = lower[j:, j] - lower[j:, :j] @ lower[j, :j]
        pivots[j] = relative_pivots(column[:1], diagonal[j : j + 1])[0]
        if pivots[j] > tolerance:
            lower[j:, j] = column / np.sqrt(column[0])
        else:
            lower[j:, j] = 0.0
            lower[j, j] = np.sqrt(replacements[j])
    return pivots
