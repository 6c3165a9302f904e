"""The matrix cut in parts: subtrees of its elimination tree, which nested dissection (METIS) makes shallow.

The vertices of the graph are what is determined together (points, stations, images), its edges what any
equation joins. A node separator of it divides the network; what stays of one is divided again. A part is one
piece of the elimination tree: its own unknowns, and the outer ones, which parts above it eliminate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import IndexArray, IntArray
from obseq.leastsquares.solvers.graph import group_indistinguishable
from obseq.leastsquares.solvers.ordering import elimination_order, resolve_ordering
from obseq.leastsquares.solvers.protocol import SymmetricPattern
from obseq.leastsquares.solvers.schedule import assign_tasks
from obseq.leastsquares.solvers.symbolic import row_structure, supernodal_order, unknowns_in_order

MANY = 2001
"""Unknowns for which an order of nested dissection is taken: parts are made of it however few there are."""

NUMBER = 8
"""Bytes of a number."""

ROOM = 3.0
"""Memory of a part as a multiple of its factor: the factor, its structure, the matrix, updates or fronts.
Where the factor of a network has 2.27 kB a point, these have 5.3: 2.3 times, and a fourth in reserve."""


class Part(NamedTuple):
    """A piece of the elimination tree.

    Attributes:
        own: (k,) positions, in the order of elimination, of the unknowns that are eliminated here; ascending.
        outer: (m,) the same of those that stay.
        children: numbers of the parts right below.
        factor: bytes of its factor.
    """

    own: IndexArray
    outer: IndexArray
    children: tuple[int, ...]
    factor: int


class Partition(NamedTuple):
    """A matrix in parts.

    Attributes:
        unknowns: (n,) unknowns in the order of elimination.
        parts: the parts, those below before those above them.
        part_of: (n,) part of each position.
    """

    unknowns: IndexArray
    parts: tuple[Part, ...]
    part_of: IndexArray

    @property
    def room(self) -> int:
        """Bytes that the largest part takes while it is treated."""
        return int(ROOM * max((part.factor for part in self.parts), default=0))


class Tree:
    """The elimination tree of a pattern, by node separators; parts are made of it as large as is wanted.

    Attributes:
        factor: bytes of the whole factor.
        operations: of a factorisation.
    """

    def __init__(self, pattern: SymmetricPattern) -> None:
        grouping = group_indistinguishable(pattern, np.zeros(0, np.int64))
        graph = grouping.graph
        ordering = resolve_ordering("auto", max(pattern.n, MANY))
        order, node, self._parent = supernodal_order(graph, elimination_order(grouping, ordering), 0)
        place = np.argsort(order)
        weights = graph.weights[order]
        self._first = np.concatenate([[0], np.cumsum(weights)])
        self._node = np.repeat(node, weights)
        self._rows_at, self._rows = row_structure(
            graph.start, graph.neighbours, order, place, node, self._parent
        )
        self._unknowns = unknowns_in_order(grouping, place).astype(np.int32)
        width = np.bincount(node, weights, len(self._parent))
        heights = np.concatenate([[0], np.cumsum(weights[self._rows])])[self._rows_at]
        below = np.diff(heights)
        self._panels = (NUMBER * width * (width + below)).astype(np.float64)
        self.factor = int(self._panels.sum())
        self.operations = float((width * (width * (width / 3.0 + below) + below * below)).sum())

    def parts(self, share: float) -> Partition:
        """Parts whose factors are not much larger than so many bytes, single separators apart."""
        parent, count = self._parent, len(self._parent)
        task = np.empty(count, np.int64)
        assign_tasks(parent, self._panels.copy(), share, np.zeros_like(task), task)
        m = int(task.max(initial=-1)) + 1
        tops = _tops(parent, task, m)
        above = [-1 if top < 0 or parent[top] < 0 else m - 1 - int(task[parent[top]]) for top in tops]
        part_of = (m - 1 - task)[self._node].astype(np.int32)
        sizes = np.bincount(m - 1 - task, self._panels, m)
        own = np.split(np.argsort(part_of, kind="stable").astype(np.int32), _ends(part_of, m))
        children: list[list[int]] = [[] for _ in range(m)]
        for part, over in enumerate(reversed(above)):
            if over >= 0:
                children[over].append(part)
        outer = [self._below(top) for top in reversed(tops)]
        parts = zip(own, outer, map(tuple, children), sizes.astype(np.int64).tolist(), strict=True)
        return Partition(self._unknowns, tuple(Part(*part) for part in parts), part_of)

    def _below(self, node: int) -> IndexArray:
        """Positions of the unknowns below a supernode."""
        if node < 0:
            return np.zeros(0, np.int32)
        vertices = self._rows[self._rows_at[node] : self._rows_at[node + 1]]
        ranges = [np.arange(self._first[v], self._first[v + 1], dtype=np.int32) for v in vertices]
        return np.concatenate(ranges) if ranges else np.zeros(0, np.int32)


def _ends(part_of: IndexArray, count: int) -> IntArray:
    """Where the unknowns of each part end, the last one's apart."""
    return np.cumsum(np.bincount(part_of, minlength=count))[:-1]


def _tops(parent: IntArray, task: IntArray, count: int) -> list[int]:
    """The supernode of each task whose parent is in another one; -1 for tasks of whole trees."""
    tops = np.full(count, -1)
    leaving = np.flatnonzero((parent >= 0) & (task != task[parent]))
    tops[task[leaving]] = leaving
    return [int(top) for top in tops]


def entries_of(pattern: SymmetricPattern, partition: Partition) -> Sequence[IndexArray]:
    """Of each part, places of its entries among the values: those of its own unknowns with later ones."""
    position = np.empty(pattern.n, np.int32)
    position[partition.unknowns] = np.arange(pattern.n, dtype=np.int32)
    column = np.repeat(position, np.diff(pattern.indptr))
    first = np.minimum(column, position[pattern.indices])
    part = partition.part_of[first]
    return [np.flatnonzero(part == k).astype(np.int32) for k in range(len(partition.parts))]
