"""The operators of the expression graph: all that the generator knows of each one is its entry here.

Besides its entry, an operator is a function for people in `obseq.formulas.functions`, on numbers and on
symbols, and a kernel function of the entry's name in `obseq.kernels.functions`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import sympy

from obseq.codegen.c_text import helper, polynomial
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
        symbolic: The sympy class that becomes it; None when formulas cannot write it.
        written: Its name in equations, when that is not the class's.
        c: Text of the C function `obseq_NAME`; empty when math.h has it; None when there is none.
    """

    symbol: str
    value: Callable[..., float] | None
    partials: Partials | None
    expensive: bool = False
    function: str = ""
    symbolic: type[sympy.Basic] | None = None
    written: str = ""
    c: str | None = None


def calls(
    name: str,
    symbolic: type[sympy.Basic] | None,
    value: Callable[..., float] | None,
    partials: Partials | None,
    *,
    arity: int = 1,
    written: str = "",
    c: str | None = None,
) -> Operator:
    """An operator that is a call of the kernel function of a name; what Python's math has, math.h has."""
    c = "" if c is None and hasattr(math, name) else c
    text = f"{name}({', '.join(['{}'] * arity)})"
    return Operator(text, value, partials, True, name, symbolic, written, c)


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


SINC_SLOPE = [(-1) ** k * k / math.factorial(2 * k + 1) for k in range(1, 13)]
"""Derivative of sin(r)/r by r^2, as a series in r^2."""

SEGMENT = [(-1) ** k * 2 ** (2 * k + 2) / math.factorial(2 * k + 3) for k in range(14)]
"""(t - sin t cos t)/t^3, as a series in t^2."""

OPERATORS: dict[str, Operator] = {
    "add": Operator("{} + {}", lambda a, b: a + b, lambda g, n, o: (g.constant(1.0), g.constant(1.0))),
    "sub": Operator("{} - {}", lambda a, b: a - b, lambda g, n, o: (g.constant(1.0), g.constant(-1.0))),
    "mul": Operator("{} * {}", lambda a, b: a * b, lambda g, n, o: (o[1], o[0])),
    "neg": Operator("-{}", lambda a: -a, lambda g, n, o: (g.constant(-1.0),)),
    "rcp": Operator("1.0 / {}", lambda a: math.inf if a == 0 else 1.0 / a, _rcp_partials, expensive=True),
    "sqrt": calls("sqrt", functions.Sqrt, math.sqrt, _sqrt_partials),
    "sin": calls("sin", sympy.sin, math.sin, lambda g, n, o: (g.apply("cos", *o),)),
    "cos": calls("cos", sympy.cos, math.cos, lambda g, n, o: (g.neg(g.apply("sin", *o)),)),
    "exp": calls("exp", sympy.exp, math.exp, lambda g, n, o: (n,)),
    "log": calls("log", sympy.log, math.log, lambda g, n, o: (g.rcp(o[0]),)),
    "tan": calls("tan", sympy.tan, math.tan, _tan_partials),
    "asin": calls("asin", sympy.asin, math.asin, _asin_partials),
    "acos": calls("acos", sympy.acos, math.acos, _acos_partials),
    "atan": calls("atan", sympy.atan, math.atan, _atan_partials),
    "atan2": calls("atan2", sympy.atan2, math.atan2, _atan2_partials, arity=2),
    "wrap_angle": calls(
        "wrap_angle",
        functions.WrapAngle,
        None,
        lambda g, n, o: (g.constant(1.0),),
        written="wrap",
        c=helper(
            "wrap_angle",
            ["angle"],
            "return angle - 6.283185307179586 * ceil((angle - 3.141592653589793) * 0.15915494309189535);",
        ),
    ),
    "sinc_sqrt": calls(
        "sinc_sqrt",
        functions.SincSqrt,
        functions.sinc_sqrt,
        _sinc_sqrt_partials,
        written="sinc_sqrt",
        c=helper("sinc_sqrt", ["s"], "return s != 0.0 ? sin(sqrt(s)) / sqrt(s) : 1.0;"),
    ),
    "sinc_sqrt_slope": calls(
        "sinc_sqrt_slope",
        None,
        None,
        None,
        c=helper(
            "sinc_sqrt_slope",
            ["s"],
            f"""if (s < 2.5)
    return {polynomial(SINC_SLOPE, "s")};
return 0.5 * (cos(sqrt(s)) - sin(sqrt(s)) / sqrt(s)) / s;""",
        ),
    ),
    "cos_sqrt": calls(
        "cos_sqrt",
        functions.CosSqrt,
        functions.cos_sqrt,
        _cos_sqrt_partials,
        written="cos_sqrt",
        c=helper("cos_sqrt", ["s"], "return cos(sqrt(s));"),
    ),
    "angle_ratio": calls(
        "angle_ratio",
        functions.AngleRatio,
        functions.angle_ratio,
        _angle_ratio_partials,
        arity=2,
        written="angle_ratio",
        c=helper(
            "angle_ratio",
            ["s", "z"],
            """if (s == 0.0)
    return z > 0.0 ? 1.0 / z : NAN;
return atan2(sqrt(s), z) / sqrt(s);""",
        ),
    ),
    "angle_ratio_slope": calls(
        "angle_ratio_slope",
        None,
        None,
        None,
        arity=3,
        c=helper(
            "angle_ratio_slope",
            ["ratio", "s", "z"],
            f"""const double t = ratio * ratio * s;
if (t < 1.0)
    return -0.5 * ratio * ratio * ratio * ({polynomial(SEGMENT, "t")});
return (z / (s + z * z) - ratio) / (2.0 * s);""",
        ),
    ),
    "axial_sum": calls(
        "axial_sum",
        functions.AxialSum,
        functions.axial_sum,
        _axial_sum_partials,
        arity=2,
        written="axial_sum",
        c=helper(
            "axial_sum",
            ["s", "z"],
            """const double larger = sqrt(s + z * z) + fabs(z);
return z >= 0.0 ? larger : s / larger;""",
        ),
    ),
    "normalised_ratio": calls(
        "normalised_ratio",
        functions.NormalisedRatio,
        functions.normalised_ratio,
        _normalised_ratio_partials,
        arity=2,
        written="contrast",
        c=helper(
            "normalised_ratio",
            ["first", "second"],
            """const double a = first > 0.0 ? first : 0.0 * first;
const double b = second > 0.0 ? second : 0.0 * second;
const double largest = a > b ? a : b;
return (a - b) / (largest > 0.0 ? largest : 1.0);""",
        ),
    ),
    "normalised_ratio_slope": calls(
        "normalised_ratio_slope",
        None,
        None,
        None,
        arity=2,
        c=helper(
            "normalised_ratio_slope",
            ["first", "second"],
            """const double b = second > 0.0 ? second : 0.0 * second;
const double largest = first < b ? b : first;
if (!(first >= 0.0 && largest > 0.0))
    return 0.0 * (first + second);
return (first < b ? 1.0 : b / largest) / largest;""",
        ),
    ),
}

SYMBOLIC: dict[type[sympy.Basic], str] = {
    operator.symbolic: name for name, operator in OPERATORS.items() if operator.symbolic is not None
}
"""The operator that a sympy function becomes; anything else is refused."""
