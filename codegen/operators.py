"""The operators of the expression graph: how each one is printed, computed on constants, and differentiated.

An operator with a hand-written derivative is one entry here, one kernel function of the same name in
`obseq.kernels.functions`, and one function for people in `obseq.formulas.functions`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from obseq.formulas import functions


class Arithmetic(Protocol):
    """What a derivative is built with: nodes of a graph of expressions, by their numbers."""

    def constant(self, value: float) -> int:
        """A number."""

    def add(self, a: int, b: int) -> int:
        """The sum a + b."""

    def sub(self, a: int, b: int) -> int:
        """The difference a - b."""

    def mul(self, a: int, b: int) -> int:
        """The product a b."""

    def neg(self, a: int) -> int:
        """The negative of a."""

    def rcp(self, a: int) -> int:
        """The reciprocal of a."""

    def apply(self, operator: str, *operands: int) -> int:
        """An operator on its operands."""


Partials = Callable[[Arithmetic, int, tuple[int, ...]], tuple[int, ...]]
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


def _call(
    name: str, value: Callable[..., float] | None, partials: Partials | None, arity: int = 1
) -> Operator:
    return Operator(f"{name}({', '.join(['{}'] * arity)})", value, partials, expensive=True, function=name)


def _sqrt_partials(g: Arithmetic, node: int, _: tuple[int, ...]) -> tuple[int, ...]:
    return (g.mul(g.constant(0.5), g.rcp(node)),)


def _rcp_partials(g: Arithmetic, node: int, _: tuple[int, ...]) -> tuple[int, ...]:
    return (g.neg(g.mul(node, node)),)


def _atan2_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    y, x = operands
    inverse = g.rcp(g.add(g.mul(x, x), g.mul(y, y)))
    return g.mul(x, inverse), g.neg(g.mul(y, inverse))


def _asin_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    (x,) = operands
    one = g.constant(1.0)
    return (g.rcp(g.apply("sqrt", g.mul(g.sub(one, x), g.add(one, x)))),)


def _acos_partials(g: Arithmetic, node: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    return (g.neg(*_asin_partials(g, node, operands)),)


def _tan_partials(g: Arithmetic, node: int, _: tuple[int, ...]) -> tuple[int, ...]:
    return (g.add(g.constant(1.0), g.mul(node, node)),)


def _atan_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    (x,) = operands
    return (g.rcp(g.add(g.constant(1.0), g.mul(x, x))),)


def _sinc_sqrt_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    return (g.apply("sinc_sqrt_slope", *operands),)


def _cos_sqrt_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    return (g.mul(g.constant(-0.5), g.apply("sinc_sqrt", *operands)),)


def _angle_ratio_partials(g: Arithmetic, node: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    s, z = operands
    return g.apply("angle_ratio_slope", node, s, z), g.neg(g.rcp(g.add(s, g.mul(z, z))))


def _axial_sum_partials(g: Arithmetic, node: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    s, z = operands
    inverse = g.rcp(g.apply("sqrt", g.add(s, g.mul(z, z))))
    return g.mul(g.constant(0.5), inverse), g.mul(node, inverse)


def _normalised_ratio_partials(g: Arithmetic, _: int, operands: tuple[int, ...]) -> tuple[int, ...]:
    a, b = operands
    return g.apply("normalised_ratio_slope", a, b), g.neg(g.apply("normalised_ratio_slope", b, a))


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
    "tan": _call("tan", math.tan, _tan_partials),
    "asin": _call("asin", math.asin, _asin_partials),
    "acos": _call("acos", math.acos, _acos_partials),
    "atan": _call("atan", math.atan, _atan_partials),
    "atan2": _call("atan2", math.atan2, _atan2_partials, arity=2),
    "wrap_angle": _call("wrap_angle", None, lambda g, n, o: (g.constant(1.0),)),
    "sinc_sqrt": _call("sinc_sqrt", functions.sinc_sqrt, _sinc_sqrt_partials),
    "sinc_sqrt_slope": _call("sinc_sqrt_slope", None, None),
    "cos_sqrt": _call("cos_sqrt", functions.cos_sqrt, _cos_sqrt_partials),
    "angle_ratio": _call("angle_ratio", functions.angle_ratio, _angle_ratio_partials, arity=2),
    "angle_ratio_slope": _call("angle_ratio_slope", None, None, arity=3),
    "axial_sum": _call("axial_sum", functions.axial_sum, _axial_sum_partials, arity=2),
    "normalised_ratio": _call(
        "normalised_ratio", functions.normalised_ratio, _normalised_ratio_partials, arity=2
    ),
    "normalised_ratio_slope": _call("normalised_ratio_slope", None, None, arity=2),
}
