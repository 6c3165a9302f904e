"""The compiled loops of the elimination of temporaries, over the small blocks that assembly has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from obseq.leastsquares.vectors import outer_threes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

TINY = 1e-14
"""A pivot below this share of its diagonal entry vanishes: the observations do not determine the unknown."""


@njit(cache=True, error_model="numpy", nogil=True)
def neighbour_pairs(bounds: IntArray, neighbours: IntArray, low: IntArray, high: IntArray) -> None:
    """Writes all pairs of different neighbours of each group."""
    at = 0
    for group in range(len(bounds) - 1):
        for a in range(bounds[group], bounds[group + 1]):
            for b in range(bounds[group], a):
                low[at], high[at] = neighbours[b], neighbours[a]
                at += 1


@njit(cache=True, error_model="numpy", nogil=True)
def factored(
    store: FloatArray, at: int, size: int, chosen: IntArray, n: int, damping: float, factor: FloatArray
) -> int:
    """Cholesky factor of the chosen unknowns of a diagonal block; the first vanishing pivot, or -1."""
    width = (size + 4) // 4 * 4
    for j in range(n):
        for i in range(j, n):
            value = store[at + chosen[j] * width + chosen[i]]
            if i == j:
                value *= 1.0 + damping
            diagonal = value
            for k in range(j):
                value -= factor[i, k] * factor[j, k]
            if i == j:
                if not value > TINY * diagonal:
                    return j
                factor[j, j] = np.sqrt(value)
            else:
                factor[i, j] = value / factor[j, j]
    return -1


@njit(cache=True, error_model="numpy", nogil=True)
def forward(factor: FloatArray, n: int, vector: FloatArray) -> None:
    """Solves L y = vector in place."""
    for i in range(n):
        value = vector[i]
        for k in range(i):
            value -= factor[i, k] * vector[k]
        vector[i] = value / factor[i, i]


@njit(cache=True, error_model="numpy", nogil=True)
def backward(factor: FloatArray, n: int, vector: FloatArray) -> None:
    """Solves L' x = vector in place."""
    for back in range(n):
        i = n - 1 - back
        value = vector[i]
        for k in range(i + 1, n):
            value -= factor[k, i] * vector[k]
        vector[i] = value / factor[i, i]


@njit(cache=True, error_model="numpy", nogil=True)
def entry(store: FloatArray, at: int, row: int, column: int, rows: int, columns: int) -> float:
    """One entry of a pair in the store: columns of three rows are packed when both blocks are threes."""
    if rows == 3 and columns == 3:
        return float(store[at + column * (9 - column) // 2 + row])
    return float(store[at + column * ((rows + 4) // 4 * 4) + row])


@njit(cache=True, error_model="numpy", nogil=True)
def free_unknowns_of(start: int, size: int, frozen: NDArray[np.bool_], chosen: IntArray) -> int:
    """Writes the free unknowns of a block, as numbers within it; returns how many there are."""
    n = 0
    for i in range(size):
        if not frozen[start + i]:
            chosen[n] = i
            n += 1
    return n


@njit(cache=True, error_model="numpy", nogil=True)
def coupling_rows(
    store: FloatArray,
    t: int,
    chosen: IntArray,
    n: int,
    links: IntArray,
    first_link: int,
    last_link: int,
    part: IntArray,
    start: IntArray,
    size: IntArray,
    number: IntArray,
    rows: FloatArray,
) -> None:
    """Adds the coupling of an eliminated block to `rows` (n, width), each neighbour from its part on."""
    for link in range(first_link, last_link):
        place, slot, k, turned = links[link, 0], links[link, 1], links[link, 2], links[link, 3]
        column = part[slot]
        for j in range(size[k]):
            if number[start[k] + j] < 0:
                continue
            for i in range(n):
                if turned:
                    rows[i, column] += entry(store, place, j, chosen[i], size[k], size[t])
                else:
                    rows[i, column] += entry(store, place, chosen[i], j, size[t], size[k])
            column += 1


@njit(cache=True, error_model="numpy", nogil=True)
def forward_rows(factor: FloatArray, n: int, rows: FloatArray, width: int) -> None:
    """Solves L Y = rows in place, for all columns together."""
    for i in range(n):
        for k in range(i):
            c = factor[i, k]
            for column in range(width):
                rows[i, column] -= c * rows[k, column]
        c = 1.0 / factor[i, i]
        for column in range(width):
            rows[i, column] *= c


@njit(cache=True, error_model="numpy", nogil=True)
def widths_of(bounds: IntArray, neighbours: IntArray, count: IntArray, part: IntArray) -> int:
    """Writes where the part of each neighbour begins in the rows of its group; returns the widest rows."""
    widest = 4
    for group in range(len(bounds) - 1):
        total = 0
        for slot in range(bounds[group], bounds[group + 1]):
            part[slot] = total
            total += (count[neighbours[slot]] + 3) // 4 * 4
        widest = max(widest, total)
    return widest


@njit(cache=True, error_model="numpy", nogil=True)
def subtract_squares(
    store: FloatArray,
    slots: IntArray,
    neighbours: IntArray,
    part: IntArray,
    first: IntArray,
    count: IntArray,
    indptr: IntArray,
    offsets: NDArray[np.uint32],
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


@njit(cache=True, error_model="numpy", nogil=True)
def eliminate(
    store: FloatArray,
    diagonal: IntArray,
    blocks: IntArray,
    bounds: IntArray,
    neighbours: IntArray,
    links: IntArray,
    link_bounds: IntArray,
    start: IntArray,
    size: IntArray,
    frozen: NDArray[np.bool_],
    number: IntArray,
    first: IntArray,
    count: IntArray,
    indptr: IntArray,
    offsets: NDArray[np.uint32],
    damping: float,
    gradient: FloatArray,
    failed: IntArray,
) -> float:
    """Subtracts the effect of all eliminated blocks from the matrix and from the gradient.

    Args:
        store: the matrix at its front, small blocks behind it.
        diagonal: (n_blocks,) place of each diagonal block in units of four doubles.
        blocks: the groups, as `elimination.Groups` has them, with `bounds`, `neighbours`, `links`,
            `link_bounds`.
        bounds: see `blocks`.
        neighbours: see `blocks`.
        links: see `blocks`.
        link_bounds: see `blocks`.
        start: (n_blocks,) first unknown of each block.
        size: (n_blocks,) number of its unknowns.
        frozen: (n_scalars,) True for unknowns that keep their value.
        number: (n_scalars,) number of each unknown in the matrix, or -1.
        first: (n_blocks,) number of the first free unknown of each block.
        count: (n_blocks,) number of its free unknowns.
        indptr: columns of the matrix.
        offsets: (n_pairs,) offset of each pair of neighbours below the top of its block column.
        damping: share of the diagonal of the eliminated blocks that is added to it.
        gradient: (n_free,) changed.
        failed: (2,) written: the first block that its observations do not determine, and which of its
            unknowns; -1 when all is well.

    Returns:
        Sum of g_t' N_tt^-1 g_t over the eliminated blocks.
    """
    widest = 1
    for group in range(len(blocks)):
        widest = max(widest, size[blocks[group]])
    part = np.zeros(len(neighbours) + 1, np.int64)
    columns = widths_of(bounds, neighbours, count, part)
    factor, chosen = np.zeros((widest, widest)), np.zeros(widest, np.int64)
    record, right = np.zeros(2 * widest * columns), np.zeros(widest)
    decrease, pair = 0.0, 0
    failed[0] = -1
    for group in range(len(blocks)):
        t = blocks[group]
        n = free_unknowns_of(start[t], size[t], frozen, chosen)
        at = 4 * diagonal[t]
        bad = factored(store, at, size[t], chosen, n, damping, factor)
        if bad >= 0:
            failed[0], failed[1] = t, chosen[bad]
            return decrease
        gradient_at = at + size[t] * ((size[t] + 4) // 4 * 4)
        for i in range(n):
            right[i] = store[gradient_at + chosen[i]]
        forward(factor, n, right)
        for i in range(n):
            decrease += right[i] * right[i]
        slots = bounds[group : group + 2]
        if slots[0] == slots[1]:
            continue
        last = slots[1] - 1
        width = part[last] + (count[neighbours[last]] + 3) // 4 * 4
        rows = record[: n * width].reshape(n, width)
        rows[:] = 0.0
        coupling_rows(
            store,
            t,
            chosen,
            n,
            links,
            link_bounds[group],
            link_bounds[group + 1],
            part,
            start,
            size,
            number,
            rows,
        )
        forward_rows(factor, n, rows, width)
        for i in range(n * width):
            record[n * width + i] = -record[i]
        for a in range(slots[0], slots[1]):
            for i in range(count[neighbours[a]]):
                value = 0.0
                for k in range(n):
                    value += rows[k, part[a] + i] * right[k]
                gradient[first[neighbours[a]] + i] -= value
        pair = subtract_squares(
            store, slots, neighbours, part, first, count, indptr, offsets, pair, record, width, n
        )
    return decrease


@njit(cache=True, error_model="numpy", nogil=True)
def substitute_back(
    store: FloatArray,
    diagonal: IntArray,
    blocks: IntArray,
    links: IntArray,
    link_bounds: IntArray,
    start: IntArray,
    size: IntArray,
    frozen: NDArray[np.bool_],
    damping: float,
    step: FloatArray,
) -> None:
    """Writes the step of the eliminated unknowns, from that of the others (n_scalars,)."""
    widest = 0
    for group in range(len(blocks)):
        widest = max(widest, size[blocks[group]])
    factor, chosen, right = np.zeros((widest, widest)), np.zeros(widest, np.int64), np.zeros(widest)
    for group in range(len(blocks)):
        t = blocks[group]
        n = free_unknowns_of(start[t], size[t], frozen, chosen)
        at = 4 * diagonal[t]
        factored(store, at, size[t], chosen, n, damping, factor)
        width = (size[t] + 4) // 4 * 4
        for i in range(n):
            right[i] = -store[at + size[t] * width + chosen[i]]
        for link in range(link_bounds[group], link_bounds[group + 1]):
            place, k, turned = links[link, 0], links[link, 2], links[link, 3]
            for j in range(size[k]):
                moved = step[start[k] + j]
                for i in range(n):
                    if turned:
                        right[i] -= moved * entry(store, place, j, chosen[i], size[k], size[t])
                    else:
                        right[i] -= moved * entry(store, place, chosen[i], j, size[t], size[k])
        forward(factor, n, right)
        backward(factor, n, right)
        for i in range(n):
            step[start[t] + chosen[i]] = right[i]
