"""Dense Cholesky: small systems and nearly full matrices; no compilation, no analysis."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.cached import cached_property
from obseq.leastsquares.solvers.base import BaseSolver
from obseq.leastsquares.solvers.blas import POTRF, POTRI, POTRS, call_lapack
from obseq.leastsquares.solvers.dense_loops import factor_columns, invert_small, solve_columns
from obseq.leastsquares.solvers.dense_threads import LEAST, factor_in_threads
from obseq.leastsquares.solvers.protocol import Defect, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import defect_of, relative_pivots, replacement_pivots

SMALL = 64
"""Matrices of so few unknowns are treated by plain loops: loading LAPACK takes longer."""


class DenseCholesky(BaseSolver):
    """Cholesky of the whole matrix, unknowns in their own order: plain loops or, beyond `SMALL`, LAPACK.

    Args:
        threads: how many share the factorisation of a large matrix.
    """

    name = "dense"

    def __init__(self, threads: int = 1) -> None:
        super().__init__()
        self._threads = threads

    def _analyse(self, pattern: SymmetricPattern) -> None:
        self._is_small = pattern.n <= SMALL
        for made in ("_places", "_columns"):
            self.__dict__.pop(made, None)

    @cached_property
    def _places(self) -> IntArray:
        """(nnz,) where the entries of the pattern are in the matrix."""
        pattern = self.pattern
        return pattern.columns().astype(np.int64) * pattern.n + pattern.indices

    @cached_property
    def _columns(self) -> FloatArray:
        """(n n,) the matrix by columns, made when it is first factored: small systems seldom ask for it."""
        return np.zeros(self.pattern.n**2)

    @property
    def _lower(self) -> FloatArray:
        """(n, n) the same as rows and columns; its lower triangle is used."""
        return self._columns.reshape(self.pattern.n, self.pattern.n).T

    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        diagonal = values[self.pattern.diagonal]
        self._fill(values)
        if self._is_small:
            n, pivots = self.pattern.n, diagonal.copy()
            factor_columns(self._columns, 0, n, n, n, pivots, 0, tolerance)
            return defect_of(pivots, tolerance)
        status = self._factor_large()
        pivots = relative_pivots(np.square(np.diagonal(self._lower)), diagonal)
        if status != 0 or not np.all(pivots > tolerance):
            self._fill(values)
            pivots = factor_replacing(self._lower, tolerance)
        return defect_of(pivots, tolerance)

    def _factor_large(self) -> int:
        n = self.pattern.n
        if self._threads > 1 and n >= LEAST:
            return factor_in_threads(self._columns, n, self._threads)
        return call_lapack(POTRF, "L", n, self._columns, n)

    def _fill(self, values: FloatArray) -> None:
        self._columns[:] = 0.0
        self._columns[self._places] = values

    def _solve(self, rhs: FloatArray) -> FloatArray:
        n, x = self.pattern.n, np.array(rhs.reshape(len(rhs), -1).T, order="C")
        if self._is_small:
            solve_columns(self._columns, n, x)
        else:
            call_lapack(POTRS, "L", n, len(x), self._columns, n, x, n)
        return x.T.reshape(rhs.shape)

    def _selected_inverse(self) -> FloatArray:
        n = self.pattern.n
        if self._is_small:
            inverse = np.zeros_like(self._columns)
            invert_small(self._columns, 0, n, n, inverse, 0, np.empty(n))
        else:
            inverse = self._columns.copy()
            call_lapack(POTRI, "L", n, inverse, n)
        return np.asarray(inverse[self._places])

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
        n = self.pattern.n
        return SolverStatistics(
            solver=self.name,
            ordering="natural",
            n=n,
            nnz_pattern=self.pattern.nnz,
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
