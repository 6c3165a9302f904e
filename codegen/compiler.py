"""From a formula to the cheapest graph of its residuals and derivatives: the first stages of the pipeline."""

import hashlib
from dataclasses import dataclass

import sympy

from obseq.codegen.graphs.differentiate import Jacobian, falling, jacobians
from obseq.codegen.graphs.expression_graph import ExpressionGraph, operations
from obseq.codegen.graphs.products import collect_terms, share_products, share_signs
from obseq.codegen.graphs.translate import graph_of
from obseq.formulas.base import Formula

GENERATOR_VERSION = "1"


@dataclass(frozen=True)
class Declared:
    """A formula read on symbols.

    Attributes:
        formula: The formula.
        expressions: Its residuals, as sympy expressions that nothing simplified.
    """

    formula: Formula
    expressions: tuple[sympy.Expr, ...]

    def __str__(self) -> str:
        inputs = f"{len(self.formula.unknowns)} unknowns, {len(self.formula.observations)} observations"
        return f"{inputs}, {len(self.expressions)} residuals"


@dataclass(frozen=True)
class Translated:
    """A formula as a graph in which equal expressions are one node.

    Attributes:
        formula: The formula.
        graph: The graph.
        residuals: Nodes of the residuals.
    """

    formula: Formula
    graph: ExpressionGraph
    residuals: list[int]

    @property
    def residual_names(self) -> tuple[str, ...]:
        """Names of the residuals: the formula's, else of what was measured, for computed minus measured.

        Of several that a residual falls with, as a correction and the reading, the last was measured.
        """
        if self.formula.outputs:
            return self.formula.outputs
        found = falling(self.graph, self.residuals, self.formula.measured, self.formula.name)
        plain = "residual" if len(found) == 1 else "residual_{}"
        return tuple(names[-1] if names else plain.format(k) for k, names in enumerate(found))

    @property
    def digest(self) -> str:
        """Hash of names, residual expressions and generator version: comments and layout do not count."""
        graph, formula = self.graph, self.formula
        order = graph.reachable(self.residuals)
        position = {node: k for k, node in enumerate(order)}
        content: list[object] = [GENERATOR_VERSION, formula.name, formula.unknowns, formula.observations]
        content += [
            (node.operator, tuple(position[operand] for operand in node.operands), node.value)
            for node in (graph.nodes[number] for number in order)
        ]
        content.append([position[residual] for residual in self.residuals])
        return hashlib.sha256(repr(content).encode()).hexdigest()[:16]

    def __str__(self) -> str:
        return f"{operations(self.graph, self.residuals)} operations, sha256:{self.digest}"


@dataclass(frozen=True)
class Derived:
    """A formula with the graph of its residuals and of its Jacobian.

    Attributes:
        formula: The formula.
        graph: The graph of everything.
        residuals: Nodes of the residuals.
        residual_names: Names of the residuals.
        jacobian: Nodes of the Jacobian, a row per residual.
        digest: Hash of the mathematics.
    """

    formula: Formula
    graph: ExpressionGraph
    residuals: list[int]
    residual_names: tuple[str, ...]
    jacobian: Jacobian
    digest: str

    @property
    def outputs(self) -> list[int]:
        """All nodes computed by the kernel of values and derivatives."""
        return [*self.residuals, *(node for row in self.jacobian for node in row)]

    @property
    def counts(self) -> tuple[int, int]:
        """Operations of the residuals, and of residuals and Jacobian together."""
        return operations(self.graph, self.residuals), operations(self.graph, self.outputs)

    def constant_entries(self) -> list[tuple[int, int, float]]:
        """(residual, unknown, value) of the entries of the Jacobian that never change."""
        return [
            (i, j, value)
            for i, row in enumerate(self.jacobian)
            for j, node in enumerate(row)
            if (value := self.graph.constant_value(node)) is not None
        ]

    def __str__(self) -> str:
        return "{} operations, {} with the Jacobian".format(*self.counts)


@dataclass(frozen=True)
class Differentiated:
    """The derivatives of a formula, worked out in several orders.

    Attributes:
        orders: The same mathematics, each in a graph of its own.
    """

    orders: list[Derived]

    def __str__(self) -> str:
        counts = ", ".join(str(order.counts[1]) for order in self.orders)
        return f"{counts} operations with the Jacobian, by order"


def declare(formula: Formula) -> Declared:
    """Reads `residual` on symbols named after the unknowns and observations that its signature declares."""
    return Declared(formula, formula.expressions())


def translate(declared: Declared) -> Translated:
    """Turns expressions into a hash-consed graph of ours; refuses what has no kernel."""
    graph, residuals = graph_of(declared.formula.name, declared.expressions)
    return Translated(declared.formula, graph, residuals)


def differentiate(translated: Translated) -> Differentiated:
    """Derives by each unknown: reverse, forward, and by elimination from either end."""
    formula, residuals, names = translated.formula, translated.residuals, translated.residual_names
    found = jacobians(translated.graph, residuals, formula.unknowns, formula.name)
    return Differentiated(
        [Derived(formula, graph, residuals, names, rows, translated.digest) for graph, rows in found]
    )


def simplify(differentiated: Differentiated) -> Derived:
    """Keeps the cheapest order, and the cheapest way to share signs and products in it."""
    derived = min(differentiated.orders, key=lambda order: order.counts[1])
    graph, count = derived.graph, len(derived.residuals)
    rows = share_signs(graph, derived.residuals, derived.jacobian)
    outputs = [*derived.residuals, *(node for row in rows for node in row)]
    most = operations(graph, derived.residuals)
    variants = [outputs, *share_products(graph, outputs)]
    variants += [collect_terms(graph, variant) for variant in variants]
    fitting = [variant for variant in variants if operations(graph, variant[:count]) <= most]
    best = min(fitting, key=lambda variant: operations(graph, variant))
    cheapest = iter(best)
    residuals = [next(cheapest) for _ in range(count)]
    jacobian = [[next(cheapest) for _ in row] for row in rows]
    return Derived(derived.formula, graph, residuals, derived.residual_names, jacobian, derived.digest)


def derive(formula: Formula) -> Derived:
    """A formula and its derivatives, worked out in the cheapest order."""
    return simplify(differentiate(translate(declare(formula))))
