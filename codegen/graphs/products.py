"""Products, signs and terms that are shared: written anew so that what they have in common is computed once.

The factors of all products are known; the pair of factors that most products contain becomes a product of
its own, and so on, until no pair is shared. Of the Jacobian, many opposites of products that share a factor
become products of one opposite. A sum that repeats a term, `(p + q) + c p`, is `q + (c + 1) p` where that
multiple of p is known already: products of powers, once differentiated, are such sums, and without it a
base of distortions takes more operations than sympy's own sharing (a test on
`EqDist_Dist_Base_Rad3_Dec1_XY5` holds that none does).
"""

from __future__ import annotations

from collections import Counter
from itertools import combinations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.codegen.graphs.differentiate import Jacobian
    from obseq.codegen.graphs.expression_graph import ExpressionGraph

Pair = tuple[int, int]


PREFERENCES: tuple[Callable[[Pair], tuple[int, ...]], ...] = (
    lambda pair: pair,
    lambda pair: (-pair[0], -pair[1]),
    lambda pair: (pair[0] == pair[1], *pair),
    lambda pair: (pair[0], -pair[1]),
)
"""Which pair is shared first among those that as many products contain; none is always the best."""


def share_products(graph: ExpressionGraph, outputs: list[int]) -> list[list[int]]:
    """The same outputs, as nodes of the same graph, their products written by greedy sharing of pairs.

    Returns:
        One writing for each order of preference among pairs; the caller keeps the cheapest.
    """
    return [_Sharing(graph, outputs, preference).outputs() for preference in PREFERENCES]


class _Sharing:
    """Rebuilds the nodes below some outputs.

    `symbols` are leaves (nodes that are no products, not negative) or pairs (negative numbers, in `pairs`).
    """

    def __init__(
        self, graph: ExpressionGraph, outputs: list[int], preference: Callable[[Pair], tuple[int, ...]]
    ) -> None:
        self.graph = graph
        self.wanted = outputs
        self.preference = preference
        self.pairs: dict[int, Pair] = {}
        self.products = {node: self._factors(node) for node in self._needed_products()}
        self._share()
        self._rebuilt: dict[int, int] = {}

    def outputs(self) -> list[int]:
        """The rebuilt outputs."""
        return [self._node(node) for node in self.wanted]

    def _needed_products(self) -> list[int]:
        """Products that something else than a product uses."""
        nodes = self.graph.nodes
        reachable = self.graph.reachable(self.wanted)
        used = {o for node in reachable if nodes[node].operator != "mul" for o in nodes[node].operands}
        used |= set(self.wanted) | {node for node in self.graph.names if node in set(reachable)}
        return [node for node in reachable if node in used and nodes[node].operator == "mul"]

    def _factors(self, node: int) -> Counter[int]:
        if self.graph.nodes[node].operator != "mul":
            return Counter([node])
        a, b = self.graph.nodes[node].operands
        return self._factors(a) + self._factors(b)

    def _share(self) -> None:
        counts = Counter(pair for factors in self.products.values() for pair in _pairs(factors))
        while (most := max(counts.values(), default=0)) > 1:
            pair = min((pair for pair, count in counts.items() if count == most), key=self.preference)
            symbol = -1 - len(self.pairs)
            self.pairs[symbol] = pair
            for factors in self.products.values():
                if factors.keys() >= set(pair):
                    counts.subtract(_pairs(factors))
                    _replace(factors, pair, symbol)
                    counts.update(_pairs(factors))

    def _symbol(self, symbol: int) -> int:
        if symbol >= 0:
            return self._node(symbol)
        a, b = self.pairs[symbol]
        return self.graph.node("mul", self._symbol(a), self._symbol(b))

    def _node(self, node: int) -> int:
        if node not in self._rebuilt:
            self._rebuilt[node] = self._build(node)
            if node in self.graph.names:
                self.graph.names.setdefault(self._rebuilt[node], self.graph.names[node])
        return self._rebuilt[node]

    def _build(self, node: int) -> int:
        operator, operands, value = self.graph.nodes[node]
        if node not in self.products:
            return self.graph.node(operator, *(self._node(operand) for operand in operands), value=value)
        first, *rest = (self._symbol(symbol) for symbol in sorted(self.products[node].elements()))
        for factor in rest:
            first = self.graph.node("mul", first, factor)
        return first


def _pairs(factors: Counter[int]) -> list[Pair]:
    """The pairs of factors of a product, each once."""
    doubled = [(symbol, symbol) for symbol, count in factors.items() if count > 1]
    return doubled + list(combinations(sorted(factors), 2))


def _replace(factors: Counter[int], pair: Pair, symbol: int) -> None:
    """Replaces a pair of factors, as often as it is there."""
    a, b = pair
    times = factors[a] // 2 if a == b else min(factors[a], factors[b])
    if times:
        for factor in pair:
            factors[factor] -= times
            if not factors[factor]:
                del factors[factor]
        factors[symbol] += times


def share_signs(graph: ExpressionGraph, residuals: list[int], jacobian: Jacobian) -> Jacobian:
    """The same Jacobian with entries `-(a b)`, `-(a c)`, ... written `(-a) b`, `(-a) c`: one sign for all.

    The factor that most entries share comes first. An entry whose product serves elsewhere stays as it is.

    Args:
        graph: The graph of everything; it grows.
        residuals: Nodes of the residuals.
        jacobian: Nodes of the Jacobian.
    """
    entries = [node for row in jacobian for node in row]
    factors = _opposite_products(graph, [*residuals, *entries])
    rewritten: dict[int, int] = {}
    while factors:
        shared = Counter(factor for pair in factors.values() for factor in set(pair))
        factor, count = max(shared.items(), key=lambda item: (item[1], -item[0]))
        if count < 2:
            break
        opposite = graph.node("neg", factor)
        for entry in [entry for entry, pair in factors.items() if factor in pair]:
            a, b = factors.pop(entry)
            rewritten[entry] = graph.node("mul", opposite, b if a == factor else a)
    return [[rewritten.get(node, node) for node in row] for row in jacobian]


def _opposite_products(graph: ExpressionGraph, outputs: list[int]) -> dict[int, tuple[int, int]]:
    """The outputs that are opposites of a product that nothing else uses: output to factors."""
    uses = Counter(operand for node in graph.reachable(outputs) for operand in graph.nodes[node].operands)
    uses.update(set(outputs))
    found = {}
    for output in outputs:
        operator, operands, _ = graph.nodes[output]
        if operator == "neg" and uses[output] == 1 and uses[operands[0]] == 1:
            product = graph.nodes[operands[0]]
            if product.operator == "mul":
                found[output] = (product.operands[0], product.operands[1])
    return found


def collect_terms(graph: ExpressionGraph, outputs: list[int]) -> list[int]:
    """The same outputs, as nodes of the same graph, with repeated terms collected where it costs nothing."""
    reachable = graph.reachable(outputs)
    known = set(reachable)
    rebuilt: dict[int, int] = {}
    for node in reachable:
        operator, operands, value = graph.nodes[node]
        collected = _collected(graph, operands, known) if operator == "add" else None
        chosen = operands if collected is None else collected
        rebuilt[node] = graph.node(operator, *(rebuilt.get(o, o) for o in chosen), value=value)
        if node in graph.names:
            graph.names.setdefault(rebuilt[node], graph.names[node])
    return [rebuilt[node] for node in outputs]


def _collected(graph: ExpressionGraph, operands: tuple[int, ...], known: set[int]) -> tuple[int, int] | None:
    """(q, (c + 1) p) of the operands (p + q, c p) of a sum, when the multiple is among the known nodes."""
    for total, multiple in (operands, operands[::-1]):
        scaled = graph.scaled(multiple)
        if scaled is None or graph.nodes[total].operator != "add":
            continue
        factor, term = scaled
        for p, q in (graph.nodes[total].operands, graph.nodes[total].operands[::-1]):
            if p == term:
                found = graph.find("mul", graph.constant(factor + 1.0), p)
                if found in known:
                    return q, found
    return None
