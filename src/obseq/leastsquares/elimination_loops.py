"""The compiled loops of the elimination of temporaries, over the small blocks that assembly has filled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

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
        offsets: (n_pairs,) offset of each pair of neighbours below the top of its block column.
        failed: (2,) written: the first block that its observations do not determine, and which of its
            unknowns.

    Returns:
        The decrease of half the cost that the eliminated unknowns bring by themselves, times two: sum of
        g_t' N_tt^-1 g_t.
    """
    widest, columns = 0, 0
    for group in range(len(blocks)):
        widest = max(widest, size[blocks[group]])
        total = 0
        for slot in range(bounds[group], bounds[group + 1]):
            total += count[neighbours[slot]]
        columns = max(columns, total)
    factor, chosen = np.zeros((widest, widest)), np.zeros(widest, np.int64)
    y, y_gradient = np.zeros((columns, widest)), np.zeros(widest)
    column_of = np.zeros(len(neighbours) + 1, np.int64)
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
        width = (size[t] + 4) // 4 * 4
        for i in range(n):
            y_gradient[i] = store[at + size[t] * width + chosen[i]]
        forward(factor, n, y_gradient)
        for i in range(n):
            decrease += y_gradient[i] * y_gradient[i]
        total = 0
        for slot in range(bounds[group], bounds[group + 1]):
            column_of[slot] = total
            total += count[neighbours[slot]]
        y[:total] = 0.0
        for link in range(link_bounds[group], link_bounds[group + 1]):
            place, slot, k, turned = links[link, 0], links[link, 1], links[link, 2], links[link, 3]
            column = column_of[slot]
            for j in range(size[k]):
                if number[start[k] + j] < 0:
                    continue
                for i in range(n):
                    if turned:
                        y[column, i] += entry(store, place, j, chosen[i], size[k], size[t])
                    else:
                        y[column, i] += entry(store, place, chosen[i], j, size[t], size[k])
                column += 1
        for column in range(total):
            forward(factor, n, y[column])
        for a in range(bounds[group], bounds[group + 1]):
            high = neighbours[a]
            for i in range(count[high]):
                left = y[column_of[a] + i]
                value = 0.0
                for k in range(n):
                    value += left[k] * y_gradient[k]
                gradient[first[high] + i] -= value
                for j in range(i + 1):
                    right = y[column_of[a] + j]
                    value = 0.0
                    for k in range(n):
                        value += left[k] * right[k]
                    store[indptr[first[high] + j] + i - j] -= value
            for b in range(bounds[group], a):
                low = neighbours[b]
                offset = np.int64(offsets[pair])
                pair += 1
                for j in range(count[low]):
                    right = y[column_of[b] + j]
                    target = indptr[first[low] + j] + offset - j
                    for i in range(count[high]):
                        left = y[column_of[a] + i]
                        value = 0.0
                        for k in range(n):
                            value += left[k] * right[k]
                        store[target + i] -= value
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
