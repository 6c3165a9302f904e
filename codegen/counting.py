"""How much arithmetic a graph takes: the operations that a kernel does for one observation."""

from obseq.codegen.expression_graph import CONSTANT, INPUT, ExpressionGraph


def operations(graph: ExpressionGraph, outputs: list[int]) -> int:
    """Operations to compute some outputs together, every shared node once; a function call counts as one."""
    return sum(graph.nodes[node].operator not in (CONSTANT, INPUT) for node in graph.reachable(outputs))
