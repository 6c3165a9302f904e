"""Sums that repeat a term: `(p + q) + c p` is `q + (c + 1) p` where that multiple of p is known already.

Products of powers, once differentiated, are such sums. Without this stage a base of distortions takes more
operations than sympy's own sharing; a test on `EqDist_Dist_Base_Rad3_Dec1_XY5` holds that none does.
"""

from obseq.codegen.expression_graph import ExpressionGraph


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
