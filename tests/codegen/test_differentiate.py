"""Derivatives of the graph: every order of the chain rule, against differences in high precision."""

import random

import mpmath
import pytest

from obseq.codegen.compiler import derive
from obseq.codegen.graphs.differentiate import ORDERS, directional, jacobians
from obseq.codegen.graphs.expression_graph import ExpressionGraph
from obseq.codegen.graphs.translate import graph_of
from obseq.codegen.operators import OPERATORS
from obseq.errors import FormulaError
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula
from obseq.formulas.functions import Scalar

SAMPLE = ["Dist3D", "TopoHz", "TopoZen", "TopoSubFrame", "Clino_0_3", "RatioDist2DCons", "Dir_FE_EquiSolid"]
FORMULAS = {formula.name: formula for formula in REGISTRY}


def _inputs(formula: Formula) -> dict[str, mpmath.mpf]:
    """Numbers in general position: rotations need not be orthogonal for the mathematics to hold."""
    choices = random.Random(formula.name)
    names = (*formula.unknowns, *formula.observations)
    return {name: mpmath.mpf(choices.uniform(0.2, 1.5)) for name in names}


def _difference(
    formula: Formula, inputs: dict[str, mpmath.mpf], steps: dict[str, mpmath.mpf]
) -> list[mpmath.mpf]:
    """Derivative of the residuals along some steps, by a central difference in 60 digits."""
    h = mpmath.mpf(10) ** -18

    def residuals(sign: int) -> tuple[Scalar, ...]:
        moved = {name: value + sign * h * steps.get(name, 0) for name, value in inputs.items()}
        return formula.evaluate(
            [moved[name] for name in formula.unknowns], [moved[name] for name in formula.observations]
        )

    return [(a - b) / (2 * h) for a, b in zip(residuals(1), residuals(-1), strict=True)]


@pytest.mark.parametrize("order", range(len(ORDERS)))
@pytest.mark.parametrize("name", SAMPLE)
def test_all_orders_give_the_derivatives(evaluate, name: str, order: int) -> None:
    formula = FORMULAS[name]
    graph, residuals = graph_of(formula.name, formula.expressions())
    grown, jacobian = jacobians(graph, residuals, formula.unknowns, name)[order]
    with mpmath.workdps(60):
        inputs = _inputs(formula)
        for j, unknown in enumerate(formula.unknowns):
            expected = _difference(formula, inputs, {unknown: mpmath.mpf(1)})
            for i in range(len(residuals)):
                computed = evaluate(grown, jacobian[i][j], inputs)
                assert abs(computed - expected[i]) < 1e-25 * (1 + abs(expected[i])), (i, unknown)


@pytest.mark.parametrize("name", SAMPLE)
def test_derivatives_along_a_direction(evaluate, name: str) -> None:
    formula = FORMULAS[name]
    graph, residuals = graph_of(formula.name, formula.expressions())
    directions = {unknown: f"direction_{unknown}" for unknown in formula.unknowns}
    grown, along = directional(graph, residuals, directions, name)
    with mpmath.workdps(60):
        inputs = _inputs(formula)
        choices = random.Random(1)
        steps = {unknown: mpmath.mpf(choices.uniform(-1, 1)) for unknown in formula.unknowns}
        expected = _difference(formula, inputs, steps)
        both = inputs | {directions[unknown]: step for unknown, step in steps.items()}
        for node, value in zip(along, expected, strict=True):
            assert abs(evaluate(grown, node, both) - value) < 1e-25 * (1 + abs(value))


def test_the_cheapest_order_is_kept() -> None:
    """Nine unknowns for one residual: forward mode would take many more operations than reverse mode."""
    formula = FORMULAS["TopoHz"]
    graph, residuals = graph_of(formula.name, formula.expressions())
    counts = [
        len(grown.reachable([node for row in rows for node in row]))
        for grown, rows in jacobians(graph, residuals, formula.unknowns, formula.name)
    ]
    derived = derive(formula)
    kept = len(derived.graph.reachable([node for row in derived.jacobian for node in row]))
    assert kept == min(counts) < counts[1]


@pytest.mark.parametrize("name", sorted(n for n, o in OPERATORS.items() if o.partials and o.function))
def test_partial_derivatives_of_operators(evaluate, name: str) -> None:
    graph = ExpressionGraph()
    arity = OPERATORS[name].symbol.count("{}")
    operands = [graph.input(f"x{k}") for k in range(arity)]
    node = graph.apply(name, *operands)
    partials = OPERATORS[name].partials(graph, node, tuple(operands))
    with mpmath.workdps(50):
        inputs = {f"x{k}": mpmath.mpf(value) for k, value in enumerate((0.4, 0.7)[:arity])}
        for k, partial in enumerate(partials):
            step = mpmath.mpf(10) ** -15
            up = evaluate(graph, node, inputs | {f"x{k}": inputs[f"x{k}"] + step})
            down = evaluate(graph, node, inputs | {f"x{k}": inputs[f"x{k}"] - step})
            assert abs(evaluate(graph, partial, inputs) - (up - down) / (2 * step)) < 1e-20


def test_an_operator_without_derivative_is_refused() -> None:
    graph = ExpressionGraph()
    x = graph.input("x")
    slope = graph.apply("sinc_sqrt_slope", x)
    with pytest.raises(FormulaError, match=r"Mine: the operator sinc_sqrt_slope has no derivative"):
        jacobians(graph, [slope], ("x",), "Mine")
