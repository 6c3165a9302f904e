"""The loops from the inverse of the normal matrix back to the observations, compiled once for all formulas.

All unknowns of one equation are joined in the normal matrix N, so the entries of Q = N^-1 that a Q a' needs,
with a the row of the equation, are on the pattern of N: they are read there, one small block after another.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IndexArray, IntArray
from obseq.compilation import compiled
from obseq.leastsquares.loops.loop_arguments import EquationRows, SparseInverse


@compiled
def _place(indptr: IntArray, indices: IndexArray, row: int, column: int) -> int:
    """Position of an entry of the lower triangle among the values; it must be on the pattern."""
    low, high = np.int64(indptr[column]), np.int64(indptr[column + 1])
    while high - low > 1:
        middle = (low + high) // 2
        if indices[middle] <= row:
            low = middle
        else:
            high = middle
    return int(low)


@compiled
def _read_block(
    inverse: SparseInverse,
    left: int,
    right: int,
    n_left: int,
    n_right: int,
    block: FloatRows,
) -> bool:
    """Copies a block of Q, zero where an unknown is frozen; False when the whole of it is.

    The free unknowns of a block follow each other in the matrix: one entry searched tells the places of all.
    """
    number, indptr = inverse.number, inverse.indptr
    first_row, first_column = -1, -1
    for i in range(n_left):
        if first_row < 0:
            first_row = number[left + i]
    for j in range(n_right):
        if first_column < 0:
            first_column = number[right + j]
    if first_row < 0 or first_column < 0:
        return False
    low, high = min(first_row, first_column), max(first_row, first_column)
    offset = _place(indptr, inverse.indices, high, low) - indptr[low]
    for i in range(n_left):
        row = number[left + i]
        for j in range(n_right):
            column = number[right + j]
            if row < 0 or column < 0:
                block[i, j] = 0.0
            elif low == high:
                block[i, j] = inverse.values[indptr[min(row, column)] + abs(row - column)]
            else:
                along, down = (column, row) if first_column < first_row else (row, column)
                block[i, j] = inverse.values[indptr[along] + offset + (down - high) - (along - low)]
    return True


@compiled
def _form(block: FloatRows, a: FloatArray, b: FloatArray, p: int, q: int, n_p: int, n_q: int) -> float:
    """The product of the parts from p of a and from q of b with a block between them."""
    total = 0.0
    for i in range(n_p):
        inner = 0.0
        for j in range(n_q):
            inner += block[i, j] * b[q + j]
        total += a[p + i] * inner
    return total


@compiled
def leverages(
    rows: EquationRows,
    inverse: SparseInverse,
    crossed: bool,
    results: FloatRows,
    block: FloatRows,
    a: FloatRows,
) -> None:
    """Writes a Q a' of some observations of one formula, a being divided by the sigma.

    Args:
        rows: the observations.
        inverse: Q.
        crossed: with the products of different residuals of one observation.
        results: (n, n_residuals), written; (n, n_residuals^2) when `crossed`.
        block: room for a block of Q, as long and as wide as the largest block of unknowns.
        a: (n_residuals, n_unknowns) room for the rows of one observation.
    """
    derivatives, weights, starts, roles = rows.derivatives, rows.weights, rows.starts, rows.roles
    n_residuals, n = weights.shape
    n_unknowns, n_roles = len(derivatives) // n_residuals, len(roles)
    for k in range(n):
        for r in range(n_residuals):
            for u in range(n_unknowns):
                value = derivatives[r * n_unknowns + u, k] * weights[r, k]
                a[r, u] = value if weights[r, k] != 0.0 else 0.0
        for p in range(n_roles):
            for q in range(p + 1):
                i, j, n_i, n_j = roles[p, 0], roles[q, 0], roles[p, 1], roles[q, 1]
                left, right = int(starts[p, k]), int(starts[q, k])
                if not _read_block(inverse, left, right, n_i, n_j, block):
                    continue
                for r in range(n_residuals):
                    for t in range(0 if crossed else r, r + 1):
                        value = _form(block, a[r], a[t], i, j, n_i, n_j)
                        if p != q:
                            value += _form(block, a[t], a[r], i, j, n_i, n_j)
                        results[k, r * n_residuals + t if crossed else r] += value
                        if t != r:
                            results[k, t * n_residuals + r] += value
