"""From the sympy expressions of a formula to its expression graph."""

import math
from collections.abc import Callable, Sequence

import sympy

from obseq.codegen.graphs.expression_graph import ExpressionGraph
from obseq.codegen.operators import SYMBOLIC
from obseq.errors import FormulaError
from obseq.formulas import functions


def graph_of(formula: str, expressions: Sequence[sympy.Expr]) -> tuple[ExpressionGraph, list[int]]:
    """The graph of some expressions and the node of each.

    Args:
        formula: Name of the formula, for messages.
        expressions: Sympy expressions of its scalars.

    Raises:
        FormulaError: An expression has no counterpart in the kernels.
    """
    translator = _Translator(formula, ExpressionGraph(), {})
    return translator.graph, [translator.visit(expression) for expression in expressions]


class _Translator:
    """Translates each expression once; `memory` is keyed by identity, since sympy's equality walks trees."""

    def __init__(
        self, formula: str, graph: ExpressionGraph, memory: dict[int, tuple[sympy.Basic, int]]
    ) -> None:
        self.formula = formula
        self.graph = graph
        self.memory = memory

    def visit(self, expression: sympy.Basic) -> int:
        if id(expression) not in self.memory:
            self.memory[id(expression)] = (expression, self._translate(expression))
        return self.memory[id(expression)][1]

    def _translate(self, expression: sympy.Basic) -> int:
        graph = self.graph
        if isinstance(expression, sympy.Symbol):
            return graph.input(expression.name)
        if isinstance(expression, sympy.Number | sympy.NumberSymbol):
            return graph.constant(self._double(expression))
        if isinstance(expression, sympy.Add):
            return self._fold(graph.add, expression.args)
        if isinstance(expression, sympy.Mul):
            return self._fold(graph.mul, expression.args)
        if isinstance(expression, sympy.Pow):
            return self._power(*expression.args)
        if isinstance(expression, functions.Named):
            return self._name(*expression.args)
        if type(expression) in SYMBOLIC:
            return graph.apply(SYMBOLIC[type(expression)], *(self.visit(a) for a in expression.args))
        raise self._refusal(expression)

    def _double(self, number: sympy.Basic) -> float:
        try:
            value = float(number)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            raise FormulaError(
                f"{self.formula}: a number is too large for double precision: {number!s:.20}..."
            )
        return value

    def _fold(self, operation: Callable[[int, int], int], arguments: tuple[sympy.Basic, ...]) -> int:
        result = self.visit(arguments[0])
        for argument in arguments[1:]:
            result = operation(result, self.visit(argument))
        return result

    def _power(self, base: sympy.Basic, exponent: sympy.Basic) -> int:
        """Repeated squares for whole exponents, a square root for halves, else exp(exponent log(base))."""
        graph = self.graph
        if base == sympy.E:
            return graph.apply("exp", self.visit(exponent))
        node = self.visit(base)
        if exponent.is_Number and (2 * float(exponent)).is_integer():
            halves = int(2 * float(exponent))
            if halves % 2:
                return graph.power(graph.apply("sqrt", node), halves)
            return graph.power(node, halves // 2)
        return graph.apply("exp", graph.mul(self.visit(exponent), graph.apply("log", node)))

    def _name(self, name: sympy.Basic, expression: sympy.Basic) -> int:
        node = self.visit(expression)
        self.graph.names.setdefault(node, str(name))
        return node

    def _refusal(self, expression: sympy.Basic) -> FormulaError:
        return FormulaError(
            f"{self.formula}: the generator has no kernel for {type(expression).__name__} in {expression!s}; "
            f"write it with obseq.formulas.functions, or add an operator to obseq.codegen.operators"
        )
