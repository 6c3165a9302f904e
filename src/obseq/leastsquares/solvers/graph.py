"""The graph that is ordered: indistinguishable unknowns merged, leaves and chains set aside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.solvers.compiled import compiled

if TYPE_CHECKING:
    from obseq.arrays import Array, IntArray
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
        graph: the graph of the vertices. Edges of the last vertex may be repeated when `has_last`.
        has_last: the last vertex gathers the unknowns that must be eliminated last.
    """

    vertex: IntArray
    graph: Graph
    has_last: bool


def group_indistinguishable(pattern: SymmetricPattern, last: IntArray) -> Grouping:
    """Merges unknowns that have the same neighbours, themselves included, and all of `last`.

    Equal sets are recognised by the sum of one random number of 64 bits per neighbour.
    """
    keys = np.random.default_rng(0).integers(0, 2**64, pattern.n + 1, dtype=np.uint64)
    indices = pattern.indices.astype(np.int32, copy=False)
    signatures = neighbourhood_signatures(pattern.indptr, indices, keys[:-1])
    signatures[last] = keys[-1]
    _, leaders, groups = np.unique(signatures, return_index=True, return_inverse=True)
    if len(last):
        leaders[groups[last[0]]] = pattern.n  # numbered after all others
    order = np.argsort(leaders)
    vertex = np.argsort(order)[groups]
    is_read = np.zeros(pattern.n + 1, dtype=np.bool_)
    is_read[leaders] = True
    is_read[last] = True
    weights = np.bincount(vertex, minlength=len(leaders)).astype(np.int64)
    start, neighbours = quotient_edges(pattern.indptr, indices, vertex, is_read, len(leaders))
    return Grouping(vertex, Graph(start, neighbours, weights), len(last) > 0)


@compiled
def neighbourhood_signatures(indptr: Array, indices: Array, keys: Array) -> Array:
    """(n,) sum of the keys of the neighbours of each unknown and of its own."""
    signatures = keys.copy()
    for j in range(len(keys)):
        for k in range(indptr[j] + 1, indptr[j + 1]):
            i = indices[k]
            signatures[i] += keys[j]
            signatures[j] += keys[i]
    return signatures


@compiled
def quotient_edges(
    indptr: Array, indices: Array, vertex: Array, is_read: Array, count: int
) -> tuple[Array, Array]:
    """Edges between vertices, read from the unknowns that stand for them."""
    start = np.zeros(count + 2, np.int64)
    for j in range(len(vertex)):
        if is_read[j]:
            for k in range(indptr[j] + 1, indptr[j + 1]):
                i = indices[k]
                if is_read[i] and vertex[i] != vertex[j]:
                    start[vertex[i] + 2] += 1
                    start[vertex[j] + 2] += 1
    start = np.cumsum(start)
    neighbours = np.empty(start[-1], np.int64)
    for j in range(len(vertex)):
        if is_read[j]:
            for k in range(indptr[j] + 1, indptr[j + 1]):
                i = indices[k]
                if is_read[i] and vertex[i] != vertex[j]:
                    neighbours[start[vertex[i] + 1]] = vertex[j]
                    start[vertex[i] + 1] += 1
                    neighbours[start[vertex[j] + 1]] = vertex[i]
                    start[vertex[j] + 1] += 1
    return start[:-1], neighbours


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
        peeled, bridges = peel_once(rest.start, rest.neighbours)
        if len(peeled) <= WORTH_A_ROUND * rest.n:
            break
        eliminated.append(remaining[peeled])
        is_out = np.zeros(rest.n, dtype=np.bool_)
        is_out[peeled] = True
        remaining = remaining[~is_out]
        rest = _restricted(rest, is_out, bridges)
    return np.concatenate(eliminated), remaining, rest


def _restricted(graph: Graph, is_out: Array, bridges: IntArray) -> Graph:
    """The graph without some vertices, with some more edges (k, 2), without repeated edges."""
    start, neighbours = restrict(graph.start, graph.neighbours, is_out, bridges)
    return Graph(start, neighbours, graph.weights[~is_out])


@compiled
def peel_once(start: Array, neighbours: Array) -> tuple[Array, Array]:
    """One round: leaves as long as there are any, then chains of vertices with two neighbours.

    Returns:
        Vertices in the order of their elimination; edges (k, 2) that join the two ends of each chain.
    """
    n = len(start) - 1
    degree = start[1:] - start[:-1]
    is_out = np.zeros(n, np.bool_)
    order = np.empty(n, np.int64)
    waiting = np.empty(n, np.int64)
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
    bridges = np.empty((n, 2), np.int64)
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
    return order[:done], bridges[:n_bridges]


@compiled
def restrict(start: Array, neighbours: Array, is_out: Array, bridges: Array) -> tuple[Array, Array]:
    """Edges among the vertices that are not out, renumbered, with bridges, each once."""
    n = len(start) - 1
    number = np.empty(n, np.int64)
    kept = 0
    for v in range(n):
        number[v] = kept
        kept += not is_out[v]
    bridge_start = np.zeros(n + 2, np.int64)
    for b in range(len(bridges)):
        bridge_start[bridges[b, 0] + 2] += 1
        bridge_start[bridges[b, 1] + 2] += 1
    bridge_start = np.cumsum(bridge_start)
    across = np.empty(2 * len(bridges), np.int64)
    for b in range(len(bridges)):
        for side in range(2):
            at = bridges[b, side] + 1
            across[bridge_start[at]] = bridges[b, 1 - side]
            bridge_start[at] += 1
    new_start = np.zeros(kept + 1, np.int64)
    new_neighbours = np.empty(len(neighbours) + len(across), np.int64)
    seen = np.full(n, -1, np.int64)
    filled = 0
    for v in range(n):
        if is_out[v]:
            continue
        seen[v] = v
        for k in range(start[v], start[v + 1]):
            u = neighbours[k]
            if not is_out[u] and seen[u] != v:
                seen[u] = v
                new_neighbours[filled] = number[u]
                filled += 1
        for k in range(bridge_start[v], bridge_start[v + 1]):
            u = across[k]
            if seen[u] != v:
                seen[u] = v
                new_neighbours[filled] = number[u]
                filled += 1
        new_start[number[v] + 1] = filled
    return new_start, new_neighbours[:filled].copy()
