"""Products in the graph: shared in whatever order they are asked for, constants kept out of the way."""

import pytest

from obseq.codegen.graphs.expression_graph import ExpressionGraph


@pytest.fixture
def graph():
    return ExpressionGraph()


@pytest.fixture
def inputs(graph):
    return tuple(graph.input(name) for name in "abc")


def test_products_of_the_same_factors_are_one_node(graph, inputs):
    a, b, c = inputs
    assert graph.mul(a, graph.mul(b, c)) == graph.mul(graph.mul(a, b), c) == graph.mul(graph.mul(c, a), b)


def test_a_constant_times_a_known_product_is_a_multiple_of_it(graph, inputs):
    a, b, _ = inputs
    product, two = graph.mul(a, b), graph.constant(2.0)
    assert graph.mul(graph.mul(two, a), b) == graph.mul(two, product)
    assert graph.mul(graph.mul(two, b), a) == graph.mul(a, graph.mul(two, b)) == graph.mul(two, product)


def test_constants_that_cancel_disappear(graph, inputs):
    a, b, c = inputs
    half = graph.mul(a, graph.mul(graph.constant(0.5), b))
    assert graph.mul(half, graph.mul(graph.constant(2.0), c)) == graph.mul(graph.mul(a, b), c)
    assert graph.mul(half, graph.mul(graph.constant(-2.0), c)) == graph.neg(graph.mul(graph.mul(a, b), c))


def test_multiples_of_one_node_are_added(graph, inputs):
    a, _, _ = inputs
    twice, thrice = (graph.mul(graph.constant(k), a) for k in (2.0, 3.0))
    assert graph.add(a, a) == twice
    assert graph.add(twice, a) == graph.add(a, twice) == thrice
    assert graph.sub(thrice, twice) == a
    assert graph.sub(twice, thrice) == graph.neg(a)
    assert graph.constant_value(graph.sub(twice, twice)) == 0.0
