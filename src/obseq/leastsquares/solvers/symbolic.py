"""Everything about a factorisation that depends on the pattern only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from obseq.arrays import IndexArray, IntArray
from obseq.compilation import compiled
from obseq.leastsquares.solvers.elimination_tree import column_counts, elimination_tree, postorder, supernodes
from obseq.leastsquares.solvers.graph import Graph, Grouping, group_indistinguishable
from obseq.leastsquares.solvers.ordering import elimination_order
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
    rows: IndexArray
    relative: IndexArray
    panel_at: IntArray
    entry_at: IntArray
    entry: IndexArray
    target: IndexArray

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
    order, node, tree = supernodal_order(graph, elimination_order(grouping, ordering), grouping.n_last)
    place = np.argsort(order)
    rows_at, vertex_rows = row_structure(graph.start, graph.neighbours, order, place, node, tree)
    first = np.concatenate([[0], np.cumsum(graph.weights[order])])
    start = first[np.searchsorted(node, np.arange(len(tree) + 1))]
    below_at, rows = expand_rows(rows_at, vertex_rows, first)
    children_at, children = _children(tree)
    relative = relative_rows(tree, children_at, children, start, below_at, rows)
    unknowns = unknowns_in_order(grouping, place)
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


def supernodal_order(graph: Graph, order: IntArray, n_last: int) -> tuple[IntArray, IntArray, IntArray]:
    """Vertices reordered, those of a supernode together; the supernode of each; parents of supernodes."""
    place = np.argsort(order)
    parent = elimination_tree(graph.start, graph.neighbours, order, place)
    if n_last:  # a chain of all of them, on which whatever reaches them hangs
        first = graph.n - n_last
        parent[:first] = np.minimum(parent[:first], first)
        parent[first:-1] = np.arange(first + 1, graph.n)
        parent[-1] = -1
    post = postorder(parent, np.zeros(graph.n, np.int64))
    parent = _renumbered(parent, post)
    order = order[post]
    place = np.argsort(order)
    counts = column_counts(graph.start, graph.neighbours, order, place, parent, graph.weights)
    node, tree = supernodes(parent, counts, graph.weights[order], n_last)
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


def unknowns_in_order(grouping: Grouping, place: IntArray) -> IntArray:
    """(n,) unknowns in the order of elimination, from the places of the vertices."""
    return np.argsort(place[grouping.vertex], kind="stable")


def row_structure(
    start: IntArray, neighbours: IntArray, order: IntArray, place: IntArray, node: IntArray, tree: IntArray
) -> tuple[IntArray, IntArray]:
    """Rows below each supernode, as vertices: where they start, and which they are, ascending."""
    counts, none = np.zeros(len(tree) + 2, np.int64), np.empty(0, np.int64)
    seen = np.full(len(tree), -1)
    climb_rows(start, neighbours, order, place, node, tree, seen, counts, none)
    filled = np.cumsum(counts)
    rows = np.empty(filled[-1], np.int64)
    seen[:] = -1
    climb_rows(start, neighbours, order, place, node, tree, seen, filled, rows)
    return filled[:-1], rows


@compiled
def climb_rows(
    start: IntArray,
    neighbours: IntArray,
    order: IntArray,
    place: IntArray,
    node: IntArray,
    tree: IntArray,
    seen: IntArray,
    filled: IntArray,
    rows: IntArray,
) -> None:
    """Each row visits the supernodes of its row of the factor, climbing the tree: to be counted, or written.

    Without room in `rows` it counts, two places behind each supernode in `filled`; else it writes from the
    place one behind each supernode on, which moves along. `seen` is -1 before.
    """
    writing = len(rows) > 0
    for i in range(len(order)):
        seen[node[i]] = i
        for k in range(start[order[i]], start[order[i] + 1]):
            j = place[neighbours[k]]
            if j < i:
                s = node[j]
                while seen[s] != i:
                    seen[s] = i
                    if writing:
                        rows[filled[s + 1]] = i
                        filled[s + 1] += 1
                    else:
                        filled[s + 2] += 1
                    s = tree[s]


def expand_rows(rows_at: IntArray, vertex_rows: IntArray, first: IntArray) -> tuple[IntArray, IndexArray]:
    """Rows below each supernode as unknowns: each vertex v becomes the rows `first[v]` to `first[v + 1]`."""
    ends = np.concatenate([[0], np.cumsum(np.diff(first)[vertex_rows])])
    rows = np.empty(ends[-1], np.int32)
    write_rows(vertex_rows, first, rows)
    return ends[rows_at], rows


@compiled
def write_rows(vertex_rows: IntArray, first: IntArray, rows: IndexArray) -> None:
    """Writes the unknowns of each vertex, one vertex after the other."""
    filled = 0
    for v in vertex_rows:
        for row in range(first[v], first[v + 1]):
            rows[filled] = row
            filled += 1


def relative_rows(
    tree: IntArray,
    children_at: IntArray,
    children: IntArray,
    start: IntArray,
    below_at: IntArray,
    rows: IndexArray,
) -> IndexArray:
    """Position of each row below in the front of the parent."""
    relative, position = np.empty(len(rows), np.int32), np.empty(start[-1], np.int32)
    place_rows(children_at, children, start, below_at, rows, position, relative)
    return relative


@compiled
def place_rows(
    children_at: IntArray,
    children: IntArray,
    start: IntArray,
    below_at: IntArray,
    rows: IndexArray,
    position: IndexArray,
    relative: IndexArray,
) -> None:
    """Writes the position of each row below in the front of the parent; `position` (n,) is room."""
    for p in range(len(start) - 1):
        width = start[p + 1] - start[p]
        for k in range(below_at[p], below_at[p + 1]):
            position[rows[k]] = width + k - below_at[p]
        for c in children[children_at[p] : children_at[p + 1]]:
            for k in range(below_at[c], below_at[c + 1]):
                row = rows[k]
                relative[k] = row - start[p] if row < start[p + 1] else position[row]


def scatter_map(
    indptr: IntArray,
    indices: IndexArray,
    place: IntArray,
    node: IntArray,
    start: IntArray,
    below_at: IntArray,
    rows: IndexArray,
) -> tuple[IntArray, IndexArray, IndexArray]:
    """Entries of the matrix by supernode: `entry_at`, `entry` and `target` of `Structure`.

    `place` (n,) is the position of each unknown in the order of elimination, `node` (n,) the supernode of
    each position.
    """
    row, column, entry, target = (np.empty(len(indices), np.int32) for _ in range(4))
    counts = np.zeros(len(start) + 1, np.int64)
    turn_entries(indptr, indices, place, node, row, column, counts)
    filled = np.cumsum(counts)
    sort_entries(column, node, filled, entry)
    position = np.empty(len(place), np.int32)
    place_entries(filled, entry, row, column, start, below_at, rows, position, target)
    return filled[:-1], entry, target


@compiled
def turn_entries(
    indptr: IntArray,
    indices: IndexArray,
    place: IntArray,
    node: IntArray,
    row: IndexArray,
    column: IndexArray,
    counts: IntArray,
) -> None:
    """Writes row and column of each entry in the order of elimination; counts them two behind their node."""
    for j in range(len(indptr) - 1):
        for k in range(indptr[j], indptr[j + 1]):
            a, b = place[indices[k]], place[j]
            row[k], column[k] = max(a, b), min(a, b)
            counts[node[column[k]] + 2] += 1


@compiled
def sort_entries(column: IndexArray, node: IntArray, filled: IntArray, entry: IndexArray) -> None:
    """Writes the entries of each supernode, from its place in `filled` on, one behind its own."""
    for k in range(len(column)):
        s = node[column[k]] + 1
        entry[filled[s]] = k
        filled[s] += 1


@compiled
def place_entries(
    entry_at: IntArray,
    entry: IndexArray,
    row: IndexArray,
    column: IndexArray,
    start: IntArray,
    below_at: IntArray,
    rows: IndexArray,
    position: IndexArray,
    target: IndexArray,
) -> None:
    """Writes the place of each entry in the panel of its supernode; `position` (n,) is room."""
    for s in range(len(start) - 1):
        width = start[s + 1] - start[s]
        front = width + below_at[s + 1] - below_at[s]
        for k in range(below_at[s], below_at[s + 1]):
            position[rows[k]] = width + k - below_at[s]
        for e in range(entry_at[s], entry_at[s + 1]):
            i, j = row[entry[e]], column[entry[e]] - start[s]
            target[e] = (i - start[s] if i < start[s + 1] else position[i]) + front * j
