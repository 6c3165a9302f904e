"""Derivatives by elimination: the Jacobian from local derivatives, intermediate values removed one by one.

The local derivatives label the edges of the graph from operand to operation. Removing a vertex multiplies
the labels of the paths through it; when only unknowns and residuals are left, the labels are the Jacobian.
Reverse and forward mode remove in the order of the graph; there are cheaper ones (A. Griewank, A. Walther,
Evaluating Derivatives, 2008, chapter 9).
"""

import heapq
from collections.abc import Callable

from obseq.codegen.graphs.expression_graph import ExpressionGraph

Edges = Callable[[int], list[tuple[int, int]]]
"""The local derivatives of a node: (operand, derivative) for each operand that depends on an unknown."""


class Elimination:
    """The labelled graph from the unknowns to the residuals, and what is left of it."""

    def __init__(self, graph: ExpressionGraph, edges: Edges, inputs: list[int], residuals: list[int]) -> None:
        """Labels the edges that lead to the residuals; each residual is a vertex too, numbered -1, -2...

        Args:
            graph: The graph; it grows.
            edges: Local derivatives.
            inputs: Nodes of the unknowns.
            residuals: Nodes of the residuals.
        """
        self.graph = graph
        self.inputs = inputs
        self.into: dict[int, dict[int, int]] = {}
        self.outof: dict[int, set[int]] = {}
        for node in graph.reachable(residuals):
            for operand, label in edges(node):
                self._connect(operand, node, label)
        for k, residual in enumerate(residuals):
            if residual in self.into or residual in inputs:
                self._connect(residual, -1 - k, graph.constant(1.0))
        self.n_residuals = len(residuals)

    def jacobian(self, chains_first: bool) -> list[list[int]]:
        """Removes every intermediate vertex, and gives one row per residual.

        Args:
            chains_first: Remove vertices with one way out and at most two in, then from the residuals down;
                else remove what costs least (H. M. Markowitz), from the unknowns up.
        """
        rank = self._chain_rank if chains_first else self._cost_rank
        heap = [rank(node) for node in self.into if node >= 0]
        heapq.heapify(heap)
        while heap:
            first = heapq.heappop(heap)
            node = abs(first[1])
            if node not in self.into:
                continue
            if (current := rank(node)) != first:
                heapq.heappush(heap, current)
                continue
            for neighbour in self._remove(node):
                if neighbour >= 0 and neighbour in self.into:
                    heapq.heappush(heap, rank(neighbour))
        zero = self.graph.constant(0.0)
        rows = [self.into.get(-1 - k, {}) for k in range(self.n_residuals)]
        return [[row.get(unknown, zero) for unknown in self.inputs] for row in rows]

    def _chain_rank(self, node: int) -> tuple[int, int]:
        is_chain = len(self.outof.get(node, ())) == 1 and len(self.into[node]) <= 2
        return (0 if is_chain else 1), -node

    def _cost_rank(self, node: int) -> tuple[int, int]:
        return self._cost(node), node

    def _connect(self, start: int, end: int, label: int) -> None:
        labels = self.into.setdefault(end, {})
        labels[start] = self.graph.add(labels[start], label) if start in labels else label
        self.outof.setdefault(start, set()).add(end)

    def _is_sign(self, label: int) -> bool:
        value = self.graph.constant_value(label)
        return value is not None and abs(value) == 1.0

    def _cost(self, node: int) -> int:
        """Products and sums that removing a vertex takes."""
        before = [(start, self._is_sign(label)) for start, label in self.into[node].items()]
        return sum(
            (not sign and not self._is_sign(self.into[end][node])) + (start in self.into[end])
            for end in self.outof.get(node, ())
            for start, sign in before
        )

    def _remove(self, node: int) -> list[int]:
        """Removes a vertex; returns its neighbours."""
        before, after = self.into.pop(node), sorted(self.outof.pop(node, ()))
        for start in before:
            self.outof[start].discard(node)
        for end in after:
            label = self.into[end].pop(node)
            for start, other in before.items():
                self._connect(start, end, self.graph.mul(other, label))
        return [*before, *after]
