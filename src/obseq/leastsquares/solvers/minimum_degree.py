"""The order of least degree of a graph of few vertices: no library to load, neighbours as sets of bits.

The vertex with the fewest neighbours is eliminated, which makes its neighbours each other's, and so on (W. F.
Tinney, J. W. Walker, Direct solutions of sparse network equations, 1967). Sets of bits cost n^3 / 64 steps at
most: for the few thousand vertices that such a graph may have, less than to load what does it for large ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import compiled

if TYPE_CHECKING:
    from obseq.arrays import IntArray, KeyArray
    from obseq.leastsquares.solvers.graph import Graph

ONE, TWO, FOUR, TOP = np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(56)
EACH_BYTE = np.uint64(0x0101010101010101)
PAIRS, FOURS, BYTES = (np.uint64(byte) * EACH_BYTE for byte in (0x55, 0x33, 0x0F))


def least_degree_first(graph: Graph) -> IntArray:
    """(n,) vertices in the order of their elimination; of equal degrees, the one before."""
    words = (graph.n + 63) // 64
    sets = np.zeros(graph.n * words, np.uint64)
    degree, order = np.zeros((2, graph.n), np.int64)
    eliminate_least(graph.start, graph.neighbours, sets, degree, order)
    return order


@compiled
def eliminate_least(
    start: IntArray, neighbours: IntArray, sets: KeyArray, degree: IntArray, order: IntArray
) -> None:
    """Writes the order; `sets` (n words,) zeros for the neighbours of each vertex, `degree` (n,) is room."""
    n = len(order)
    words = len(sets) // max(n, 1)
    for v in range(n):
        for k in range(start[v], start[v + 1]):
            u = neighbours[k]
            sets[v * words + (u >> 6)] |= ONE << np.uint64(u & 63)
        degree[v] = members(sets, v, words)
    for place in range(n):
        v = least_of(degree)
        order[place] = v
        degree[v] = n
        for word in range(words):
            left = sets[v * words + word]
            while left:
                u = 64 * word + ones((left & (~left + ONE)) - ONE)
                left &= left - ONE
                join(sets, u, v, words)
                degree[u] = members(sets, u, words)


@compiled
def least_of(degree: IntArray) -> int:
    """The first vertex of least degree."""
    found = 0
    for v in range(len(degree)):
        if degree[v] < degree[found]:
            found = v
    return found


@compiled
def join(sets: KeyArray, u: int, v: int, words: int) -> None:
    """Gives u the neighbours of its neighbour v, which is no more."""
    for word in range(words):
        sets[u * words + word] |= sets[v * words + word]
    for vertex in (u, v):
        sets[u * words + (vertex >> 6)] &= ~(ONE << np.uint64(vertex & 63))


@compiled
def members(sets: KeyArray, v: int, words: int) -> int:
    """Neighbours of a vertex."""
    found = 0
    for word in range(words):
        found += ones(sets[v * words + word])
    return found


@compiled(always_inline=True)
def ones(bits: np.uint64) -> int:
    """Bits that are set (H. S. Warren, Hacker's Delight, 2012, chapter 5); compilers know the pattern."""
    bits = bits - ((bits >> ONE) & PAIRS)
    bits = (bits & FOURS) + ((bits >> TWO) & FOURS)
    bits = (bits + (bits >> FOUR)) & BYTES
    return np.int64((bits * EACH_BYTE) >> TOP)  # type: ignore[return-value]
