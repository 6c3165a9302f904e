"""From the store of small blocks to the values of the sparse normal matrix: compiled loops."""

from __future__ import annotations

from obseq.arrays import FloatArray, IndexArray, IntArray, IntRows
from obseq.compilation import compiled
from obseq.leastsquares.loops.loop_arguments import PriorArrays, UnknownPlaces


@compiled
def pattern_rows(
    column: IntArray,
    row: IntArray,
    n_free: IntArray,
    first: IntArray,
    offset: IntArray,
    indptr: IntArray,
    indices: IndexArray,
) -> None:
    """Writes the columns of the lower triangle, from the blocks (column, row) sorted by column, then row.

    The first block of each column is the diagonal one. `offset` of a block: how far it begins below the top
    of its block column.
    """
    end, begin = 0, 0
    while begin < len(column):
        q, height, last = column[begin], 0, begin
        while last < len(column) and column[last] == q:
            offset[last] = height
            height += n_free[row[last]]
            last += 1
        for j in range(n_free[q]):
            indptr[first[q] + j] = end
            for k in range(begin, last):
                p = row[k]
                for i in range(j if p == q else 0, n_free[p]):
                    indices[end] = first[p] + i
                    end += 1
        begin = last
    indptr[-1] = end


@compiled
def add_diagonal_blocks(
    store: FloatArray, place: IntArray, unknowns: UnknownPlaces, gradient: FloatArray
) -> None:
    """Adds diagonal blocks to the matrix at the front of the store, and clears them; writes the gradient.

    `place` (n_blocks,): in units of four doubles, 0 for blocks without one.
    """
    free, indptr = unknowns.number, unknowns.indptr
    for block in range(len(place)):
        if place[block] == 0:
            continue
        n, first = unknowns.size[block], unknowns.start[block]
        at = 4 * place[block]
        width = (n + 4) // 4 * 4
        for j in range(n):
            column = free[first + j]
            if column < 0:
                continue
            gradient[column] = store[at + n * width + j]
            for i in range(j, n):
                row = free[first + i]
                if row >= 0:
                    store[indptr[column] + row - column] += store[at + j * width + i]
        store[at : at + width * (n + 1)] = 0.0


@compiled
def add_priors(
    priors: PriorArrays,
    present: FloatArray,
    indptr: IntArray,
    values: FloatArray,
    gradient: FloatArray,
    squares: FloatArray,
) -> None:
    """Adds priors to the diagonal of the matrix and to the gradient; their weighted squares to `squares`.

    Args:
        priors: what they say.
        present: current values of all unknowns.
        indptr: where the columns of the matrix begin.
        values: (nnz,) the matrix.
        gradient: (n_free,).
        squares: (n_priors,).
    """
    for k in range(len(priors.scalars)):
        weight, row = priors.weights[k], priors.numbers[k]
        misfit = (present[priors.scalars[k]] - priors.values[k]) * weight
        squares[priors.prior[k]] += misfit * misfit
        if row >= 0:
            values[indptr[row]] += weight * weight
            gradient[row] += weight * misfit


@compiled
def add_pairs(store: FloatArray, stored: IntRows, unknowns: UnknownPlaces) -> None:
    """Adds pairs that have a place of their own to the matrix at the front of the store, and clears them.

    `stored` (n, 4): place, row block, column block, offset of the lower block in the block column. A pair
    whose row block comes first is added transposed; a block paired with itself (one block in two
    arguments) counts both ways.
    """
    start, size, free = unknowns.start, unknowns.size, unknowns.number
    first, indptr = unknowns.first, unknowns.indptr
    for k in range(len(stored)):
        at, p, q, offset = stored[k, 0], stored[k, 1], stored[k, 2], stored[k, 3]
        threes = size[p] == 3 and size[q] == 3
        width = (size[p] + 4) // 4 * 4
        end = at + (10 if threes else width * size[q])
        for j in range(size[q]):
            column = free[start[q] + j]
            if column < 0:
                continue
            source = at + (j * (9 - j) // 2 if threes else j * width)
            for i in range(size[p]):
                row = free[start[p] + i]
                value = store[source + i]
                if row < 0:
                    continue
                if p > q:
                    store[indptr[column] + offset + (row - first[p]) - (column - first[q])] += value
                elif p < q:
                    store[indptr[row] + offset + (column - first[q]) - (row - first[p])] += value
                elif row != column:
                    store[indptr[min(row, column)] + abs(row - column)] += value
                else:
                    store[indptr[row]] += 2.0 * value
        store[at:end] = 0.0
