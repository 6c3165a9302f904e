"""The expression graph: equal expressions are one node, and no rewriting rule changes a value."""

import operator
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from obseq.codegen.graphs.expression_graph import ExpressionGraph

INPUTS = {"x": 1.25, "y": -0.75, "z": 2.5}
BINARY = {"add": operator.add, "sub": operator.sub, "mul": operator.mul}
UNARY = {"neg": operator.neg, "rcp": lambda a: 1.0 / a}


def test_equal_expressions_are_one_node() -> None:
    graph = ExpressionGraph()
    x, y = graph.input("x"), graph.input("y")
    assert graph.add(x, y) == graph.add(y, x)
    assert graph.mul(graph.add(x, y), x) == graph.mul(x, graph.add(y, x))
    assert graph.sub(x, y) != graph.sub(y, x)
    assert graph.input("x") == x


def test_copies_grow_alone() -> None:
    graph = ExpressionGraph()
    x = graph.input("x")
    copy = graph.copy()
    copy.mul(x, copy.input("y"))
    assert len(graph.nodes) == 1
    assert graph.input("z") == copy.input("y")


RULES = [
    ("x + 0 is x", lambda g, x, y: (g.add(x, g.constant(0.0)), x)),
    ("x - 0 is x", lambda g, x, y: (g.sub(x, g.constant(0.0)), x)),
    ("0 - x is -x", lambda g, x, y: (g.sub(g.constant(0.0), x), g.neg(x))),
    ("x - x is 0", lambda g, x, y: (g.sub(x, x), g.constant(0.0))),
    ("x + x is 2 x", lambda g, x, y: (g.add(x, x), g.mul(g.constant(2.0), x))),
    ("1 x is x", lambda g, x, y: (g.mul(g.constant(1.0), x), x)),
    ("0 x is 0", lambda g, x, y: (g.mul(g.constant(0.0), x), g.constant(0.0))),
    ("-1 x is -x", lambda g, x, y: (g.mul(g.constant(-1.0), x), g.neg(x))),
    ("-(-x) is x", lambda g, x, y: (g.neg(g.neg(x)), x)),
    ("-(x - y) is y - x", lambda g, x, y: (g.neg(g.sub(x, y)), g.sub(y, x))),
    ("x + (-y) is x - y", lambda g, x, y: (g.add(x, g.neg(y)), g.sub(x, y))),
    ("x - (-y) is x + y", lambda g, x, y: (g.sub(x, g.neg(y)), g.add(x, y))),
    ("(-x) y is -(x y)", lambda g, x, y: (g.mul(g.neg(x), y), g.neg(g.mul(x, y)))),
    ("1/(1/x) is x", lambda g, x, y: (g.rcp(g.rcp(x)), x)),
    ("1/(-x) is -(1/x)", lambda g, x, y: (g.rcp(g.neg(x)), g.neg(g.rcp(x)))),
    ("1/(2 x) is 0.5 (1/x)", lambda g, x, y: (g.rcp(_scaled(g, 2.0, x)), _scaled(g, 0.5, g.rcp(x)))),
    ("2 (3 x) is 6 x", lambda g, x, y: (_scaled(g, 2.0, _scaled(g, 3.0, x)), _scaled(g, 6.0, x))),
    ("(2 x)(3 y) is 6 (x y)", lambda g, x, y: (
        g.mul(_scaled(g, 2.0, x), _scaled(g, 3.0, y)), _scaled(g, 6.0, g.mul(x, y)))),
    ("sqrt(x)^2 is x", lambda g, x, y: (g.power(g.apply("sqrt", x), 2), x)),
    ("x (y x) is (x x) y", lambda g, x, y: (g.mul(g.mul(x, x), y), g.mul(x, g.mul(y, x)))),
    ("x^0 is 1", lambda g, x, y: (g.power(x, 0), g.constant(1.0))),
    ("x^-2 is 1/(x x)", lambda g, x, y: (g.power(x, -2), g.rcp(g.mul(x, x)))),
]  # fmt: skip


def _scaled(graph: ExpressionGraph, factor: float, node: int) -> int:
    return graph.mul(graph.constant(factor), node)


@pytest.mark.parametrize(("rule"), RULES, ids=[rule[0] for rule in RULES])
def test_rules(rule) -> None:
    graph = ExpressionGraph()
    made, expected = rule[1](graph, graph.input("x"), graph.input("y"))
    assert made == expected


def test_constants_are_folded() -> None:
    graph = ExpressionGraph()
    node = graph.apply("sqrt", graph.add(graph.constant(9.0), graph.constant(16.0)))
    assert graph.constant_value(node) == 5.0
    assert graph.constant_value(graph.neg(graph.constant(0.0))) == 0.0


def _grow(graph: ExpressionGraph, choices: random.Random) -> tuple[int, float]:
    """A random expression: its node, and its value computed without the graph."""
    pool = [(graph.input(name), value) for name, value in INPUTS.items()]
    pool += [(graph.constant(c), c) for c in (-1.0, 0.0, 0.5, 1.0, 2.0)]
    for _ in range(40):
        (a, u), (b, v) = choices.choice(pool), choices.choice(pool)
        name = choices.choice([*BINARY, *UNARY])
        if name == "rcp" and abs(u) < 1e-3:
            continue
        arguments, numbers = ((a, b), (u, v)) if name in BINARY else ((a,), (u,))
        value = {**BINARY, **UNARY}[name](*numbers)
        if abs(value) < 1e6:
            pool.append((graph.apply(name, *arguments), value))
    return pool[-1]


@given(st.integers(0, 10**9))
def test_rewriting_preserves_values(evaluate, seed: int) -> None:
    graph = ExpressionGraph()
    node, expected = _grow(graph, random.Random(seed))
    assert evaluate(graph, node, INPUTS) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@given(st.integers(0, 10**9))
def test_operands_come_before_operations(seed: int) -> None:
    graph = ExpressionGraph()
    node, _ = _grow(graph, random.Random(seed))
    order = graph.reachable([node])
    for position, k in enumerate(order):
        assert set(graph.nodes[k].operands) <= set(order[:position])


def test_whole_powers(evaluate) -> None:
    for exponent in range(-6, 13):
        graph = ExpressionGraph()
        node = graph.power(graph.input("x"), exponent)
        if exponent == 0:
            assert graph.constant_value(node) == 1.0
        else:
            assert evaluate(graph, node, INPUTS) == pytest.approx(1.25**exponent, rel=1e-14)
    graph = ExpressionGraph()
    x = graph.input("x")
    graph.power(x, 8)
    assert sum(node.operator == "mul" for node in graph.nodes) == 3
