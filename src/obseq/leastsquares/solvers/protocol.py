"""What a solver of symmetric positive definite systems takes, does and raises."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csc_array

    from obseq.arrays import FloatArray, IntArray


ROUNDING = 1e-14
"""Share of a variance that is left as rounding where the other part of an inverse takes it away."""

MANY = 5_000
"""Entries of a matrix from which on SciPy's products are worth what it takes to ask for them."""


@dataclass(frozen=True)
class SymmetricPattern:
    """Where a symmetric matrix may be non-zero: its lower triangle by columns (CSC), diagonal included.

    Attributes:
        n: number of unknowns.
        indptr: (n + 1,) int64, start of each column in `indices`.
        indices: (nnz,) rows, ascending in each column; the first of each column is the diagonal.
    """

    n: int
    indptr: IntArray
    indices: NDArray[np.integer]

    def __post_init__(self) -> None:
        object.__setattr__(self, "indptr", np.ascontiguousarray(self.indptr, dtype=np.int64))
        if np.asarray(self.indices).dtype.kind not in "iu":
            raise InputError("pattern: `indices` must be integers")
        object.__setattr__(self, "indices", np.ascontiguousarray(self.indices))
        self._check()

    def _check(self) -> None:
        indptr, indices = self.indptr, self.indices
        if indptr.shape != (self.n + 1,) or (self.n >= 0 and (indptr[0] != 0 or indptr[-1] != len(indices))):
            raise InputError(f"pattern: `indptr` must go from 0 to {len(indices)} in {self.n + 1} entries")
        tops = indptr[:-1]
        if (indptr[1:] <= tops).any() or (indices[tops] != np.arange(self.n)).any():
            raise InputError("pattern: each column must start with its diagonal entry")
        ascending = indices[1:] > indices[:-1]
        ascending[indptr[1:-1] - 1] = True
        if not ascending.all() or (len(indices) and indices.max() >= self.n):
            raise InputError("pattern: rows must be below n, ascending in each column, without repetition")

    @property
    def nnz(self) -> int:
        """Number of entries of the lower triangle, diagonal included."""
        return len(self.indices)

    @property
    def diagonal(self) -> IntArray:
        """(n,) positions of the diagonal entries among the values."""
        return self.indptr[:-1]

    def columns(self) -> IntArray:
        """(nnz,) column of each entry."""
        return np.arange(self.n).repeat(self.indptr[1:] - self.indptr[:-1])

    def product(self, values: FloatArray, vectors: FloatArray) -> FloatArray:
        """The whole symmetric matrix times (n,) or (n, k), from the values of the lower triangle."""
        if vectors.ndim > 1 and self.nnz <= MANY:
            return np.stack([self.product(values, vector) for vector in vectors.T], axis=1)
        diagonal = (values[self.diagonal] * vectors.T).T
        if self.nnz > MANY:
            from scipy.sparse import csc_array

            lower = csc_array((values, self.indices, self.indptr), shape=(self.n, self.n))
            return np.asarray(lower @ vectors + lower.T @ vectors - diagonal)
        below = np.bincount(self.indices, values * vectors[self.columns()], self.n)
        above = np.add.reduceat(values * vectors[self.indices], self.diagonal)  # no column is empty
        return np.asarray(below + above - diagonal)

    def dense(self, values: FloatArray) -> FloatArray:
        """(n, n) the whole symmetric matrix from the values of the lower triangle."""
        columns, whole = self.columns(), np.zeros((self.n, self.n))
        whole[self.indices, columns] = values
        whole[columns, self.indices] = values
        return whole

    def matrix(self, values: FloatArray) -> csc_array:
        """The whole symmetric matrix, both triangles, from the values of the lower one."""
        from scipy.sparse import coo_array

        rows, columns = self.indices, self.columns()
        below = rows > columns
        both = (np.concatenate([rows, columns[below]]), np.concatenate([columns, rows[below]]))
        full = coo_array((np.concatenate([values, values[below]]), both), shape=(self.n, self.n)).tocsc()
        full.sort_indices()
        return full

    @classmethod
    def of(cls, matrix: Any) -> tuple[SymmetricPattern, FloatArray]:
        """The pattern and the values of the lower triangle of a symmetric matrix, dense or sparse.

        Entries of the diagonal are in the pattern even where they are zero.
        """
        from scipy.sparse import coo_array

        entries = coo_array(matrix)
        n = entries.shape[0]
        lower = entries.row >= entries.col
        rows = np.concatenate([entries.row[lower], np.arange(n)])
        columns = np.concatenate([entries.col[lower], np.arange(n)])
        data = np.concatenate([entries.data[lower].astype(np.float64), np.zeros(n)])
        union = coo_array((data, (rows, columns)), shape=(n, n)).tocsc()
        union.sort_indices()
        return cls(n, union.indptr.astype(np.int64), union.indices), union.data


@dataclass(frozen=True)
class Defect:
    """Unknowns where pivots vanish.

    Attributes:
        indices: (k,) the unknowns, ascending; which ones of a dependent set depends on the elimination order.
        pivots: (k,) their pivots divided by their diagonal entries (0 where the diagonal itself is zero);
            markedly negative where the matrix is indefinite.
        weakest: The least of the other pivots, 1 at most.
    """

    indices: IntArray
    pivots: FloatArray
    weakest: float = 1.0

    @property
    def dimension(self) -> int:
        """Number of vanishing pivots: the dimension of the kernel of a positive semi-definite matrix."""
        return len(self.indices)


@dataclass(frozen=True)
class SolverStatistics:
    """What an analysis found.

    Attributes:
        solver: name of the solver.
        ordering: name of the fill-reducing ordering in use.
        n: number of unknowns.
        nnz_pattern: entries of the lower triangle of the matrix.
        nnz_factor: entries of the lower triangle of the factor, explicit zeros included.
        flops: floating-point operations of one factorisation.
        memory: bytes kept by the solver for a factorisation.
    """

    solver: str
    ordering: str
    n: int
    nnz_pattern: int
    nnz_factor: int
    flops: float
    memory: int


class InverseParts(NamedTuple):
    """The inverse of a matrix as the sum of one on its pattern, which is well conditioned, and U K U'.

    Attributes:
        values: (nnz,) entries of the first part, in the order of the pattern.
        vectors: (n, p) U; p = 0 for a matrix that is well conditioned itself.
        core: (p, p) K.
    """

    values: FloatArray
    vectors: FloatArray
    core: FloatArray

    def whole(self, pattern: SymmetricPattern) -> FloatArray:
        """(nnz,) entries of the sum on the pattern; none of what a datum alone determines."""
        if not self.core.size:
            return self.values
        entries, rows, columns = self.values.copy(), pattern.indices, pattern.columns()
        for one, share in zip(self.vectors.T, (self.vectors @ self.core).T, strict=True):
            entries += one[rows] * share[columns]
        is_none = ~(entries[pattern.diagonal] > ROUNDING * self.values[pattern.diagonal])
        entries[is_none[rows] | is_none[columns]] = 0.0
        return entries


class Solver(Protocol):
    """Factors positive definite matrices of one pattern: `analyse` once, `factor` as often as wanted.

    Those that keep equations exactly, or end on a datum, are solvers too: `prepare` comes before `factor`
    wherever values have changed, and `settle` after `solve`, for who takes the solution as a step.
    """

    @property
    def name(self) -> str:
        """Name by which the solver is chosen."""

    def analyse(self, pattern: SymmetricPattern) -> None:
        """Prepares for matrices of this pattern: elimination order, structure of the factor."""

    def prepare(self) -> FloatArray:
        """(n,) the step that what holds exactly asks for at the current values; zero without."""

    def factor(self, values: FloatArray) -> None:
        """Factors the matrix of these values ((nnz,), in the order of the pattern).

        Raises:
            SingularMatrixError: pivots vanish; `defect` and `null_vectors` then tell where and how.
        """

    @property
    def is_factored(self) -> bool:
        """Whether a regular matrix was factored."""

    def settle(self, step: FloatArray) -> FloatArray:
        """Where a step (n,) shall end: on the datum; itself without."""

    def solve(self, rhs: ArrayLike) -> FloatArray:
        """Solution for one right-hand side (n,) or several (n, k); same shape."""

    def selected_inverse(self) -> FloatArray:
        """(nnz,) entries of the inverse at the entries of the pattern, in its order."""

    def inverse_parts(self) -> InverseParts:
        """The same in two parts: what is weakly determined is apart, and keeps its digits in products."""

    def defect(self) -> Defect:
        """Where pivots vanished in the last factorisation; empty for a regular matrix."""

    def null_vectors(self) -> FloatArray:
        """(n, k) orthonormal basis of the kernel of the last matrix; k = 0 for a regular matrix."""

    @property
    def statistics(self) -> SolverStatistics:
        """Size and cost of the factorisation."""
