"""The operators of the expression graph: how each one is printed, computed on constants, and differentiated.

An operator with a hand-written derivative is one entry here, one kernel function of the same name in
`obseq.kernels.functions`, and one function for people in `obseq.formulas.functions`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from obseq.codegen.graph import Graph

Partials = Callable[["Graph", int, tuple[int, ...]], tuple[int, ...]]
"""(graph, node, operands) -> derivative of the node with respect to each operand."""


@dataclass(frozen=True)
class Operator:
    """One operator.

    Attributes:
        symbol: Python text with one place per operand.
        value: The function on floats, to fold constants; None when constants are not folded through it.
        partials: Its derivatives; None when nothing may be differentiated through it.
        expensive: True when it is a long chain (square root, reciprocal, trigonometry).
        function: Name of the kernel function that its text calls, if any.
    """

    symbol: str
    value: Callable[..., float] | None
    partials: Partials | None
    expensive: bool = False
    function: str = ""


def _call(name: str, value: Callable[..., float] | None, partials: Partials | None, arity: int = 1) -> Operator:
    return Operator(f"{name}({', '.join(['{}'] * arity)})", value, partials, expensive=True, function=name)


def _sqrt_partials(g: "Graph", node: int, _: tuple[int, ...]) -> tuple[int, ...]:
    return (g.mul(g.constant(0.5), g.rcp(node)),)


def _rcp_partials(g: "Graph", node: int, _: tuple[int, ...]) -> tuple[int, ...]:
    return (g.neg(g.mul(node, node)),)


def _atan2_partials(g: "Graph", _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    y, x = operands
    inverse = g.rcp(g.add(g.mul(x, x), g.mul(y, y)))
    return g.mul(x, inverse), g.neg(g.mul(y, inverse))


def _asin_partials(g: "Graph", _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    (x,) = operands
    one = g.constant(1.0)
    return (g.rcp(g.apply("sqrt", g.mul(g.sub(one, x), g.add(one, x)))),)


OPERATORS: dict[str, Operator] = {
    "add": Operator("{} + {}", lambda a, b: a + b, lambda g, n, o: (g.constant(1.0), g.constant(1.0))),
    "sub": Operator("{} - {}", lambda a, b: a - b, lambda g, n, o: (g.constant(1.0), g.constant(-1.0))),
    "mul": Operator("{} * {}", lambda a, b: a * b, lambda g, n, o: (o[1], o[0])),
    "neg": Operator("-{}", lambda a: -a, lambda g, n, o: (g.constant(-1.0),)),
    "rcp": Operator("1.0 / {}", lambda a: math.inf if a == 0 else 1.0 / a, _rcp_partials, expensive=True),
    "sqrt": _call("sqrt", math.sqrt, _sqrt_partials),
    "sin": _call("sin", math.sin, lambda g, n, o: (g.apply("cos", *o),)),
    "cos": _call("cos", math.cos, lambda g, n, o: (g.neg(g.apply("sin", *o)),)),
    "exp": _call("exp", math.exp, lambda g, n, o: (n,)),
    "log": _call("log", math.log, lambda g, n, o: (g.rcp(o[0]),)),
    "asin": _call("asin", math.asin, _asin_partials),
    "atan2": _call("atan2", math.atan2, _atan2_partials, arity=2),
    "wrap_angle": _call("wrap_angle", None, lambda g, n, o: (g.constant(1.0),)),
}
