"""Signs of the Jacobian: many opposites of products that share a factor become products of one opposite."""

from collections import Counter

from obseq.codegen.differentiate import Jacobian
from obseq.codegen.expression_graph import ExpressionGraph


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
