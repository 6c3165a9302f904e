"""Derivatives of a graph: reverse mode, forward mode, and elimination in the order that costs least."""

from collections.abc import Callable

from obseq.codegen.graphs.elimination import Elimination
from obseq.codegen.graphs.expression_graph import INPUT, ExpressionGraph
from obseq.codegen.operators import OPERATORS
from obseq.errors import FormulaError

Jacobian = list[list[int]]
"""One row per residual, one node per unknown; structural zeros are the constant 0."""


def jacobians(
    graph: ExpressionGraph, residuals: list[int], unknowns: tuple[str, ...], formula: str
) -> list[tuple[ExpressionGraph, Jacobian]]:
    """The derivatives of the residuals with respect to the unknowns, worked out in several orders.

    All are the same mathematics, each in a graph of its own; the caller keeps the cheapest.

    Args:
        graph: The graph of the residuals.
        residuals: Their nodes.
        unknowns: Names of the unknowns.
        formula: Name of the formula, for messages.

    Raises:
        FormulaError: An operator on the way has no derivative.
    """
    inputs = [graph.input(name) for name in unknowns]
    found = []
    for order in ORDERS:
        derivatives = _Derivatives(graph.copy(), formula, inputs)
        found.append((derivatives.graph, order(derivatives, residuals)))
    return found


def directional(
    graph: ExpressionGraph, residuals: list[int], directions: dict[str, str], formula: str
) -> tuple[ExpressionGraph, list[int]]:
    """The derivatives of the residuals along a direction: one pass, whatever the number of unknowns.

    Args:
        graph: The graph of the residuals.
        residuals: Their nodes.
        directions: Name of each unknown, and the name of its component of the direction, a new input.
        formula: Name of the formula, for messages.

    Returns:
        A graph that has grown, and a node per residual.

    Raises:
        FormulaError: An operator on the way has no derivative.
    """
    derivatives = _Derivatives(graph.copy(), formula, [graph.input(name) for name in directions])
    grown = derivatives.graph
    order = [node for node in grown.reachable(residuals) if node in derivatives.active]
    seeds = {grown.input(name): grown.input(component) for name, component in directions.items()}
    tangents = derivatives.tangents(seeds, order)
    zero = grown.constant(0.0)
    return grown, [tangents.get(residual, zero) for residual in residuals]


def falling(
    graph: ExpressionGraph, residuals: list[int], observations: tuple[str, ...], formula: str
) -> list[list[str]]:
    """For each residual, the observations of which it falls by 1 where they grow by 1.

    Args:
        graph: The graph of the residuals.
        residuals: Their nodes.
        observations: Names of those that are asked about.
        formula: Name of the formula, for messages.
    """
    derivatives = _Derivatives(graph.copy(), formula, [graph.input(name) for name in observations])
    rows, value = derivatives.reverse(residuals), derivatives.graph.constant_value
    return [
        [name for name, node in zip(observations, row, strict=True) if value(node) == -1.0] for row in rows
    ]


class _Derivatives:
    """The partial derivatives of every operation that depends on an unknown, computed once."""

    def __init__(self, graph: ExpressionGraph, formula: str, inputs: list[int]) -> None:
        self.graph = graph
        self.formula = formula
        self.inputs = inputs
        self.active = set(inputs)
        for node in range(len(graph.nodes)):
            if self.active.intersection(graph.nodes[node].operands):
                self.active.add(node)
        self._partials: dict[int, tuple[int, ...]] = {}

    def partials(self, node: int) -> tuple[int, ...]:
        if node not in self._partials:
            operator, operands, _ = self.graph.nodes[node]
            rule = OPERATORS[operator].partials
            if rule is None:
                raise FormulaError(f"{self.formula}: the operator {operator} has no derivative")
            self._partials[node] = rule(self.graph, node, operands)
        return self._partials[node]

    def reverse(self, residuals: list[int]) -> Jacobian:
        """The Jacobian row by row, by adjoints from each residual down to the unknowns."""
        return [self._gradient(residual) for residual in residuals]

    def _gradient(self, residual: int) -> list[int]:
        graph, zero = self.graph, self.graph.constant(0.0)
        adjoints = {residual: graph.constant(1.0)}
        for node in reversed(graph.reachable([residual])):
            if node not in adjoints or node not in self.active or graph.nodes[node].operator == INPUT:
                continue
            adjoint = adjoints.pop(node)
            for operand, contribution in self._contributions(node, adjoint):
                adjoints[operand] = graph.add(adjoints.get(operand, zero), contribution)
        return [adjoints.get(unknown, zero) for unknown in self.inputs]

    def _contributions(self, node: int, adjoint: int) -> list[tuple[int, int]]:
        graph = self.graph
        operator, operands, _ = graph.nodes[node]
        if operator == "mul" and operands[0] == operands[1]:
            return [(operands[0], graph.mul(adjoint, graph.mul(graph.constant(2.0), operands[0])))]
        return [
            (operand, graph.mul(adjoint, partial))
            for operand, partial in zip(operands, self.partials(node), strict=True)
            if operand in self.active
        ]

    def eliminate(self, residuals: list[int], chains_first: bool) -> Jacobian:
        """The Jacobian by removing intermediate values one by one."""
        elimination = Elimination(self.graph, self._edges, self.inputs, residuals)
        return elimination.jacobian(chains_first)

    def _edges(self, node: int) -> list[tuple[int, int]]:
        """The local derivatives of a node, with the operands that they are about."""
        if node not in self.active or self.graph.nodes[node].operator == INPUT:
            return []
        return self._contributions(node, self.graph.constant(1.0))

    def forward(self, residuals: list[int]) -> Jacobian:
        """The Jacobian column by column, by tangents from each unknown up to the residuals."""
        order = [node for node in self.graph.reachable(residuals) if node in self.active]
        one = self.graph.constant(1.0)
        columns = [self.tangents({unknown: one}, order) for unknown in self.inputs]
        zero = self.graph.constant(0.0)
        return [[column.get(residual, zero) for column in columns] for residual in residuals]

    def tangents(self, seeds: dict[int, int], order: list[int]) -> dict[int, int]:
        """The tangents of nodes, given in an order where operands come first, from those of some unknowns."""
        graph, tangents = self.graph, seeds.copy()
        for node in order:
            if graph.nodes[node].operator == INPUT:
                continue
            for contribution in self._changes(node, tangents):
                tangents[node] = graph.add(tangents[node], contribution) if node in tangents else contribution
        return tangents

    def _changes(self, node: int, tangents: dict[int, int]) -> list[int]:
        """What each moving operand adds to the tangent of a node."""
        graph = self.graph
        operator, operands, _ = graph.nodes[node]
        if operator == "mul" and operands[0] == operands[1] and operands[0] in tangents:
            (x, _) = operands
            return [graph.mul(graph.mul(graph.constant(2.0), x), tangents[x])]
        moving = [operand in tangents for operand in operands]
        if not any(moving):
            return []
        return [
            graph.mul(partial, tangents[operand])
            for operand, partial, moves in zip(operands, self.partials(node), moving, strict=True)
            if moves
        ]


ORDERS: tuple[Callable[[_Derivatives, list[int]], Jacobian], ...] = (
    _Derivatives.reverse,
    _Derivatives.forward,
    lambda derivatives, residuals: derivatives.eliminate(residuals, chains_first=True),
    lambda derivatives, residuals: derivatives.eliminate(residuals, chains_first=False),
)
"""The orders in which the chain rule may be applied."""
