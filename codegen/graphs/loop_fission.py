"""Cutting a long kernel in two loops: first what takes long, then what follows from it.

A processor looks a few hundred operations ahead. In a long loop it does not see the next lanes while it waits
for the divisions, roots and sines of these ones; a first loop of those alone keeps it busy. The values that
the second loop needs are spilled in the rows of results that are not written yet.
"""

from collections.abc import Sequence

from obseq.codegen.graphs.expression_graph import CONSTANT, INPUT, ExpressionGraph
from obseq.codegen.operators import OPERATORS

MOST_SPILLED = 8
"""Values spilled, beyond which loading and storing them costs more than the cut gains."""

LEAST_FIRST = 10
"""Operations of the first loop, below which there is nothing to wait for."""

LEAST_REST = 80
"""Operations of the second loop, below which a kernel is short enough as one loop."""

LEAST_RATIO = 2.5
"""Operations of the second loop for one of the first, below which the cut gains nothing."""


def spilled(graph: ExpressionGraph, outputs: Sequence[tuple[int, int]]) -> dict[int, int]:
    """The nodes that a first loop should compute, and the rows where it leaves them; empty for one loop.

    Args:
        graph: The graph.
        outputs: (node, row) of the results.
    """
    computed = [n for n in graph.reachable([n for n, _ in outputs]) if _is_operation(graph, n)]
    long = [n for n in computed if OPERATORS[graph.nodes[n].operator].expensive]
    first = {n for n in graph.reachable(long) if _is_operation(graph, n)}
    rest = [n for n in computed if n not in first]
    live = {operand for n in rest for operand in graph.nodes[n].operands if operand in first}
    live.update(n for n, _ in outputs if n in first)
    worth = len(first) >= LEAST_FIRST and len(rest) >= max(LEAST_REST, LEAST_RATIO * len(first))
    if not worth or len(live) > min(MOST_SPILLED, len(outputs)):
        return {}
    return _rows(sorted(live), outputs)


def _is_operation(graph: ExpressionGraph, node: int) -> bool:
    return graph.nodes[node].operator not in (CONSTANT, INPUT)


def _rows(live: Sequence[int], outputs: Sequence[tuple[int, int]]) -> dict[int, int]:
    """A row for each value: its own when it is a result, else that of a result of the second loop."""
    rows = {node: row for node, row in reversed(outputs) if node in live}
    free = (row for _, row in outputs if row not in rows.values())
    return {node: rows[node] if node in rows else next(free) for node in live}
