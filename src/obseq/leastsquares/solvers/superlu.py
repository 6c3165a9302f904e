"""SuperLU through SciPy: an independent witness, always there, much slower on large systems."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from obseq.leastsquares.solvers.base import BaseSolver, inverse_by_columns
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics
from obseq.leastsquares.solvers.rank import relative_pivots, replacement_pivots

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU as Factor

    from obseq.leastsquares.solvers.protocol import FloatArray, IntArray, SymmetricPattern


class SuperLU(BaseSolver):
    """SuperLU in symmetric mode: minimum degree of A + A', pivots on the diagonal.

    It has no analysis to reuse, and its selected inverse solves for every column of the identity.
    """

    name = "superlu"

    def _analyse(self, pattern: SymmetricPattern) -> None:
        self._positions = pattern.matrix(np.arange(1.0, pattern.nnz + 1.0))
        self._order = self._positions.data.astype(np.int64) - 1

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        """Replaces one vanishing pivot after the other, the first in the order of elimination each time."""
        values = values.copy()
        diagonal = values[self._pattern.diagonal].copy()
        found: dict[int, float] = {int(j): 0.0 for j in np.flatnonzero(diagonal <= 0.0)}
        values[self._pattern.diagonal[list(found)]] += replacement_pivots(diagonal[list(found)])
        while (vanishing := self._first_vanishing(values, diagonal, tolerance)) is not None:
            unknown, pivot = vanishing
            found.setdefault(unknown, pivot)
            values[self._pattern.indptr[unknown]] += diagonal[unknown] * (1.0 - min(pivot, 0.0))
        indices: IntArray = np.array(sorted(found), dtype=np.int64)
        return Defect(indices, np.array([found[int(j)] for j in indices]))

    def _first_vanishing(
        self, values: FloatArray, diagonal: FloatArray, tolerance: float
    ) -> tuple[int, float] | None:
        """Factors; the first unknown whose pivot vanishes, with its relative pivot."""
        try:
            self._lu = self._decompose(values)
        except RuntimeError:  # "Factor is exactly singular": SuperLU does not say where, a tiny shift does
            shifted = values.copy()
            shifted[self._pattern.diagonal] *= 1.0 + 4.0 * np.finfo(float).eps
            self._lu = self._decompose(shifted)
        pivots = self._lu.U.diagonal()[self._lu.perm_c]
        pivots[self._lu.perm_r != self._lu.perm_c] = 0.0
        relative = relative_pivots(pivots, replacement_pivots(diagonal))
        elimination: IntArray = np.argsort(self._lu.perm_c)
        vanishing = np.flatnonzero(~(relative[elimination] > tolerance))
        if not len(vanishing):
            return None
        unknown = int(elimination[vanishing[0]])
        return unknown, float(relative[unknown])

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
        return inverse_by_columns(self._pattern, self._solve)

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation (of the last one: SuperLU analyses each time)."""
        self.defect()
        counts = np.diff(self._lu.L.indptr).astype(np.float64)
        return SolverStatistics(
            solver=self.name,
            ordering="minimum-degree",
            n=self._pattern.n,
            nnz_pattern=self._pattern.nnz,
            nnz_factor=self._lu.L.nnz,
            flops=float(np.sum(2.0 * counts**2)),
            memory=12 * (self._lu.L.nnz + self._lu.U.nnz),
        )
