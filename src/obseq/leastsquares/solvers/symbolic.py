"""Everything about a factorisation that depends on the pattern only."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.leastsquares.solvers.compiled import compiled
from obseq.leastsquares.solvers.graph import group_indistinguishable
from obseq.leastsquares.solvers.ordering import elimination_order
from obseq.leastsquares.solvers.tree import column_counts, elimination_tree, postorder, supernodes

if TYPE_CHECKING:
    from obseq.arrays import Array, IntArray
    from obseq.leastsquares.solvers.graph import Graph, Grouping
    from obseq.leastsquares.solvers.protocol import SymmetricPattern


class Structure(NamedTuple):
    """Structure of the factor: m supernodes, children before parents, subtrees together.

    The front of a supernode has its own columns first, then its rows below, ascending. Its panel is the
    front's first columns, column-major, in a rectangle of all rows.

    Attributes:
        unknowns: (n,) unknowns in the order of elimination.
        start: (m + 1,) first column of each supernode.
        parent: (m,) parent of each supernode, -1 at a root.
        children_at, children: children of supernode s are `children[children_at[s] : children_at[s + 1]]`.
        below_at: (m + 1,) where the rows below of each supernode start in `rows` and `relative`.
        rows: positions of the rows below in the order of elimination, int32.
        relative: positions of the rows below in the front of the parent, int32.
        panel_at: (m + 1,) where each panel starts in the factor.
        entry_at: (m + 1,) where the entries of the matrix of each supernode start in `entry` and `target`.
        entry: positions of entries among the values of the pattern, int32.
        target: where they go in the panel, int32.
    """

    unknowns: IntArray
    start: IntArray
    parent: IntArray
    children_at: IntArray
    children: IntArray
    below_at: IntArray
    rows: Array
    relative: Array
    panel_at: IntArray
    entry_at: IntArray
    entry: Array
    target: Array

    @property
    def width(self) -> IntArray:
        """(m,) columns of each supernode."""
        return np.diff(self.start)

    @property
    def below(self) -> IntArray:
        """(m,) rows below of each supernode."""
        return np.diff(self.below_at)

    @property
    def front(self) -> IntArray:
        """(m,) order of each front."""
        return self.width + self.below


def analyse_pattern(pattern: SymmetricPattern, ordering: str, last: IntArray) -> Structure:
    """The structure of the factor for one of `ordering.ORDERINGS`, the unknowns `last` eliminated last."""
    grouping = group_indistinguishable(pattern, last)
    graph = grouping.graph
    order, node, tree = _supernodal_order(graph, elimination_order(grouping, ordering), grouping.has_last)
    place = np.argsort(order)
    rows_at, vertex_rows = row_structure(graph.start, graph.neighbours, order, place, node, tree)
    first = np.concatenate([[0], np.cumsum(graph.weights[order])])
    start = first[np.searchsorted(node, np.arange(len(tree) + 1))]
    below_at, rows = expand_rows(rows_at, vertex_rows, first)
    children_at, children = _children(tree)
    relative = relative_rows(tree, children_at, children, start, below_at, rows)
    unknowns = _unknowns_in_order(grouping, place)
    entry_at, entry, target = scatter_map(
        pattern.indptr,
        pattern.indices.astype(np.int32, copy=False),
        np.argsort(unknowns),
        np.repeat(np.arange(len(tree)), np.diff(start)),
        start,
        below_at,
        rows,
    )
    width = np.diff(start)
    panel_at = np.concatenate([[0], np.cumsum(width * (width + np.diff(below_at)))])
    return Structure(
        unknowns,
        start,
        tree,
        children_at,
        children,
        below_at,
        rows,
        relative,
        panel_at,
        entry_at,
        entry,
        target,
    )


def _supernodal_order(graph: Graph, order: IntArray, has_last: bool) -> tuple[IntArray, IntArray, IntArray]:
    """Vertices reordered, those of a supernode together; the supernode of each; parents of supernodes."""
    place = np.argsort(order)
    parent = elimination_tree(graph.start, graph.neighbours, order, place)
    post = postorder(parent, np.zeros(graph.n, np.int64))
    parent = _renumbered(parent, post)
    order = order[post]
    place = np.argsort(order)
    counts = column_counts(graph.start, graph.neighbours, order, place, parent, graph.weights)
    node, tree = supernodes(parent, counts, graph.weights[order], has_last)
    post = postorder(tree, np.bincount(node, minlength=len(tree)))
    node = np.argsort(post)[node]
    together = np.argsort(node, kind="stable")
    return order[together], node[together], _renumbered(tree, post)


def _renumbered(parent: IntArray, order: IntArray) -> IntArray:
    """Parents of the nodes of a forest once they are put in that order."""
    place = np.append(np.argsort(order), -1)
    return place[parent[order]]


def _children(tree: IntArray) -> tuple[IntArray, IntArray]:
    """Children of each node, ascending: where they start, and which they are."""
    children = np.argsort(tree, kind="stable")
    counts = np.bincount(tree + 1, minlength=len(tree) + 1)
    return np.cumsum(counts) - counts[0], children[counts[0] :]


def _unknowns_in_order(grouping: Grouping, place: IntArray) -> IntArray:
    return np.argsort(place[grouping.vertex], kind="stable")


@compiled
def row_structure(
    start: Array, neighbours: Array, order: Array, place: Array, node: Array, tree: Array
) -> tuple[Array, Array]:
    """Rows below each supernode, as vertices: where they start, and which they are, ascending.

    Each row visits the supernodes of its row of the factor, climbing the tree; twice: to count, to fill.
    """
    m = len(tree)
    rows_at = np.zeros(m + 2, np.int64)
    rows = np.empty(0, np.int64)
    seen = np.empty(m, np.int64)
    for turn in range(2):
        seen[:] = -1
        for i in range(len(order)):
            seen[node[i]] = i
            for k in range(start[order[i]], start[order[i] + 1]):
                j = place[neighbours[k]]
                if j < i:
                    s = node[j]
                    while seen[s] != i:
                        seen[s] = i
                        if turn == 0:
                            rows_at[s + 2] += 1
                        else:
                            rows[rows_at[s + 1]] = i
                            rows_at[s + 1] += 1
                        s = tree[s]
        if turn == 0:
            rows_at = np.cumsum(rows_at)
            rows = np.empty(rows_at[-1], np.int64)
    return rows_at[:-1], rows


@compiled
def expand_rows(rows_at: Array, vertex_rows: Array, first: Array) -> tuple[Array, Array]:
    """Rows below each supernode as unknowns: each vertex v becomes the rows `first[v]` to `first[v + 1]`."""
    below_at = np.empty_like(rows_at)
    total = 0
    for v in vertex_rows:
        total += first[v + 1] - first[v]
    rows = np.empty(total, np.int32)
    filled = 0
    for s in range(len(rows_at) - 1):
        below_at[s] = filled
        for k in range(rows_at[s], rows_at[s + 1]):
            for row in range(first[vertex_rows[k]], first[vertex_rows[k] + 1]):
                rows[filled] = row
                filled += 1
    below_at[-1] = filled
    return below_at, rows


@compiled
def relative_rows(
    tree: Array, children_at: Array, children: Array, start: Array, below_at: Array, rows: Array
) -> Array:
    """Position of each row below in the front of the parent."""
    relative = np.empty(len(rows), np.int32)
    position = np.empty(start[-1], np.int32)
    for p in range(len(tree)):
        width = start[p + 1] - start[p]
        for k in range(below_at[p], below_at[p + 1]):
            position[rows[k]] = width + k - below_at[p]
        for c in children[children_at[p] : children_at[p + 1]]:
            for k in range(below_at[c], below_at[c + 1]):
                row = rows[k]
                relative[k] = row - start[p] if row < start[p + 1] else position[row]
    return relative


@compiled
def scatter_map(
    indptr: Array, indices: Array, place: Array, node: Array, start: Array, below_at: Array, rows: Array
) -> tuple[Array, Array, Array]:
    """Entries of the matrix by supernode: `entry_at`, `entry` and `target` of `Structure`.

    `place` (n,) is the position of each unknown in the order of elimination, `node` (n,) the supernode of
    each position.
    """
    m = len(start) - 1
    entry_at = np.zeros(m + 2, np.int64)
    row = np.empty(len(indices), np.int32)
    column = np.empty(len(indices), np.int32)
    for j in range(len(indptr) - 1):
        for k in range(indptr[j], indptr[j + 1]):
            a, b = place[indices[k]], place[j]
            row[k], column[k] = max(a, b), min(a, b)
            entry_at[node[column[k]] + 2] += 1
    entry_at = np.cumsum(entry_at)
    entry = np.empty(len(indices), np.int32)
    for k in range(len(indices)):
        s = node[column[k]] + 1
        entry[entry_at[s]] = k
        entry_at[s] += 1
    target = np.empty(len(indices), np.int32)
    position = np.empty(len(place), np.int32)
    for s in range(m):
        width = start[s + 1] - start[s]
        front = width + below_at[s + 1] - below_at[s]
        for k in range(below_at[s], below_at[s + 1]):
            position[rows[k]] = width + k - below_at[s]
        for e in range(entry_at[s], entry_at[s + 1]):
            i, j = row[entry[e]], column[entry[e]] - start[s]
            target[e] = (i - start[s] if i < start[s + 1] else position[i]) + front * j
    return entry_at[:-1], entry, target
