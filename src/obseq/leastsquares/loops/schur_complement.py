"""The compiled loops of the elimination of temporaries, over the small blocks that assembly has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import compiled
from obseq.kernels.vectors import outer_threes
from obseq.leastsquares.loops.tables import Groups

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows, IntArray, PositionArray


TINY = 1e-14
"""A pivot below this share of its diagonal entry vanishes: the observations do not determine the unknown."""


@compiled
def neighbour_pairs(
    bounds: IntArray, neighbours: IntArray, first: int, last: int, n: int, keys: IntArray
) -> None:
    """Writes low * n + high for all pairs of different neighbours of the groups from `first` to `last`."""
    at = 0
    for group in range(first, last):
        for a in range(bounds[group], bounds[group + 1]):
            for b in range(bounds[group], a):
                keys[at] = neighbours[b] * n + neighbours[a]
                at += 1


@compiled
def entry(store: FloatArray, at: int, row: int, column: int, rows: int, columns: int) -> float:
    """One entry of a pair in the store: columns of three rows are packed when both blocks are threes."""
    if rows == 3 and columns == 3:
        return float(store[at + column * (9 - column) // 2 + row])
    return float(store[at + column * ((rows + 4) // 4 * 4) + row])


@compiled
def factored(normal: FloatRows, n: int, damping: float) -> int:
    """Cholesky factor, in place, of a damped lower triangle; the first vanishing pivot, or -1."""
    for j in range(n):
        for i in range(j, n):
            value = normal[i, j]
            if i == j:
                value *= 1.0 + damping
            diagonal = value
            for k in range(j):
                value -= normal[i, k] * normal[j, k]
            if i == j:
                if not value > TINY * diagonal:
                    return j
                normal[j, j] = np.sqrt(value)
            else:
                normal[i, j] = value / normal[j, j]
    return -1


@compiled
def gathered(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    group: int,
    start: IntArray,
    size: IntArray,
    normal: FloatRows,
    right: FloatArray,
) -> int:
    """Copies N_tt (lower triangle) and g_t of a group from the store; returns the number of its unknowns."""
    n, local = 0, groups.local
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        for i in range(size[t]):
            n = max(n, local[start[t] + i] + 1)
    normal[:n, :n] = 0.0
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        at, width = 4 * diagonal[t], (size[t] + 4) // 4 * 4
        for j in range(size[t]):
            column = local[start[t] + j]
            if column < 0:
                continue
            right[column] = store[at + size[t] * width + j]
            for i in range(j, size[t]):
                row = local[start[t] + i]
                if row >= 0:
                    normal[row, column] += store[at + j * width + i]
    for pair in range(groups.inner_bounds[group], groups.inner_bounds[group + 1]):
        place, p, q = groups.inner[pair, 0], groups.inner[pair, 1], groups.inner[pair, 2]
        for j in range(size[q]):
            column = local[start[q] + j]
            for i in range(size[p]):
                row = local[start[p] + i]
                if row < 0 or column < 0:
                    continue
                value = entry(store, place, i, j, size[p], size[q])
                normal[max(row, column), min(row, column)] += value if row != column else 2.0 * value
    return n


@compiled
def forward(factor: FloatRows, n: int, vector: FloatArray) -> None:
    """Solves L y = vector in place."""
    for i in range(n):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value / factor[i, i]


@compiled
def backward(factor: FloatRows, n: int, vector: FloatArray) -> None:
    """Solves L' x = vector in place."""
    for back in range(n):
        i = n - 1 - back
        value = vector[i]
        for k in range(i + 1, n):
            value -= factor[k, i] * vector[k]
        vector[i] = value / factor[i, i]


@compiled
def coupling_rows(
    store: FloatArray,
    groups: Groups,
    group: int,
    start: IntArray,
    size: IntArray,
    number: IntArray,
    record: FloatArray,
    width: int,
) -> None:
    """Adds the coupling of a group to the rows of a record, each neighbour from its part on."""
    for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
        place, slot, k = groups.links[link, 0], groups.links[link, 1], groups.links[link, 2]
        t, turned = groups.links[link, 3], groups.links[link, 4]
        column = groups.part[slot]
        for j in range(size[k]):
            if number[start[k] + j] < 0:
                continue
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row >= 0 and turned:
                    record[row * width + column] += entry(store, place, j, i, size[k], size[t])
                elif row >= 0:
                    record[row * width + column] += entry(store, place, i, j, size[t], size[k])
            column += 1


@compiled
def forward_rows(factor: FloatRows, n: int, record: FloatArray, width: int) -> None:
    """Solves L Y = rows in place, for all columns together."""
    for i in range(n):
        for k in range(i):
            c = factor[i, k]
            for column in range(width):
                record[i * width + column] -= c * record[k * width + column]
        c = 1.0 / factor[i, i]
        for column in range(width):
            record[i * width + column] *= c


@compiled
def subtract_squares(
    store: FloatArray,
    slots: IntArray,
    neighbours: IntArray,
    part: IntArray,
    first: IntArray,
    count: IntArray,
    indptr: IntArray,
    offsets: PositionArray,
    pair: int,
    record: FloatArray,
    width: int,
    n: int,
) -> int:
    """Subtracts Y' Y from the matrix for one group; returns the number of the next pair.

    `slots`: first and last neighbour of the group. `record`: Y row by row, `width` apart, then -Y.
    """
    opposite, w, rows = n * width, np.uint64(width), np.uint64(n)
    for a in range(slots[0], slots[1]):
        high = neighbours[a]
        for j in range(count[high]):
            target = indptr[first[high] + j]
            for i in range(j, count[high]):
                value = 0.0
                for k in range(n):
                    value += record[k * width + part[a] + i] * record[k * width + part[a] + j]
                store[target + i - j] -= value
        for b in range(slots[0], a):
            low = neighbours[b]
            top, offset = indptr[first[low]], np.int64(offsets[pair])
            pair += 1
            if count[high] == 3 and count[low] == 3:
                at, height = np.uint64(top + offset), np.uint64(indptr[first[low] + 1] - top)
                left, right = np.uint64(opposite + part[a]), np.uint64(part[b])
                outer_threes(store, at, height, record, left, right, w, rows)
                continue
            for j in range(count[low]):
                target = indptr[first[low] + j] + offset - j
                for i in range(count[high]):
                    value = 0.0
                    for k in range(n):
                        value += record[k * width + part[a] + i] * record[k * width + part[b] + j]
                    store[target + i] -= value
    return pair


@compiled
def scalar_of(groups: Groups, group: int, wanted: int, start: IntArray, size: IntArray) -> int:
    """The unknown, among all, that has a number within a group."""
    for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
        t = groups.blocks[member]
        for i in range(size[t]):
            if groups.local[start[t] + i] == wanted:
                return int(start[t] + i)
    return -1


@compiled
def eliminate(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    start: IntArray,
    size: IntArray,
    number: IntArray,
    first: IntArray,
    count: IntArray,
    indptr: IntArray,
    offsets: PositionArray,
    damping: float,
    gradient: FloatArray,
    failed: IntArray,
    factor: FloatRows,
    right: FloatArray,
    record: FloatArray,
) -> float:
    """Subtracts the effect of all eliminated blocks from the matrix and from the gradient.

    Args:
        store: the matrix at its front, small blocks behind it.
        diagonal: (n_blocks,) place of each diagonal block in units of four doubles.
        groups: the eliminated blocks.
        start: (n_blocks,) first unknown of each block.
        size: (n_blocks,) number of its unknowns.
        number: (n_scalars,) number of each unknown in the matrix, or -1.
        first: (n_blocks,) number of the first free unknown of each block.
        count: (n_blocks,) number of its free unknowns.
        indptr: columns of the matrix.
        offsets: (n_pairs,) offset of each pair of neighbours below the top of its block column.
        damping: share of the diagonal of the eliminated blocks that is added to it.
        gradient: (n_free,) changed.
        failed: (1,) written: the first unknown that its observations do not determine; -1 when all is well.
        factor: (most, most) room for the factor of a group.
        right: (most,) room for its gradient.
        record: (2 most widest,) room for its rows, and for their opposites.

    Returns:
        Sum of g_t' N_tt^-1 g_t over the eliminated blocks.
    """
    bounds, neighbours, part = groups.bounds, groups.neighbours, groups.part
    decrease, pair = 0.0, 0
    failed[0] = -1
    for group in range(len(bounds) - 1):
        n = gathered(store, diagonal, groups, group, start, size, factor, right)
        bad = factored(factor, n, damping)
        if bad >= 0:
            failed[0] = scalar_of(groups, group, bad, start, size)
            return decrease
        forward(factor, n, right)
        for i in range(n):
            decrease += right[i] * right[i]
        slots = bounds[group : group + 2]
        if slots[0] == slots[1]:
            continue
        last = slots[1] - 1
        width = part[last] + (count[neighbours[last]] + 3) // 4 * 4
        record[: n * width] = 0.0
        coupling_rows(store, groups, group, start, size, number, record, width)
        forward_rows(factor, n, record, width)
        for i in range(n * width):
            record[n * width + i] = -record[i]
        for a in range(slots[0], slots[1]):
            for i in range(count[neighbours[a]]):
                value = 0.0
                for k in range(n):
                    value += record[k * width + part[a] + i] * right[k]
                gradient[first[neighbours[a]] + i] -= value
        pair = subtract_squares(
            store, slots, neighbours, part, first, count, indptr, offsets, pair, record, width, n
        )
    return decrease


@compiled
def substitute_back(
    store: FloatArray,
    diagonal: IntArray,
    groups: Groups,
    start: IntArray,
    size: IntArray,
    damping: float,
    step: FloatArray,
    factor: FloatRows,
    right: FloatArray,
) -> None:
    """Writes the step of the eliminated unknowns, from that of the others (n_scalars,).

    `factor` and `right` are room as in `eliminate`.
    """
    for group in range(len(groups.bounds) - 1):
        n = gathered(store, diagonal, groups, group, start, size, factor, right)
        factored(factor, n, damping)
        for link in range(groups.link_bounds[group], groups.link_bounds[group + 1]):
            place, k = groups.links[link, 0], groups.links[link, 2]
            t, turned = groups.links[link, 3], groups.links[link, 4]
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row < 0:
                    continue
                for j in range(size[k]):
                    if turned:
                        right[row] += step[start[k] + j] * entry(store, place, j, i, size[k], size[t])
                    else:
                        right[row] += step[start[k] + j] * entry(store, place, i, j, size[t], size[k])
        forward(factor, n, right)
        backward(factor, n, right)
        for member in range(groups.block_bounds[group], groups.block_bounds[group + 1]):
            t = groups.blocks[member]
            for i in range(size[t]):
                row = groups.local[start[t] + i]
                if row >= 0:
                    step[start[t] + i] = -right[row]
