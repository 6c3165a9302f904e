"""SuperLU through SciPy: an independent witness, always there, much slower on large systems."""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import SuperLU as Factor
from scipy.sparse.linalg import splu

from obseq.arrays import FloatArray, IntArray
from obseq.leastsquares.solvers.base import BaseSolver, inverse_by_columns
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import factor_stepwise


class SuperLU(BaseSolver):
    """SuperLU in symmetric mode: minimum degree of A + A', pivots on the diagonal.

    It has no analysis to reuse, and its selected inverse solves for every column of the identity.
    """

    name = "superlu"

    def _analyse(self, pattern: SymmetricPattern) -> None:
        self._positions = pattern.matrix(np.arange(1.0, pattern.nnz + 1.0))
        self._order = self._positions.data.astype(np.int64) - 1

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        def order() -> IntArray:
            return np.argsort(self._lu.perm_c)

        return factor_stepwise(self.pattern, values, tolerance, self._attempt, order)

    def _attempt(self, values: FloatArray, scale: FloatArray) -> FloatArray:
        """Factors; pivots divided by `scale`, 0 where SuperLU took one off the diagonal."""
        try:
            self._lu = self._decompose(values)
        except RuntimeError:  # "Factor is exactly singular": SuperLU does not say where, a tiny shift does
            shifted = values.copy()
            shifted[self.pattern.diagonal] *= 1.0 + 4.0 * np.finfo(float).eps
            self._lu = self._decompose(shifted)
        pivots = self._lu.U.diagonal()[self._lu.perm_c] / scale
        return np.where(self._lu.perm_r == self._lu.perm_c, pivots, 0.0)

    def _decompose(self, values: FloatArray) -> Factor:
        self._positions.data[:] = values[self._order]
        return splu(
            self._positions,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )

    def _solve(self, rhs: FloatArray) -> FloatArray:
        return np.asarray(self._lu.solve(rhs))

    def _selected_inverse(self) -> FloatArray:
        return inverse_by_columns(self.pattern, self._solve)

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation (of the last one: SuperLU analyses each time)."""
        self.defect()
        counts = np.diff(self._lu.L.indptr).astype(np.float64)
        return SolverStatistics(
            solver=self.name,
            ordering="minimum-degree",
            n=self.pattern.n,
            nnz_pattern=self.pattern.nnz,
            nnz_factor=self._lu.L.nnz,
            flops=float(np.sum(2.0 * counts**2)),
            memory=12 * (self._lu.L.nnz + self._lu.U.nnz),
        )
