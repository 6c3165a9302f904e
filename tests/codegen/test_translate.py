"""From sympy to the graph: structure kept, and what has no kernel refused by name."""

import pytest
import sympy

from obseq.codegen.compiler import derive
from obseq.codegen.graphs.translate import graph_of
from obseq.errors import FormulaError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar, let


class _Bessel(Formula):
    """An equation that the kernels cannot compute."""

    @property
    def name(self) -> str:
        return "Bessel"

    def residual(self, x: Number, *, y: Number) -> Scalar:
        return sympy.besselj(0, x + y) - y


class _Shared(Formula):
    """An equation that says the same thing twice."""

    def residual(self, x: Number, *, y: Number) -> Scalar:
        ratio = let("ratio", x / y)
        return ratio * ratio + x / y


def test_an_unknown_function_is_refused_with_the_formula_and_the_expression() -> None:
    with pytest.raises(FormulaError, match=r"^Bessel: .*besselj in besselj\(0, x \+ y\); write it with"):
        derive(_Bessel())


def test_expressions_are_shared_and_names_survive() -> None:
    graph, (residual,) = graph_of("formula", _Shared().expressions())
    quotients = [node for node in graph.reachable([residual]) if graph.nodes[node].operator == "rcp"]
    assert len(quotients) == 1
    assert list(graph.names.values()) == ["ratio"]
    assert len(graph.reachable([residual])) == 6  # x, y, 1/y, x/y, its square, the sum
