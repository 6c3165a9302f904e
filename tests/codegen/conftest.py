"""Computes nodes of an expression graph on numbers, to test what the generator does to it."""

from collections.abc import Callable, Mapping
from typing import Any

import mpmath
import pytest

from obseq.codegen.graphs.expression_graph import CONSTANT, INPUT, ExpressionGraph
from obseq.formulas import functions

ARITHMETIC = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "rcp": lambda a: 1 / a,
}

SLOPES = {
    "sinc_sqrt_slope": lambda s: mpmath.diff(functions.sinc_sqrt, s),
    "angle_ratio_slope": lambda _, s, z: mpmath.diff(lambda t: functions.angle_ratio(t, z), s),
    "normalised_ratio_slope": lambda a, b: mpmath.diff(lambda t: functions.normalised_ratio(t, b), a),
}
"""Operators that only derivatives use, from the functions that they are the derivatives of."""


def _evaluate(graph: ExpressionGraph, node: int, inputs: Mapping[str, Any]) -> Any:
    """The value of a node, in the arithmetic of the inputs."""
    values: dict[int, Any] = {}
    number = type(next(iter(inputs.values())))
    for k in graph.reachable([node]):
        operator, operands, value = graph.nodes[k]
        if operator == INPUT:
            values[k] = inputs[str(value)]
        elif operator == CONSTANT:
            values[k] = number(value)
        else:
            function = ARITHMETIC.get(operator) or SLOPES.get(operator) or getattr(functions, operator)
            values[k] = function(*(values[operand] for operand in operands))
    return values[node]


@pytest.fixture(scope="package")
def evaluate() -> Callable[[ExpressionGraph, int, Mapping[str, Any]], Any]:
    """(graph, node, value of each input) -> value of the node, in the arithmetic of the inputs."""
    return _evaluate
