"""The scalar functions a formula may use: on symbols they build expressions, on numbers they compute.

Each function dispatches on its arguments: sympy expressions give an unevaluated node, mpmath numbers are
computed in their own precision, anything else in double precision. What a function means to the generator
(its kernel function, its derivative) is said in `obseq.codegen.operators`, under the same name.
"""

import keyword
import math
from typing import Any

import mpmath
import sympy

from obseq.errors import FormulaError

Scalar = Any
"""A float, an mpmath number or a sympy expression: the three readings of a formula."""


class Operation(sympy.Function):  # type: ignore[misc]  # sympy has no types
    """A function that stays one operation in expressions."""


class Named(Operation):
    """An expression with the name that `let` gave it; transparent to mathematics."""


class WrapAngle(Operation):
    """An angle brought to (-pi, pi]."""


class Sqrt(Operation):
    """Square root, kept as one operation."""


class SincSqrt(Operation):
    """Cardinal sine of a square root, smooth at 0."""


class CosSqrt(Operation):
    """Cosine of a square root, smooth at 0."""


class AngleRatio(Operation):
    """Angle from an axis over the distance to it, smooth on the axis."""


class AxialSum(Operation):
    """Length of a vector plus its component along an axis."""


class NormalisedRatio(Operation):
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


def tan(x: Scalar) -> Scalar:
    """Tangent of an angle in radians."""
    return sympy.tan(x) if _is_symbolic(x) else _library(x).tan(x)


def exp(x: Scalar) -> Scalar:
    """Exponential."""
    return sympy.exp(x) if _is_symbolic(x) else _library(x).exp(x)


def log(x: Scalar) -> Scalar:
    """Natural logarithm."""
    return sympy.log(x) if _is_symbolic(x) else _library(x).log(x)


def power(base: Scalar, exponent: Scalar) -> Scalar:
    """A positive base to any real exponent, known or unknown; `base**exponent` is the same."""
    return exp(exponent * log(base))


def asin(x: Scalar) -> Scalar:
    """Arc sine, in radians; its derivative is infinite at -1 and 1."""
    return sympy.asin(x) if _is_symbolic(x) else _library(x).asin(x)


def acos(x: Scalar) -> Scalar:
    """Arc cosine, in radians; its derivative is infinite at -1 and 1."""
    return sympy.acos(x) if _is_symbolic(x) else _library(x).acos(x)


def atan(x: Scalar) -> Scalar:
    """Arc tangent, in radians."""
    return sympy.atan(x) if _is_symbolic(x) else _library(x).atan(x)


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
    return sinc_sqrt(x * x)


def sinc_sqrt(s: Scalar) -> Scalar:
    """sin(r)/r for r = sqrt(s): a smooth function of s >= 0, where r itself has no derivative at 0."""
    if _is_symbolic(s):
        return SincSqrt(s)
    root = sqrt(s)
    return sin(root) / root if s != 0 else s * 0 + 1


def cos_sqrt(s: Scalar) -> Scalar:
    """cos(r) for r = sqrt(s): a smooth function of s >= 0."""
    return CosSqrt(s) if _is_symbolic(s) else cos(sqrt(s))


def angle_ratio(s: Scalar, z: Scalar) -> Scalar:
    """atan2(r, z)/r for r = sqrt(s): the angle from the z axis over the distance to it.

    Smooth on the axis for z > 0, where it is 1/z; not a number on the backward axis (s = 0, z <= 0). MMVII's
    AtanXsY_sX takes 1/z in the whole cone r <= `1e-4 |z|`, backwards too; here the backward cone is exact.
    """
    if _is_symbolic(s, z):
        return AngleRatio(s, z)
    root = sqrt(s)
    if s != 0:
        return atan2(root, z) / root
    return 1 / z if z > 0 else z * math.nan


def axial_sum(s: Scalar, z: Scalar) -> Scalar:
    """sqrt(s + z^2) + z, where s >= 0 is a squared distance to the z axis; no digit is lost for z < 0."""
    if _is_symbolic(s, z):
        return AxialSum(s, z)
    larger = sqrt(s + z * z) + abs(z)
    return larger if z >= 0 else s / larger


def normalised_ratio(first: Scalar, second: Scalar) -> Scalar:
    """Contrast (a - b)/max(a, b) of two radiometries, negative ones taken as 0; 0 when both are 0.

    Its derivatives are continuous across a = b > 0. Those of a negative argument are 0, where MMVII's are
    those of a positive one; at 0 they are those on the side of positive radiometries.
    """
    if _is_symbolic(first, second):
        return NormalisedRatio(first, second)
    a, b = max(first, first * 0), max(second, second * 0)
    return (a - b) / max(a, b) if a != b else a * 0


def let(name: str, value: Any) -> Any:
    """The value, under a name that survives into the generated code; points name their components.

    Raises:
        FormulaError: the name is no identifier of Python.
    """
    if hasattr(value, "with_names"):
        return value.with_names(name)
    if not name.isidentifier() or not name.isascii() or keyword.iskeyword(name):
        raise FormulaError(f"let({name!r}, ...): the name is not an identifier")
    return Named(sympy.Symbol(name), value) if _is_symbolic(value) else value
