"""Opposites of products with a common factor share one sign."""

from obseq.codegen.graphs.expression_graph import ExpressionGraph, operations
from obseq.codegen.graphs.products import share_signs


def entries(graph: ExpressionGraph, factors: str) -> list[int]:
    """The opposites of a b, a c, ... for the letters b, c, ..."""
    a = graph.input("a")
    return [graph.neg(graph.mul(a, graph.input(letter))) for letter in factors]


def test_three_products_take_one_sign_instead_of_three() -> None:
    graph = ExpressionGraph()
    row = entries(graph, "bcd")
    (rewritten,) = share_signs(graph, [], [row])
    assert operations(graph, row) == 6
    assert operations(graph, rewritten) == 4
    opposite = graph.node("neg", graph.input("a"))
    assert rewritten == [graph.node("mul", opposite, graph.input(letter)) for letter in "bcd"]


def test_one_opposite_stays() -> None:
    graph = ExpressionGraph()
    row = entries(graph, "b")
    assert share_signs(graph, [], [row]) == [row]


def test_a_product_that_serves_elsewhere_stays() -> None:
    graph = ExpressionGraph()
    row = entries(graph, "bc")
    residual = graph.mul(graph.input("a"), graph.input("b"))
    assert share_signs(graph, [residual], [row]) == [row]


def test_an_entry_that_comes_twice_stays() -> None:
    graph = ExpressionGraph()
    row = entries(graph, "bc")
    assert operations(graph, [n for r in share_signs(graph, [], [row, row]) for n in r]) <= 4
