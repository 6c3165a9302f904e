"""Products written anew: the same values, no more operations, what they share computed once."""

import pytest

from obseq.codegen.graphs.expression_graph import ExpressionGraph, operations
from obseq.codegen.graphs.products import PREFERENCES, collect_terms, share_products


def test_products_of_the_same_factors_share_the_common_pair():
    graph = ExpressionGraph()
    x, y, s, t = (graph.input(name) for name in "xyst")
    # x s, then y t each: nothing in common as they stand, s t in each of them.
    outputs = [graph.mul(graph.mul(x, s), t), graph.mul(graph.mul(y, t), s)]
    before = operations(graph, outputs)
    after = min(operations(graph, writing) for writing in share_products(graph, outputs))
    assert (before, after) == (4, 3)


@pytest.mark.parametrize("number", range(len(PREFERENCES)))
def test_every_writing_has_the_same_values(number, evaluate):
    graph = ExpressionGraph()
    x, y, z = (graph.input(name) for name in "xyz")
    square = graph.mul(x, x)
    total = graph.add(graph.mul(square, y), graph.mul(graph.constant(3.0), graph.mul(y, z)))
    outputs = [
        graph.mul(total, graph.mul(x, total)),
        graph.neg(graph.mul(graph.mul(square, square), z)),
        total,
    ]
    inputs = {"x": 1.25, "y": -0.5, "z": 3.0}
    writing = share_products(graph, outputs)[number]
    for old, new in zip(outputs, writing, strict=True):
        assert evaluate(graph, new, inputs) == pytest.approx(evaluate(graph, old, inputs), rel=1e-14)


def test_names_of_products_survive():
    graph = ExpressionGraph()
    x, y, z = (graph.input(name) for name in "xyz")
    named = graph.mul(x, y)
    graph.names[named] = "area"
    outputs = [graph.mul(named, z), graph.add(named, z)]
    for writing in share_products(graph, outputs):
        used = graph.reachable(writing)
        assert "area" in {graph.names[node] for node in used if node in graph.names}


def test_a_repeated_term_is_collected_when_its_multiple_is_known(evaluate):
    graph = ExpressionGraph()
    x, y = graph.input("x"), graph.input("y")
    repeated = graph.add(graph.add(x, y), graph.mul(graph.constant(2.0), x))
    tripled = graph.mul(graph.constant(3.0), x)
    outputs = [repeated, tripled]
    collected = collect_terms(graph, outputs)
    assert (operations(graph, outputs), operations(graph, collected)) == (4, 2)
    inputs = {"x": 1.25, "y": -0.5}
    assert [evaluate(graph, node, inputs) for node in collected] == [3.25, 3.75]
    assert collect_terms(graph, [repeated]) == [repeated]
