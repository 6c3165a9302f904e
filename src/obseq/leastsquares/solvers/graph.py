"""The graph that is ordered: indistinguishable unknowns merged, leaves and chains set aside."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, IndexArray, IntArray, IntRows, KeyArray
from obseq.compilation import compiled
from obseq.dataclass import dataclass
from obseq.leastsquares.solvers.protocol import SymmetricPattern

ROUNDS = 8
"""Rounds of peeling at most; each one rebuilds the graph that remains."""

WORTH_A_ROUND = 0.02
"""Peeling stops when a round removes less than this share of the vertices."""


@dataclass(frozen=True)
class Graph:
    """An undirected graph: each edge twice, no loops.

    Attributes:
        start: (n + 1,) int64, where the neighbours of each vertex start.
        neighbours: (2 m,) int64.
        weights: (n,) int64, unknowns in each vertex.
    """

    start: IntArray
    neighbours: IntArray
    weights: IntArray

    @property
    def n(self) -> int:
        """Number of vertices."""
        return len(self.weights)


@dataclass(frozen=True)
class Grouping:
    """Unknowns gathered in vertices.

    Attributes:
        vertex: (n,) int64, the vertex of each unknown.
        graph: the graph of the vertices.
        n_last: how many vertices at the end must be eliminated last, each of one unknown.
    """

    vertex: IntArray
    graph: Graph
    n_last: int


def _scattered(numbers: IntArray) -> KeyArray:
    """(n,) each of some numbers scattered over 64 bits, none to 0: SplitMix64 (Steele, Lea, Flood 2014)."""
    found = (numbers.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        found = (found ^ (found >> np.uint64(shift))) * np.uint64(factor)
    return found ^ (found >> np.uint64(31))


def group_indistinguishable(pattern: SymmetricPattern, last: IntArray) -> Grouping:
    """Merges unknowns that have the same neighbours, themselves included; those of `last` stay alone.

    Equal sets are recognised by the sum of one scattered number of 64 bits per neighbour.
    """
    keys = _scattered(np.arange(pattern.n + 1))
    indices = pattern.indices.astype(np.int32, copy=False)
    signatures = keys[:-1].copy()
    sum_keys(pattern.indptr, indices, keys, signatures)
    signatures[last] = _scattered(pattern.n + 1 + np.arange(len(last)))  # unlike all
    _, leaders, groups = np.unique(signatures, return_index=True, return_inverse=True)
    rank = leaders.copy()
    rank[groups[last]] += pattern.n  # numbered after all others, in their order
    order = np.argsort(rank)
    vertex = np.argsort(order)[groups]
    is_read = np.zeros(pattern.n + 1, dtype=np.bool_)
    is_read[leaders] = True
    is_read[last] = True
    weights = np.bincount(vertex, minlength=len(leaders)).astype(np.int64)
    start, neighbours = quotient_edges(pattern.indptr, indices, vertex, is_read, len(leaders))
    return Grouping(vertex, Graph(start, neighbours, weights), len(last))


@compiled
def sum_keys(indptr: IntArray, indices: IndexArray, keys: KeyArray, signatures: KeyArray) -> None:
    """Adds the keys of the neighbours of each unknown to its signature (n,), which is its own key before."""
    for j in range(len(signatures)):
        for k in range(indptr[j] + 1, indptr[j + 1]):
            i = indices[k]
            signatures[i] += keys[j]
            signatures[j] += keys[i]


def quotient_edges(
    indptr: IntArray, indices: IndexArray, vertex: IntArray, is_read: BoolArray, count: int
) -> tuple[IntArray, IntArray]:
    """Edges between vertices, read from the unknowns that stand for them: their starts, their other ends."""
    counts = np.zeros(count + 2, np.int64)
    count_edges(indptr, indices, vertex, is_read, counts)
    filled = np.cumsum(counts)
    neighbours = np.empty(filled[-1], np.int64)
    write_edges(indptr, indices, vertex, is_read, filled, neighbours)
    return filled[:-1], neighbours


@compiled
def count_edges(
    indptr: IntArray, indices: IndexArray, vertex: IntArray, is_read: BoolArray, counts: IntArray
) -> None:
    """Counts the edges of each vertex, two places behind its own."""
    for j in range(len(vertex)):
        if is_read[j]:
            for k in range(indptr[j] + 1, indptr[j + 1]):
                i = indices[k]
                if is_read[i] and vertex[i] != vertex[j]:
                    counts[vertex[i] + 2] += 1
                    counts[vertex[j] + 2] += 1


@compiled
def write_edges(
    indptr: IntArray,
    indices: IndexArray,
    vertex: IntArray,
    is_read: BoolArray,
    filled: IntArray,
    neighbours: IntArray,
) -> None:
    """Writes the edges of each vertex from its place in `filled` on, one behind its own; it moves along."""
    for j in range(len(vertex)):
        if is_read[j]:
            for k in range(indptr[j] + 1, indptr[j + 1]):
                i = indices[k]
                if is_read[i] and vertex[i] != vertex[j]:
                    neighbours[filled[vertex[i] + 1]] = vertex[j]
                    filled[vertex[i] + 1] += 1
                    neighbours[filled[vertex[j] + 1]] = vertex[i]
                    filled[vertex[j] + 1] += 1


def peel(graph: Graph, kept_out: IntArray) -> tuple[IntArray, IntArray, Graph]:
    """Eliminates what costs next to nothing: vertices with one neighbour, and chains between two.

    Args:
        graph: the graph of all vertices.
        kept_out: vertices that are neither eliminated nor part of what remains.

    Returns:
        The vertices eliminated, in order; those that remain; the graph of those that remain.
    """
    is_out = np.zeros(graph.n, dtype=np.bool_)
    is_out[kept_out] = True
    remaining = np.flatnonzero(~is_out)
    rest = _restricted(graph, is_out, np.empty((0, 2), np.int64))
    eliminated = [np.empty(0, dtype=np.int64)]
    for _ in range(ROUNDS):
        peeled, bridges = peel_once(rest)
        if len(peeled) <= WORTH_A_ROUND * rest.n:
            break
        eliminated.append(remaining[peeled])
        is_out = np.zeros(rest.n, dtype=np.bool_)
        is_out[peeled] = True
        remaining = remaining[~is_out]
        rest = _restricted(rest, is_out, bridges)
    return np.concatenate(eliminated), remaining, rest


def _restricted(graph: Graph, is_out: BoolArray, bridges: IntRows) -> Graph:
    """The graph without some vertices, with some more edges (k, 2), without repeated edges."""
    start, neighbours = _edges_left(graph, is_out, bridges)
    return Graph(start, neighbours, graph.weights[~is_out])


def peel_once(graph: Graph) -> tuple[IntArray, IntRows]:
    """One round: leaves as long as there are any, then chains of vertices with two neighbours.

    Returns:
        Vertices in the order of their elimination; edges (k, 2) that join the two ends of each chain.
    """
    order, waiting = np.empty((2, graph.n), np.int64)
    bridges = np.empty((graph.n, 2), np.int64)
    degree, is_out, found = np.diff(graph.start), np.zeros(graph.n, np.bool_), np.zeros(2, np.int64)
    peel_leaves_and_chains(graph.start, graph.neighbours, degree, is_out, order, waiting, bridges, found)
    return order[: found[0]], bridges[: found[1]]


@compiled
def peel_leaves_and_chains(
    start: IntArray,
    neighbours: IntArray,
    degree: IntArray,
    is_out: BoolArray,
    order: IntArray,
    waiting: IntArray,
    bridges: IntRows,
    found: IntArray,
) -> None:
    """Writes what `peel_once` returns, and in `found` how much of each; `waiting` is room."""
    n = len(start) - 1
    done = 0
    for first in range(n):
        if is_out[first] or degree[first] > 1:
            continue
        v = first
        while v >= 0:  # follow the branch towards the inside
            is_out[v] = True
            order[done] = v
            done += 1
            following = -1
            for k in range(start[v], start[v + 1]):
                u = neighbours[k]
                if not is_out[u]:
                    degree[u] -= 1
                    if degree[u] <= 1:
                        following = u
            v = following
    n_bridges = 0
    for seed in range(n):
        if is_out[seed] or degree[seed] != 2:
            continue
        end, before = seed, -1  # walk to one end of the chain
        while degree[end] == 2:
            step = -1
            for k in range(start[end], start[end + 1]):
                u = neighbours[k]
                if not is_out[u] and u != before:
                    step = u
                    break
            before, end = end, step
            if end == seed:  # a ring
                break
        a, v, length = end, before, 0
        came_from = a
        while v != a and degree[v] == 2:  # walk back, noting the chain
            waiting[length] = v
            length += 1
            step = a
            for k in range(start[v], start[v + 1]):
                u = neighbours[k]
                if not is_out[u] and u != came_from:
                    step = u
                    break
            came_from, v = v, step
        for k in range(length):
            is_out[waiting[k]] = True
            order[done + k] = waiting[k]
        done += length
        if v != a:
            bridges[n_bridges, 0] = a
            bridges[n_bridges, 1] = v
            n_bridges += 1
    found[0], found[1] = done, n_bridges


def _edges_left(graph: Graph, is_out: BoolArray, bridges: IntRows) -> tuple[IntArray, IntArray]:
    """Edges among the vertices that are not out, renumbered, with bridges, each once."""
    across_at = np.bincount(bridges.ravel() + 2, minlength=graph.n + 2).cumsum()
    across = np.empty(bridges.size, np.int64)
    number: IntArray = np.cumsum(~is_out) - ~is_out
    seen = np.full(graph.n, -1)
    start = np.zeros(int(np.count_nonzero(~is_out)) + 1, np.int64)
    neighbours = np.empty(len(graph.neighbours) + len(across), np.int64)
    write_edges_left(
        graph.start, graph.neighbours, is_out, bridges, across_at, across, number, seen, start, neighbours
    )
    return start, neighbours[: start[-1]].copy()


@compiled
def write_edges_left(
    start: IntArray,
    neighbours: IntArray,
    is_out: BoolArray,
    bridges: IntRows,
    across_at: IntArray,
    across: IntArray,
    number: IntArray,
    seen: IntArray,
    new_start: IntArray,
    new_neighbours: IntArray,
) -> None:
    """Writes the edges of the vertices that stay, under their new numbers.

    `across_at` (n + 2,) says where the bridges of each vertex begin, one place behind its own; `across` and
    `seen` (-1 before) are room.
    """
    for b in range(len(bridges)):
        for side in range(2):
            at = bridges[b, side] + 1
            across[across_at[at]] = bridges[b, 1 - side]
            across_at[at] += 1
    filled = 0
    for v in range(len(is_out)):
        if is_out[v]:
            continue
        seen[v] = v
        for k in range(start[v], start[v + 1]):
            u = neighbours[k]
            if not is_out[u] and seen[u] != v:
                seen[u] = v
                new_neighbours[filled] = number[u]
                filled += 1
        for k in range(across_at[v], across_at[v + 1]):
            u = across[k]
            if seen[u] != v:
                seen[u] = v
                new_neighbours[filled] = number[u]
                filled += 1
        new_start[number[v] + 1] = filled
