"""Covariances of the unknowns, from the inverse of the normal matrix on its own pattern."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import Solver, SymmetricPattern
from obseq.leastsquares.solvers.base import BaseSolver, forms_by_solves
from obseq.leastsquares.sparse import Sparse


class Cofactors:
    """Entries of Q = N^-1 on the pattern of N, frozen unknowns at zero; any other entry through a solve.

    `structure` is all that the pattern follows from: equal to that of whatever has the same one.
    """

    def __init__(
        self,
        table: UnknownTable,
        free: FreeUnknowns,
        pattern: SymmetricPattern,
        solver: Solver,
        structure: object,
    ) -> None:
        self.table = table
        self._free = free
        self.pattern = pattern
        self._solver = solver
        self.structure = structure
        self.parts = solver.inverse_parts()
        self.values = self.parts.whole(pattern)

    def blocks(self, ids: ArrayLike) -> FloatArray:
        """(n, k, k) cofactors of blocks that are alike."""
        free = self._free.number[self.table.scalars(ids, "covariance")]
        row, column = free[:, :, None], free[:, None, :]
        low, high = np.minimum(row, column), np.maximum(row, column)
        present = low >= 0
        if not present.any():
            return np.zeros(present.shape)
        at = self.pattern.indptr[np.where(present, low, 0)] + high - low
        return np.where(present, self.values[np.where(present, at, 0)], 0.0)

    def variances(self) -> FloatArray:
        """(n_scalars,) diagonal of Q for all unknowns, zero where frozen."""
        result = np.zeros(len(self._free.number))
        result[self._free.scalars] = self.values[self.pattern.diagonal]
        return result

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Q times right-hand sides (n_free,) or (n_free, k)."""
        return self._solver.solve(rhs)

    def quadratic_forms(self, rows: Sparse) -> FloatArray:
        """(k,) b Q b' of the rows b of a sparse matrix (k, n_free)."""
        solver, entries = self._solver, (rows.values, rows.columns, rows.starts)
        if isinstance(solver, BaseSolver):
            return solver.quadratic_forms(*entries)
        return forms_by_solves(solver.solve, self.pattern.n, *entries)

    def between(self, first: ArrayLike, second: ArrayLike) -> FloatArray:
        """(n, m) cofactors between two lists of unknowns (positions among all unknowns), by solves."""
        rows = np.atleast_1d(np.asarray(first, dtype=np.int64))
        columns = np.atleast_1d(np.asarray(second, dtype=np.int64))
        free_rows, free_columns = self._free.number[rows], self._free.number[columns]
        if not (free_rows >= 0).any():
            return np.zeros((len(rows), len(columns)))
        units = np.zeros((self.pattern.n, len(columns)))
        present = np.flatnonzero(free_columns >= 0)
        units[free_columns[present], present] = 1.0
        solved = self._solver.solve(units)
        return np.where(free_rows[:, None] >= 0, solved[np.maximum(free_rows, 0)], 0.0)
