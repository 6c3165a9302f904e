"""The scalar functions a formula may use: on symbols they build expressions, on numbers they compute.

Each function dispatches on its arguments: sympy expressions give an unevaluated node, mpmath numbers are
computed in their own precision, anything else in double precision. What a function means to the generator
(its kernel function, its derivative) is said in `obseq.codegen.operators`, under the same name.
"""

import math
from typing import Any

import mpmath
import sympy

Scalar = Any
"""A float, an mpmath number or a sympy expression: the three readings of a formula."""


class Named(sympy.Function):
    """An expression with the name that `let` gave it; transparent to mathematics."""


class WrapAngle(sympy.Function):
    """An angle brought to (-pi, pi]."""


class Sqrt(sympy.Function):
    """Square root, kept as one operation."""


class Sinc(sympy.Function):
    """Cardinal sine sin(x)/x."""


class AtanRatio(sympy.Function):
    """Angle atan2(x, y) over x, smooth at x = 0 for y > 0."""


class NormalisedRatio(sympy.Function):
    """Ratio contrast of two non-negative radiometries, in [-1, 1]."""


def _is_symbolic(*arguments: Scalar) -> bool:
    return any(isinstance(argument, sympy.Basic) for argument in arguments)


def _library(*arguments: Scalar) -> Any:
    """The module that computes on these numbers: mpmath when one of them is an mpmath number, else math."""
    return mpmath if any(isinstance(argument, mpmath.mpf) for argument in arguments) else math


def sqrt(x: Scalar) -> Scalar:
    """Square root; its derivative is infinite at 0."""
    return Sqrt(x) if _is_symbolic(x) else _library(x).sqrt(x)


def sin(x: Scalar) -> Scalar:
    """Sine of an angle in radians."""
    return sympy.sin(x) if _is_symbolic(x) else _library(x).sin(x)


def cos(x: Scalar) -> Scalar:
    """Cosine of an angle in radians."""
    return sympy.cos(x) if _is_symbolic(x) else _library(x).cos(x)


def exp(x: Scalar) -> Scalar:
    """Exponential."""
    return sympy.exp(x) if _is_symbolic(x) else _library(x).exp(x)


def log(x: Scalar) -> Scalar:
    """Natural logarithm."""
    return sympy.log(x) if _is_symbolic(x) else _library(x).log(x)


def asin(x: Scalar) -> Scalar:
    """Arc sine, in radians; its derivative is infinite at -1 and 1."""
    return sympy.asin(x) if _is_symbolic(x) else _library(x).asin(x)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """Angle of the vector (x, y), the ordinate first, in (-pi, pi]; undefined at (0, 0)."""
    return sympy.atan2(y, x) if _is_symbolic(y, x) else _library(y, x).atan2(y, x)


def wrap_angle(angle: Scalar) -> Scalar:
    """An angle brought to (-pi, pi] by whole turns."""
    if _is_symbolic(angle):
        return WrapAngle(angle)
    library = _library(angle)
    turn = 2 * library.pi
    return angle - turn * library.ceil((angle - library.pi) / turn)


def angle_difference(computed: Scalar, observed: Scalar) -> Scalar:
    """Difference of two angles brought to (-pi, pi].

    MMVII's DiffAngMod leaves differences between pi and 2 pi as they are; here they are wrapped.
    """
    return wrap_angle(computed - observed)


def sinc(x: Scalar) -> Scalar:
    """Cardinal sine sin(x)/x, equal to 1 at 0 with all its derivatives exact there."""
    if _is_symbolic(x):
        return Sinc(x)
    return _library(x).sin(x) / x if x != 0 else x * 0 + 1


def atan_ratio(x: Scalar, y: Scalar) -> Scalar:
    """Angle atan2(x, y) divided by x: its limit 1/y at x = 0 when y > 0, non-finite there when y <= 0.

    MMVII's AtanXsY_sX returns 1/y in a cone around x = 0 whatever the sign of y; here y < 0 is exact.
    """
    if _is_symbolic(x, y):
        return AtanRatio(x, y)
    return _library(x, y).atan2(x, y) / x if x != 0 else 1 / y


def normalised_ratio(first: Scalar, second: Scalar) -> Scalar:
    """Contrast of two radiometries, negative ones taken as 0: a/b - 1 if a < b, 1 - b/a if a > b, 0 if equal."""
    if _is_symbolic(first, second):
        return NormalisedRatio(first, second)
    a, b = max(first, first * 0), max(second, second * 0)
    if a == b:
        return a * 0
    return a / b - 1 if a < b else 1 - b / a


def let(name: str, value: Any) -> Any:
    """The value, under a name that survives into the generated code; points name their components."""
    if hasattr(value, "with_names"):
        return value.with_names(name)
    return Named(sympy.Symbol(name), value) if _is_symbolic(value) else value
