"""A solver of constrained systems: any other solver, behind the substitution dX = T dY."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.errors import SingularMatrixError
from obseq.leastsquares.iterations.constraints import Substitution
from obseq.leastsquares.solvers import (
    Defect,
    InverseParts,
    Solver,
    SolverStatistics,
    SymmetricPattern,
    choose_solver,
)


class ConstrainedSolver:
    """Factors T' N T; stands for T (T' N T)^-1 T' wherever a solver stands for N^-1.

    The pattern that it is given is that of N.

    Args:
        substitution: gives T at the current values.
        choose: gives the solver of the substituted systems, from their pattern.
    """

    name = "constrained"

    def __init__(
        self,
        substitution: Callable[[], Substitution],
        choose: Callable[[SymmetricPattern], Solver] = choose_solver,
    ) -> None:
        self._present = substitution
        self._choose = choose
        self._substitution: Substitution | None = None
        self._kept: IntArray = np.zeros(0, dtype=np.int64)

    def analyse(self, pattern: SymmetricPattern) -> None:
        """Takes the pattern of N."""
        self._pattern = pattern

    def prepare(self) -> FloatArray:
        """The step (n,) that the constraints ask for at the current values.

        Raises:
            ContradictoryConstraintsError: they cannot hold together.
        """
        found = self._present()
        if not found.is_like(self._substitution):
            self._substitute(found)
        return found.offset

    def _substitute(self, substitution: Substitution) -> None:
        """Takes T, and analyses anew."""
        self._substitution, self._kept, self._matrix = substitution, substitution.kept, substitution.matrix
        self._map_entries(substitution)
        self._inner: Solver = self._choose(self._inner_pattern)
        self._inner.analyse(self._inner_pattern)

    def _map_entries(self, substitution: Substitution) -> None:
        """Which entries of N go to which entries of T' N T, and times what."""
        matrix, pattern = substitution.matrix, self._pattern
        row, column = pattern.indices.astype(np.int64), pattern.columns()
        count = np.diff(matrix.indptr).astype(np.int64)
        pairs = count[row] * count[column]
        source = np.repeat(np.arange(pattern.nnz), pairs)
        within = np.arange(len(source)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
        width = np.repeat(count[column], pairs)
        a = matrix.indptr[row[source]] + within // np.maximum(width, 1)
        b = matrix.indptr[column[source]] + within % np.maximum(width, 1)
        first, second = matrix.indices[a].astype(np.int64), matrix.indices[b].astype(np.int64)
        product = matrix.data[a] * matrix.data[b]
        diagonal = (row == column)[source]
        kept = ~diagonal | (first >= second)
        self._inner_pattern, self._target = _lower_pattern(
            matrix.shape[1], np.maximum(first, second)[kept], np.minimum(first, second)[kept]
        )
        self._source = source[kept]
        met_twice = ~diagonal & (first == second)
        self._weight = (product * np.where(met_twice, 2.0, 1.0))[kept]
        self._back_weight = (product * np.where(diagonal & (first != second), 2.0, 1.0))[kept]

    def factor(self, values: FloatArray) -> None:
        """Factors T' N T for the values of N.

        Raises:
            SingularMatrixError: the constrained system does not determine some unknowns.
        """
        weights = self._weight * values[self._source]
        inner: FloatArray = np.bincount(self._target, weights, self._inner_pattern.nnz).astype(np.float64)
        try:
            self._inner.factor(inner)
        except SingularMatrixError as error:
            raise SingularMatrixError(self._kept[error.indices], error.pivots) from None

    @property
    def is_factored(self) -> bool:
        """Whether a regular matrix was factored."""
        return self._substitution is not None and self._inner.is_factored

    def settle(self, step: FloatArray) -> FloatArray:
        """The step itself: there is no datum."""
        return step

    def solve(self, rhs: ArrayLike) -> FloatArray:
        """T (T' N T)^-1 T' times right-hand sides (n,) or (n, k)."""
        inner = self._inner.solve(self._matrix.T @ np.asarray(rhs, dtype=np.float64))
        return np.asarray(self._matrix @ inner)

    def selected_inverse(self) -> FloatArray:
        """(nnz,) entries of T (T' N T)^-1 T' on the pattern of N."""
        inner = self._inner.selected_inverse()
        weights = self._back_weight * inner[self._target]
        return np.bincount(self._source, weights, self._pattern.nnz).astype(np.float64)

    def inverse_parts(self) -> InverseParts:
        """The same, all of it in one part."""
        return InverseParts(self.selected_inverse(), np.zeros((self._pattern.n, 0)), np.zeros((0, 0)))

    def defect(self) -> Defect:
        """Where pivots vanished, in the numbering of N."""
        inner = self._inner.defect()
        return Defect(self._kept[inner.indices], inner.pivots)

    def null_vectors(self) -> FloatArray:
        """(n, k) basis of the changes that neither observations nor constraints resist."""
        return np.asarray(self._matrix @ self._inner.null_vectors())

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation of T' N T."""
        return self._inner.statistics


def _lower_pattern(n: int, row: IntArray, column: IntArray) -> tuple[SymmetricPattern, IntArray]:
    """The pattern that holds entries (row, column) of a lower triangle, and the place of each of them."""
    keys, place = np.unique(column * n + row, return_inverse=True)
    indptr = np.searchsorted(keys, n * np.arange(n + 1))
    return SymmetricPattern(n, indptr, (keys % max(n, 1)).astype(np.int32)), place
