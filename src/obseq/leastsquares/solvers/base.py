"""The order of the steps, the checks and the treatment of singular matrices, common to all solvers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IndexArray, IntArray
from obseq.errors import InputError, SingularMatrixError, SolverStateError
from obseq.leastsquares.solvers.protocol import Defect, InverseParts, SolverStatistics, SymmetricPattern
from obseq.leastsquares.solvers.rank import (
    CLEAR,
    LARGEST_EXAMINED,
    SUSPICIOUS,
    hidden,
    kernel,
    replacement_pivots,
    undetermined,
)


class BaseSolver(ABC):
    """A solver that knows which of its steps were done.

    A suspicious pivot of unknown j is replaced by w_j = a_jj (1 if that is zero) and the rest of its column
    by zero, so that the factor is that of N + sum_j w_j e_j e_j'. What that shows decides (see `rank`).
    """

    name: ClassVar[str]

    def __init__(self) -> None:
        self._analysed: SymmetricPattern | None = None
        self._found: Defect | None = None
        self._replaced: IntArray = np.empty(0, dtype=np.int64)
        self._values = np.empty(0)

    def analyse(self, pattern: SymmetricPattern) -> None:
        """Prepares for matrices of this pattern: elimination order, structure of the factor."""
        self._found = None
        self._analysed = None
        self._analyse(pattern)
        self._analysed = pattern

    def prepare(self) -> FloatArray:
        """Nothing holds exactly."""
        return np.zeros(self.pattern.n)

    def factor(self, values: FloatArray) -> None:
        """Factors the matrix of these values ((nnz,), in the order of the pattern), once if they come again.

        Linear equations have the same matrix at each iteration, and at the solution.

        Raises:
            SingularMatrixError: pivots vanish; `defect` and `null_vectors` then tell where and how.
        """
        values = self.checked(values)
        if self.is_factored and np.array_equal(values, self._values):
            return
        self.invalidate()
        if len(self._values) != len(values):
            self._values = np.empty(len(values))
        self._values[:] = values
        if not len(values):
            self._found = Defect(np.empty(0, dtype=np.int64), np.empty(0))
            return
        found = suspects = self._factor_replacing(values)
        if suspects.dimension:
            found = undetermined(suspects, self.pattern, values, self._solve)
        replaced = suspects.indices
        if suspects.dimension and not found.dimension:
            found = self._factor(values, 0.0)
            replaced = found.indices
        self._replaced = replaced
        self._found = found  # the last: an interrupted factorisation is none
        self._require_regular()

    def _factor_replacing(self, values: FloatArray) -> Defect:
        """Factors with all pivots replaced that may have to vanish, those that rounding hides among them."""
        suspects = self._factor(values, SUSPICIOUS)
        if suspects.weakest > CLEAR and not suspects.dimension:
            return suspects
        held: IntArray = np.zeros(0, dtype=np.int64)
        while (found := self._hidden_beside(suspects, held, values)) is not None:
            held = np.append(held, found)
            suspects = self._factor(self._raised(values, held), SUSPICIOUS)
        replaced = np.union1d(suspects.indices, held)
        pivots = np.zeros(self.pattern.n)
        pivots[suspects.indices] = suspects.pivots
        return Defect(replaced, pivots[replaced], suspects.weakest)

    def _hidden_beside(self, suspects: Defect, held: IntArray, values: FloatArray) -> int | None:
        """One more unknown that the matrix leaves undetermined, beside those replaced and held."""
        replaced = np.union1d(suspects.indices, held)
        if (suspects.pivots < -CLEAR).any() or len(replaced) > LARGEST_EXAMINED:
            return None
        found = hidden(self.pattern, self._raised(values, replaced), self._solve)
        return None if found in replaced else found

    def _raised(self, values: FloatArray, held: IntArray) -> FloatArray:
        """The matrix with the diagonal entries of the unknowns held doubled (1 where they are zero)."""
        raised, places = values.copy(), self.pattern.diagonal[held]
        raised[places] += replacement_pivots(values[places])
        return raised

    @property
    def is_factored(self) -> bool:
        """Whether a regular matrix was factored."""
        return self._found is not None and not self._found.dimension

    def settle(self, step: FloatArray) -> FloatArray:
        """The step itself: there is no datum."""
        return step

    def solve(self, rhs: ArrayLike) -> FloatArray:
        """Solution for one right-hand side (n,) or several (n, k); same shape."""
        self._require_regular()
        right = np.asarray(rhs, dtype=np.float64)
        if right.ndim not in (1, 2) or right.shape[0] != self.pattern.n:
            raise InputError(f"right-hand side of shape {right.shape} for {self.pattern.n} unknowns")
        if not right.size:
            return right.copy()
        return self._solve(right.reshape(self.pattern.n, -1)).reshape(right.shape)

    def selected_inverse(self) -> FloatArray:
        """(nnz,) entries of the inverse at the entries of the pattern, in its order.

        The values of the matrix, which only another factorisation would ask for, are forgotten.
        """
        self._require_regular()
        self._values = np.empty(0)
        return self._selected_inverse() if self.pattern.n else np.empty(0)

    def inverse_parts(self) -> InverseParts:
        """The same, all of it in one part."""
        return InverseParts(self.selected_inverse(), np.zeros((self.pattern.n, 0)), np.zeros((0, 0)))

    def quadratic_forms(self, values: FloatArray, columns: IndexArray, starts: IntArray) -> FloatArray:
        """(k,) b N^-1 b' of sparse rows b: entries (nnz,), their columns, where each row begins (k + 1,)."""
        return forms_by_solves(self.solve, self.pattern.n, values, columns, starts)

    def defect(self) -> Defect:
        """Where pivots vanished in the last factorisation; empty for a regular matrix."""
        if self._found is None:
            raise SolverStateError(f"{self.name}: call factor(values) first")
        return self._found

    def null_vectors(self) -> FloatArray:
        """(n, k) orthonormal basis of the kernel of the last matrix; k = 0 for a regular matrix."""
        if not self.defect().dimension:
            return np.empty((self.pattern.n, 0))
        return kernel(self._replaced, self.pattern, self._values, self._solve)

    def invalidate(self) -> None:
        """Forgets the last factorisation."""
        self._found = None

    @property
    @abstractmethod
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""

    @property
    def pattern(self) -> SymmetricPattern:
        """What was analysed."""
        if self._analysed is None:
            raise SolverStateError(f"{self.name}: call analyse(pattern) first")
        return self._analysed

    def checked(self, values: FloatArray) -> FloatArray:
        """Finite values that fit the pattern."""
        values = np.ascontiguousarray(values, dtype=np.float64)
        if values.shape != (self.pattern.nnz,):
            raise InputError(f"{values.shape} values for a pattern of {self.pattern.nnz} entries")
        if not np.isfinite(values.sum()):
            at = int(np.argmin(np.isfinite(values)))
            row, column = self.pattern.indices[at], np.searchsorted(self.pattern.indptr, at, "right") - 1
            raise InputError(f"the matrix is not finite at row {row}, column {column}")
        return values

    def _require_regular(self) -> None:
        defect = self.defect()
        if defect.dimension:
            raise SingularMatrixError(defect.indices, defect.pivots)

    @abstractmethod
    def _analyse(self, pattern: SymmetricPattern) -> None: ...

    @abstractmethod
    def _factor(self, values: FloatArray, tolerance: float) -> Defect:
        """Factors; replaces pivots not above this share of the diagonal entry, and says which they are."""

    @abstractmethod
    def _solve(self, rhs: FloatArray) -> FloatArray:
        """Solves with the factor as it is; `rhs` (n, k) is left unchanged."""

    @abstractmethod
    def _selected_inverse(self) -> FloatArray: ...


AT_ONCE, NUMBERS = 64, 4_000_000
"""Sparse right-hand sides that are treated together: as many as share what is in cache, in 32 MB."""


def forms_by_solves(
    solve: Callable[[FloatArray], FloatArray],
    n: int,
    values: FloatArray,
    columns: IndexArray,
    starts: IntArray,
) -> FloatArray:
    """(k,) b Q b' of sparse rows b (k, n), by solving for them."""
    result, many = np.empty(len(starts) - 1), max(1, min(AT_ONCE, NUMBERS // max(n, 1)))
    for first in range(0, len(result), many):
        own = starts[first : first + many + 1]
        right, chosen = np.zeros((n, len(own) - 1)), slice(own[0], own[-1])
        np.add.at(right, (columns[chosen], np.repeat(np.arange(len(own) - 1), np.diff(own))), values[chosen])
        result[first : first + many] = np.einsum("nk,nk->k", right, solve(right))
    return result


def inverse_by_columns(
    pattern: SymmetricPattern, solve: Callable[[FloatArray], FloatArray], at_once: int = 64
) -> FloatArray:
    """Selected inverse (nnz,) by solving for all columns of the identity: for witnesses and small systems."""
    selected = np.empty(pattern.nnz)
    for first in range(0, pattern.n, at_once):
        count = min(at_once, pattern.n - first)
        unit = np.zeros((pattern.n, count))
        unit[np.arange(first, first + count), np.arange(count)] = 1.0
        entries = slice(pattern.indptr[first], pattern.indptr[first + count])
        columns = np.repeat(np.arange(count), np.diff(pattern.indptr[first : first + count + 1]))
        selected[entries] = solve(unit)[pattern.indices[entries], columns]
    return selected
