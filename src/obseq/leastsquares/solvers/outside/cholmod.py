"""CHOLMOD, when scikit-sparse 0.4 is installed and asked for by name (its fast part is GPL)."""

from __future__ import annotations

from importlib import import_module

import numpy as np
from scipy.sparse import csc_matrix

from obseq.arrays import FloatArray
from obseq.errors import SolverUnavailableError
from obseq.leastsquares.solvers.base import BaseSolver, inverse_by_columns
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import factor_stepwise


class Cholmod(BaseSolver):
    """CHOLMOD's Cholesky, ordering and method of its own choice; no selected inverse of its own."""

    name = "cholmod"

    def __init__(self) -> None:
        super().__init__()
        try:
            cholmod = import_module("sksparse.cholmod")
        except ImportError as error:
            raise SolverUnavailableError(self.name, "scikit-sparse<0.5") from error
        if not hasattr(cholmod, "analyze"):
            raise SolverUnavailableError(self.name, "scikit-sparse<0.5")
        self._library = cholmod

    def _analyse(self, pattern: SymmetricPattern) -> None:
        full = pattern.matrix(np.arange(1.0, pattern.nnz + 1.0))
        self._positions = full.data.astype(np.int64) - 1
        parts = (full.data, full.indices.astype(np.int32), full.indptr.astype(np.int32))
        self._matrix = csc_matrix(parts, shape=full.shape)
        if pattern.n:
            self._factorisation = self._library.analyze(self._matrix)

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        return factor_stepwise(self.pattern, values, tolerance, self._attempt, self._factorisation.P)

    def _attempt(self, values: FloatArray, scale: FloatArray) -> FloatArray:
        """Factors; pivots divided by `scale`, 0 where CHOLMOD stopped and 1 for all others then."""
        order = self._factorisation.P()
        self._matrix.data[:] = values[self._positions]
        pivots = np.ones_like(scale)
        try:
            self._factorisation.cholesky_inplace(self._matrix)
        except self._library.CholmodNotPositiveDefiniteError as stop:
            pivots[order[stop.column]] = 0.0
            return pivots
        pivots[order] = self._factorisation.D()
        return np.asarray(pivots / scale)

    def _solve(self, rhs: FloatArray) -> FloatArray:
        return np.asarray(self._factorisation.solve_A(rhs))

    def _selected_inverse(self) -> FloatArray:
        return inverse_by_columns(self.pattern, self._solve)

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        self.defect()
        counts = np.diff(self._factorisation.L().indptr).astype(np.float64)
        return SolverStatistics(
            solver=self.name,
            ordering="cholmod",
            n=self.pattern.n,
            nnz_pattern=self.pattern.nnz,
            nnz_factor=int(counts.sum()),
            flops=float(np.sum(counts**2)),
            memory=int(8 * counts.sum()),
        )
