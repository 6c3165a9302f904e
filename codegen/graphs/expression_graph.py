"""The expression graph: every sub-expression once, simplified as it is built.

Nodes are integers. A node is an operator and its operands; equal nodes are the same integer (hash consing).
The rewriting rules are few, and each preserves the value to rounding: constants are folded, neutral elements
disappear, negations are pushed outwards and into subtractions, division is multiplication by a reciprocal
that all quotients of one denominator share, multiples of one node are added, and a product of several factors
is computed once, in whatever order it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from obseq.codegen.operators import OPERATORS

if TYPE_CHECKING:
    from collections.abc import Container

CONSTANT = "constant"
INPUT = "input"
COMMUTATIVE = frozenset({"add", "mul"})
MOST_FACTORS = 16
"""Products of more factors are not looked for in other orders."""


class Node(NamedTuple):
    """One operation: operator, operands (node numbers), value of a constant or name of an input."""

    operator: str
    operands: tuple[int, ...] = ()
    value: float | str = ""


class Monomial(NamedTuple):
    """What a product multiplies: a constant, and its other factors sorted."""

    coefficient: float
    factors: tuple[int, ...]


@dataclass
class ExpressionGraph:
    """Nodes in an order where operands come first; names that `let` gave to some of them."""

    nodes: list[Node] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)
    _numbers: dict[Node, int] = field(default_factory=dict)
    _monomials: dict[int, Monomial] = field(default_factory=dict)
    _products: dict[Monomial, int] = field(default_factory=dict)

    def copy(self) -> ExpressionGraph:
        """A graph of the same nodes, that grows on its own."""
        return ExpressionGraph(
            self.nodes.copy(),
            self.names.copy(),
            self._numbers.copy(),
            self._monomials.copy(),
            self._products.copy(),
        )

    def node(self, operator: str, *operands: int, value: float | str = "") -> int:
        """The number of a node, created if it is new; no simplification."""
        if operator in COMMUTATIVE:
            operands = tuple(sorted(operands))
        node = Node(operator, operands, value)
        if node not in self._numbers:
            self._numbers[node] = len(self.nodes)
            self.nodes.append(node)
        return self._numbers[node]

    def find(self, operator: str, *operands: int) -> int | None:
        """The number of a node that is there already, None without it."""
        ordered = tuple(sorted(operands)) if operator in COMMUTATIVE else operands
        return self._numbers.get(Node(operator, ordered))

    def constant(self, value: float) -> int:
        """A constant; minus zero is zero."""
        return self.node(CONSTANT, value=float(value) + 0.0)

    def input(self, name: str) -> int:
        """An unknown or an observation."""
        return self.node(INPUT, value=name)

    def constant_value(self, node: int) -> float | None:
        """The value of a constant node, None for any other."""
        operator, _, value = self.nodes[node]
        return float(value) if operator == CONSTANT else None

    def _negated(self, node: int) -> int | None:
        """The operand of a negation, None for any other node."""
        return self.nodes[node].operands[0] if self.nodes[node].operator == "neg" else None

    def scaled(self, node: int) -> tuple[float, int] | None:
        """(factor, rest) of a product by a constant, None for any other node."""
        operator, operands, _ = self.nodes[node]
        if operator == "mul":
            for factor, rest in (operands, operands[::-1]):
                value = self.constant_value(factor)
                if value is not None:
                    return value, rest
        return None

    def add(self, a: int, b: int) -> int:
        """The sum a + b."""
        u, v = self.constant_value(a), self.constant_value(b)
        if u is not None and v is not None:
            return self.constant(u + v)
        if u == 0.0:
            return b
        if v == 0.0:
            return a
        if (multiple := self._combined(a, b, 1.0)) is not None:
            return multiple
        if (opposite := self._negated(b)) is not None:
            return self.sub(a, opposite)
        if (opposite := self._negated(a)) is not None:
            return self.sub(b, opposite)
        return self.node("add", a, b)

    def _combined(self, a: int, b: int, sign: float) -> int | None:
        """The sum a + sign b when both are multiples of one node, else None."""
        (p, x), (q, y) = self.scaled(a) or (1.0, a), self.scaled(b) or (1.0, b)
        return self._scale(p + sign * q, x) if x == y else None

    def sub(self, a: int, b: int) -> int:
        """The difference a - b."""
        u, v = self.constant_value(a), self.constant_value(b)
        if u is not None and v is not None:
            return self.constant(u - v)
        if u == 0.0:
            return self.neg(b)
        if v == 0.0:
            return a
        if (multiple := self._combined(a, b, -1.0)) is not None:
            return multiple
        if (opposite := self._negated(b)) is not None:
            return self.add(a, opposite)
        if (opposite := self._negated(a)) is not None:
            return self.neg(self.add(opposite, b))
        if Node("sub", (b, a)) in self._numbers:
            return self.node("neg", self._numbers[Node("sub", (b, a))])
        return self.node("sub", a, b)

    def neg(self, a: int) -> int:
        """The opposite of a."""
        value = self.constant_value(a)
        if value is not None:
            return self.constant(-value)
        if (opposite := self._negated(a)) is not None:
            return opposite
        if (scaled := self.scaled(a)) is not None:
            return self.mul(self.constant(-scaled[0]), scaled[1])
        operator, operands, _ = self.nodes[a]
        if operator == "sub":
            return self.sub(operands[1], operands[0])
        return self.node("neg", a)

    def mul(self, a: int, b: int) -> int:
        """The product a b."""
        u, v = self.constant_value(a), self.constant_value(b)
        if u is not None and v is not None:
            return self.constant(u * v)
        if u is not None or v is not None:
            return self._scale(u, b) if u is not None else self._scale(v or 0.0, a)
        if (opposite := self._negated(a)) is not None:
            return self.neg(self.mul(opposite, b))
        if (opposite := self._negated(b)) is not None:
            return self.neg(self.mul(a, opposite))
        first, second = self.scaled(a), self.scaled(b)
        if first is not None and second is not None:
            return self._scale(first[0] * second[0], self.mul(first[1], second[1]))
        if a == b and self.nodes[a].operator == "sqrt":
            return self.nodes[a].operands[0]
        return self._product(a, b)

    def _monomial(self, node: int) -> Monomial:
        return self._monomials.get(node) or Monomial(1.0, (node,))

    def _product(self, a: int, b: int) -> int:
        """The product a b: the node that multiplies the same factors in any order, if there is one."""
        (p, x), (q, y) = self._monomial(a), self._monomial(b)
        monomial = Monomial(p * q, tuple(sorted(x + y)))
        if monomial in self._products:
            return self._products[monomial]
        plain = self._products.get(Monomial(1.0, monomial.factors))
        if plain is not None:
            return self._scale(p * q, plain)
        if p != 1.0 and abs(p * q) == 1.0:
            return self._scale(p * q, self.mul(self._plain(a), self._plain(b)))
        return self._registered(self.node("mul", a, b), monomial)

    def _plain(self, node: int) -> int:
        """A product without its constant factor, however deep in it."""
        if self._monomial(node).coefficient == 1.0:
            return node
        if (scaled := self.scaled(node)) is not None:
            return self._plain(scaled[1])
        a, b = self.nodes[node].operands
        return self.mul(self._plain(a), self._plain(b))

    def _registered(self, node: int, monomial: Monomial) -> int:
        if len(monomial.factors) <= MOST_FACTORS:
            self._monomials[node] = monomial
            self._products.setdefault(monomial, node)
        return node

    def _scale(self, factor: float, a: int) -> int:
        if factor == 0.0:
            return self.constant(0.0)
        if factor == 1.0:
            return a
        if factor == -1.0:
            return self.neg(a)
        if (opposite := self._negated(a)) is not None:
            return self._scale(-factor, opposite)
        if (scaled := self.scaled(a)) is not None:
            return self._scale(factor * scaled[0], scaled[1])
        coefficient, factors = self._monomial(a)
        monomial = Monomial(factor * coefficient, factors)
        if monomial in self._products:
            return self._products[monomial]
        return self._registered(self.node("mul", self.constant(factor), a), monomial)

    def rcp(self, a: int) -> int:
        """The reciprocal 1/a."""
        value = self.constant_value(a)
        if value is not None and value != 0.0:
            return self.constant(1.0 / value)
        if (opposite := self._negated(a)) is not None:
            return self.neg(self.rcp(opposite))
        if self.nodes[a].operator == "rcp":
            return self.nodes[a].operands[0]
        if (scaled := self.scaled(a)) is not None:
            return self._scale(1.0 / scaled[0], self.rcp(scaled[1]))
        return self.node("rcp", a)

    def power(self, a: int, exponent: int) -> int:
        """The integer power a^exponent, by repeated squares."""
        if exponent < 0:
            return self.rcp(self.power(a, -exponent))
        if exponent == 0:
            return self.constant(1.0)
        half = self.power(a, exponent // 2) if exponent > 1 else self.constant(1.0)
        square = self.mul(half, half)
        return self.mul(square, a) if exponent % 2 else square

    def apply(self, operator: str, *operands: int) -> int:
        """Any operator on operands, simplified."""
        if operator in ("add", "sub", "mul", "neg", "rcp"):
            result: int = getattr(self, operator)(*operands)
            return result
        fold = OPERATORS[operator].value
        known = [value for operand in operands if (value := self.constant_value(operand)) is not None]
        if fold is not None and len(known) == len(operands):
            return self.constant(fold(*known))
        return self.node(operator, *operands)

    def reachable(self, outputs: list[int], known: Container[int] = ()) -> list[int]:
        """The nodes that the outputs depend on, operands first, in order of creation.

        Those that are `known` already are among them, and what they depend on is not.
        """
        seen: set[int] = set()
        pending = list(outputs)
        while pending:
            node = pending.pop()
            if node not in seen:
                seen.add(node)
                pending.extend(() if node in known else self.nodes[node].operands)
        return sorted(seen)


def operations(graph: ExpressionGraph, outputs: list[int]) -> int:
    """Operations to compute some outputs together, every shared node once; a function call counts as one."""
    return sum(graph.nodes[node].operator not in (CONSTANT, INPUT) for node in graph.reachable(outputs))
