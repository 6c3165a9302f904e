"""Cholesky factorisation of a whole matrix by several threads of ours.

Those of a BLAS library wait for one another without rest: on cores that others use as well, they take many
times as long as one. Here each thread has its own share of a step, and ends with it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.solvers.blas import GEMM, POTRF, SYRK, TRSM, call_blas, call_lapack
from obseq.pools import thread_pool

PANEL = 192
"""Columns of one step: wide enough for the products, which are most of the work."""

LEAST = 800
"""Unknowns from which threads gain more than their start costs: a factorisation takes 5 ms there."""


def factor_in_threads(columns: FloatArray, n: int, threads: int) -> int:
    """Factors the lower triangle of a matrix in place; 0, or 1 where it is not positive definite.

    Args:
        columns: (n * n,) the matrix, column by column.
        n: its order.
        threads: how many share each step; the caller keeps those of BLAS to one.
    """
    with thread_pool(threads) as pool:
        for first in range(0, n, PANEL):
            step = _Step(columns, n, first, min(first + PANEL, n))
            if call_lapack(POTRF, "L", step.width, step.place(first, first), n) != 0:
                return 1
            for work, bounds in (
                (step.solve_rows, step.even(threads)),
                (step.subtract_products, step.by_area(threads)),
            ):
                list(pool.map(work, *zip(*pairwise(bounds.tolist()), strict=True)))
    return 0


@dataclass(frozen=True)
class _Step:
    """One step: the columns from `first` to before `last` are factored, those behind them follow."""

    columns: FloatArray
    n: int
    first: int
    last: int

    @property
    def width(self) -> int:
        return self.last - self.first

    def place(self, row: int, column: int) -> FloatArray:
        """What begins at an entry."""
        return self.columns[row + column * self.n :]

    def even(self, threads: int) -> IntArray:
        """Bounds of shares of the rows below."""
        return np.asarray(self.last + (self.n - self.last) * np.arange(threads + 1) // threads)

    def by_area(self, threads: int) -> IntArray:
        """Bounds of shares of the columns behind with as many entries of the triangle."""
        left = np.sqrt(1.0 - np.arange(threads + 1) / threads)
        return np.asarray(self.n - np.rint((self.n - self.last) * left), dtype=np.int64)

    def solve_rows(self, begin: int, end: int) -> None:
        """Divides rows of the step's columns by its triangle."""
        if begin == end:
            return
        factor, rows = self.place(self.first, self.first), self.place(begin, self.first)
        call_blas(TRSM, "R", "L", "T", "N", end - begin, self.width, 1.0, factor, self.n, rows, self.n)

    def subtract_products(self, begin: int, end: int) -> None:
        """Subtracts products of the step's rows from columns behind it."""
        if begin == end:
            return
        n, width, rows = self.n, self.width, self.place(begin, self.first)
        call_blas(SYRK, "L", "N", end - begin, width, -1.0, rows, n, 1.0, self.place(begin, begin), n)
        if end < n:
            below, target = self.place(end, self.first), self.place(end, begin)
            call_blas(GEMM, "N", "T", n - end, end - begin, width, -1.0, below, n, rows, n, 1.0, target, n)
