"""Sparse matrices by rows, with the few products that equations and their tests need.

SciPy's take longer to import than NumPy does, and a network of a thousand points to adjust.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IndexArray, IntArray
from obseq.cached import cached_property
from obseq.compilation import compiled
from obseq.leastsquares.loops.sorting import sorted_by
from obseq.leastsquares.solvers import SymmetricPattern


class Sparse:
    """A sparse matrix by rows. Entries at one place count together.

    Args:
        values: (nnz,) entries, row by row.
        columns: (nnz,) the column of each.
        starts: (n + 1,) where each row begins among them.
        width: Number of columns.
    """

    __array_ufunc__ = None

    def __init__(self, values: FloatArray, columns: IntArray | IndexArray, starts: IntArray, width: int):
        self.values = np.ascontiguousarray(values, dtype=np.float64)
        self.columns = np.ascontiguousarray(columns, dtype=np.int32)
        self.starts = np.ascontiguousarray(starts, dtype=np.int64)
        self.shape = len(starts) - 1, width

    @classmethod
    def of_entries(
        cls,
        values: FloatArray,
        rows: IntArray | IndexArray,
        columns: IntArray | IndexArray,
        shape: tuple[int, int],
    ) -> Sparse:
        """From entries (nnz,) in any order."""
        order, starts = sorted_by(rows.astype(np.int32), shape[0])
        return cls(np.asarray(values)[order], columns[order], starts, shape[1])

    @classmethod
    def of_dense(cls, matrix: FloatArray) -> Sparse:
        """From a plain array (n, k): its entries that are not zero."""
        rows, columns = np.nonzero(matrix)
        return cls.of_entries(matrix[rows, columns], rows, columns, matrix.shape)

    @classmethod
    def of_blocks(cls, blocks: FloatArray) -> Sparse:
        """(n m, n m) from blocks (n, m, m) along its diagonal; all their entries are stored."""
        n, m, _ = blocks.shape
        columns = np.arange(n * m).reshape(n, 1, m).repeat(m, axis=1)
        return cls(blocks.ravel(), columns.ravel(), m * np.arange(n * m + 1), n * m)

    @classmethod
    def of_diagonal(cls, values: FloatArray) -> Sparse:
        """(n, n) from its diagonal (n,)."""
        return cls.of_blocks(values[:, None, None])

    @property
    def T(self) -> Sparse:  # noqa: N802 (as of plain arrays)
        """Its transpose."""
        return self._transposed

    @cached_property
    def _transposed(self) -> Sparse:
        n, k = self.shape
        return Sparse.of_entries(self.values, self.columns, np.arange(n).repeat(self.counts), (k, n))

    @property
    def counts(self) -> IntArray:
        """(n,) entries of each row."""
        return self.starts[1:] - self.starts[:-1]

    @overload
    def __matmul__(self, other: Sparse) -> Sparse: ...

    @overload
    def __matmul__(self, other: FloatArray) -> FloatArray: ...

    def __matmul__(self, other: Sparse | FloatArray) -> Sparse | FloatArray:
        """Its product with another sparse matrix (k, m), or with a plain one (k,) or (k, m)."""
        if self.shape[1] != other.shape[0]:
            raise ValueError(f"matrices {self.shape} and {other.shape} have no product")
        return self._times(other) if isinstance(other, Sparse) else self._times_plain(other)

    def _times(self, other: Sparse) -> Sparse:
        seen, starts = np.full(other.shape[1], -1), np.zeros(len(self.starts), dtype=np.int64)
        count_products(self.columns, self.starts, other.columns, other.starts, seen, starts)
        starts = starts.cumsum()
        columns = np.empty(starts[-1], dtype=np.int32)
        result = Sparse(np.zeros(starts[-1]), columns, starts, other.shape[1])
        write_products(*self._arrays(), *other._arrays(), seen, *result._arrays())
        return result

    def _times_plain(self, other: FloatArray) -> FloatArray:
        flat = np.ascontiguousarray(other[:, None] if other.ndim == 1 else other)
        result = np.zeros((self.shape[0], flat.shape[1]))
        multiply(*self._arrays(), flat, result)
        return result[:, 0] if other.ndim == 1 else result

    def transposed_times(self, other: FloatArray) -> FloatArray:
        """The product of its transpose, which is not made, with a plain matrix (n,) or (n, m)."""
        flat = np.ascontiguousarray(other[:, None] if other.ndim == 1 else other)
        result = np.zeros((self.shape[1], flat.shape[1]))
        multiply_transposed(*self._arrays(), flat, result)
        return result[:, 0] if other.ndim == 1 else result

    def with_columns_scaled(self, factors: FloatArray) -> Sparse:
        """Its columns times factors (k,)."""
        return Sparse(self.values * factors[self.columns], self.columns, self.starts, self.shape[1])

    def _arrays(self) -> tuple[FloatArray, IndexArray, IntArray]:
        return self.values, self.columns, self.starts

    def scaled(self, factors: FloatArray) -> Sparse:
        """Its rows times factors (n,)."""
        return Sparse(self.values * factors.repeat(self.counts), self.columns, self.starts, self.shape[1])

    def some(self, rows: IntArray) -> Sparse:
        """Some of its rows (m,)."""
        counts = self.counts[rows]
        starts = np.append(0, counts.cumsum())
        at = np.arange(starts[-1]) + (self.starts[rows] - starts[:-1]).repeat(counts)
        return Sparse(self.values[at], self.columns[at], starts, self.shape[1])

    def dots(self, other: Sparse) -> FloatArray:
        """(n,) the products of its rows with those of another (n, k)."""
        result = np.zeros(self.shape[0])
        multiply_rows(*self._arrays(), *other._arrays(), np.zeros(self.shape[1]), result)
        return result

    def diagonal(self) -> FloatArray:
        """(n,) its diagonal."""
        own = self.columns == np.arange(self.shape[0]).repeat(self.counts)
        result = np.zeros(self.shape[0])
        np.add.at(result, self.columns[own], self.values[own])
        return result

    def toarray(self) -> FloatArray:
        """(n, k) the same as a plain array."""
        n, k = self.shape
        places = (k * np.arange(n)).repeat(self.counts) + self.columns
        result = np.zeros(n * k)
        np.add.at(result, places, self.values)
        return result.reshape(n, k)


def stacked(parts: Sequence[Sparse]) -> Sparse:
    """Matrices of one width below each other."""
    counts = np.concatenate([part.counts for part in parts])
    values, columns = (np.concatenate(each) for each in zip(*(p._arrays()[:2] for p in parts), strict=True))
    return Sparse(values, columns, np.append(0, counts.cumsum()), parts[0].shape[1])


def on_diagonal(parts: Sequence[Sparse]) -> Sparse:
    """Matrices along a diagonal."""
    ends = np.cumsum([0, *(part.shape[1] for part in parts)]).tolist()
    moved = [
        Sparse(p.values, p.columns + end, p.starts, ends[-1]) for p, end in zip(parts, ends[:-1], strict=True)
    ]
    return stacked(moved) if moved else Sparse.of_dense(np.zeros((0, 0)))


def symmetric(pattern: SymmetricPattern, values: FloatArray) -> Sparse:
    """(n, n) a symmetric matrix from the values of its lower triangle."""
    rows, columns, below = pattern.indices, pattern.columns(), np.ones(pattern.nnz, dtype=np.bool_)
    below[pattern.diagonal] = False
    return Sparse.of_entries(
        np.append(values, values[below]),
        np.append(rows, columns[below]),
        np.append(columns, rows[below]),
        (pattern.n, pattern.n),
    )


@compiled
def count_products(
    columns: IndexArray,
    starts: IntArray,
    other_columns: IndexArray,
    other_starts: IntArray,
    seen: IntArray,
    counts: IntArray,
) -> None:
    """Writes how many entries the rows of a product have, one place behind each; `seen` is -1 at first."""
    for row in range(len(starts) - 1):
        for at in range(starts[row], starts[row + 1]):
            for k in range(other_starts[columns[at]], other_starts[columns[at] + 1]):
                column = other_columns[k]
                if seen[column] != row:
                    seen[column] = row
                    counts[row + 1] += 1


@compiled
def write_products(
    values: FloatArray,
    columns: IndexArray,
    starts: IntArray,
    other_values: FloatArray,
    other_columns: IndexArray,
    other_starts: IntArray,
    place: IntArray,
    found_values: FloatArray,
    found_columns: IndexArray,
    found_starts: IntArray,
) -> None:
    """Writes the entries of a product, whose values are zero at first, in no order."""
    for k in range(len(place)):
        place[k] = -1
    for row in range(len(starts) - 1):
        end = found_starts[row]
        for at in range(starts[row], starts[row + 1]):
            value = values[at]
            for k in range(other_starts[columns[at]], other_starts[columns[at] + 1]):
                column = other_columns[k]
                if place[column] < found_starts[row]:
                    place[column] = end
                    found_columns[end] = column
                    end += 1
                found_values[place[column]] += value * other_values[k]


@compiled
def multiply(
    values: FloatArray, columns: IndexArray, starts: IntArray, other: FloatRows, result: FloatRows
) -> None:
    """Adds the product with a plain matrix."""
    for row in range(len(starts) - 1):
        for at in range(starts[row], starts[row + 1]):
            value, column = values[at], columns[at]
            for k in range(other.shape[1]):
                result[row, k] += value * other[column, k]


@compiled
def multiply_transposed(
    values: FloatArray, columns: IndexArray, starts: IntArray, other: FloatRows, result: FloatRows
) -> None:
    """Adds the product of the transpose with a plain matrix."""
    for row in range(len(starts) - 1):
        for at in range(starts[row], starts[row + 1]):
            value, column = values[at], columns[at]
            for k in range(other.shape[1]):
                result[column, k] += value * other[row, k]


@compiled
def multiply_rows(
    values: FloatArray,
    columns: IndexArray,
    starts: IntArray,
    other_values: FloatArray,
    other_columns: IndexArray,
    other_starts: IntArray,
    row_values: FloatArray,
    result: FloatArray,
) -> None:
    """Adds the products of rows with rows; `row_values` is zero before and after."""
    for row in range(len(starts) - 1):
        for at in range(starts[row], starts[row + 1]):
            row_values[columns[at]] += values[at]
        for at in range(other_starts[row], other_starts[row + 1]):
            result[row] += row_values[other_columns[at]] * other_values[at]
        for at in range(starts[row], starts[row + 1]):
            row_values[columns[at]] = 0.0
