"""Products that share factors: written anew so that what they have in common is computed once.

The factors of all products are known; the pair of factors that most products contain becomes a product of its
own, and so on, until no pair is shared. Sums are left as they are.
"""

from collections import Counter
from collections.abc import Callable
from itertools import combinations

from obseq.codegen.expression_graph import ExpressionGraph

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
