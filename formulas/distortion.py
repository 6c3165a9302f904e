"""Distortion of a central camera, dimensionless: radial, decentric and general polynomial terms.

With `s = x^2 + y^2`, radial degree r, decentric degree d and general degree g:

    Dist_x = x + x sum_n K_n s^n + sum_n (p_{2n-1} A_n + p_{2n} B_n) + sum x_i_j x^i y^j
    Dist_y = y + y sum_n K_n s^n + sum_n (p_{2n-1} B_n + p_{2n} C_n) + sum y_i_j x^i y^j

    A_n = s^{n-1} (s + 2n x^2),   B_n = s^{n-1} 2n x y,   C_n = s^{n-1} (s + 2n y^2)

The centre is (0, 0), the principal point. The general terms leave out what the others or the focal length
already say. In Fraser's description the terms of degree 1 are `b1 x + b2 y` in x and none in y; in the other
one they are `a x` in x and `b x` in y (MMVII's comment announces `b y`; its code and names say `b x`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Point2, Vector
from obseq.formulas.functions import Scalar
from obseq.formulas.naming import Flag, Patterned

CAMERA = "MMVII Formulas_CamStenope.h"


class Monomial(NamedTuple):
    """A general term `x^i y^j` of the component `on` (`x` or `y`), and the name of its coefficient."""

    on: str
    i: int
    j: int
    name: str


@dataclass(frozen=True)
class Degree(Patterned):
    """The degrees of a distortion; its name and its parameters follow from them.

    Attributes:
        radial: Number of coefficients K.
        decentric: Number of pairs of coefficients p.
        polynomial: Largest total degree of the general terms.
        fraser: False for MMVII's other choice of the terms of degree 1.
    """

    radial: int = 0
    decentric: int = 0
    polynomial: int = 0
    fraser: Annotated[bool, Flag("_D1aXbX", when=False)] = True

    pattern = "Rad{radial}_Dec{decentric}_XY{polynomial}{fraser}"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in MMVII's order: radial, decentric, then the general terms."""
        radial = [f"K{n + 1}" for n in range(self.radial)]
        decentric = [f"p{n + 1}" for n in range(2 * self.decentric)]
        return (*radial, *decentric, *(monomial.name for monomial in self.monomials))

    @property
    def monomials(self) -> tuple[Monomial, ...]:
        """The general terms that are kept, by powers of y, then of x, then component."""
        return tuple(
            Monomial(on, i, j, self._coefficient(on, i, j))
            for j in range(self.polynomial + 1)
            for i in range(self.polynomial + 1 - j)
            for on in "xy"
            if self._keeps(on, i, j)
        )

    def _keeps(self, on: str, i: int, j: int) -> bool:
        if i + j == 0:
            return False
        if i + j == 1:
            return on == "x" if self.fraser else j == 0
        like_a_rotation = (on, i, j) in (("x", 2, 0), ("y", 0, 2))
        like_radial = on == "x" and j == 0 and i % 2 == 1 and i <= 2 * self.radial + 1
        like_decentric = i == j <= self.decentric
        return not (like_a_rotation or like_radial or like_decentric)

    def _coefficient(self, on: str, i: int, j: int) -> str:
        if i + j > 1:
            return f"{on}_{i}_{j}"
        if self.fraser:
            return "b1" if i else "b2"
        return "a" if on == "x" else "b"

    def distort(self, point: Point2, parameters: Sequence[Scalar]) -> Point2:
        """The distorted point; every sum is written by Horner's rule."""
        x, y = point
        radial, decentric = self.radial, self.radial + 2 * self.decentric
        s = x * x + y * y
        result = point
        if self.radial:
            result = (1 + s * polynomial(parameters[:radial], s)) * point
        if self.decentric:
            result = result + _decentric(point, s, parameters[radial:decentric])
        values = dict(zip(self.monomials, parameters[decentric:], strict=True))
        for on in "xy":
            terms = {(m.i, m.j): value for m, value in values.items() if m.on == on}
            if terms:
                general = polynomial2(terms, x, y)
                result = (
                    Point2(result.x + general, result.y)
                    if on == "x"
                    else Point2(result.x, result.y + general)
                )
        return result

    def basis(self, point: Point2) -> tuple[Point2, ...]:
        """What multiplies each parameter in the distorted point, in the order of the parameters."""
        x, y = point
        s = x * x + y * y
        functions = [s**n * point for n in range(1, self.radial + 1)]
        for n in range(1, self.decentric + 1):
            outer, scale = s**n, 2 * n * s ** (n - 1)
            crossed = scale * x * y
            functions.append(Point2(outer + scale * x * x, crossed))
            functions.append(Point2(crossed, outer + scale * y * y))
        for on, i, j, _ in self.monomials:
            value = x**i * y**j
            functions.append(Point2(value, 0 * value) if on == "x" else Point2(0 * value, value))
        return tuple(functions)


def _decentric(point: Point2, s: Scalar, parameters: Sequence[Scalar]) -> Point2:
    """The decentric terms: `s^{n-1} (s p + 2n (p . q) q)` summed over the pairs p = (p_{2n-1}, p_{2n})."""
    pairs = [Point2(*parameters[k : k + 2]) for k in range(0, len(parameters), 2)]
    along = polynomial([2 * (n + 1) * pair.dot(point) for n, pair in enumerate(pairs)], s)
    x = polynomial([pair.x for pair in pairs], s)
    y = polynomial([pair.y for pair in pairs], s)
    return Point2(s * x + along * point.x, s * y + along * point.y)


def polynomial(coefficients: Sequence[Scalar | None], x: Scalar) -> Scalar:
    """A polynomial by Horner's rule, the constant first; None is an absent term."""
    result = None
    for coefficient in reversed(coefficients):
        if result is None:
            result = coefficient
        else:
            result = x * result if coefficient is None else coefficient + x * result
    return result


def polynomial2(terms: dict[tuple[int, int], Scalar], x: Scalar, y: Scalar) -> Scalar:
    """The sum of `terms[i, j] x^i y^j` by Horner's rule, in x for each power of y, then in y."""
    degree = max(max(power) for power in terms)
    rows = [polynomial([terms.get((i, j)) for i in range(degree + 1)], x) for j in range(degree + 1)]
    return polynomial(rows, y)


@dataclass(frozen=True)
class Distortion(Formula):
    """Distortion as a map of the plane: the distorted point, not a residual.

    Value: `(Dist_x, Dist_y)` of the module, at `(xPi, yPi)`; dimensionless. Defined everywhere.
    """

    degree: Degree = Degree()
    pattern = "EqDist_Dist_{degree}"
    source = CAMERA
    typical = {"point": (0.0, 0.7), "parameters": (0.0, 0.1)}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The components of the distorted point."""
        return ("x", "y")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.degree.parameters

    def residual(
        self, point: Annotated[Point2, "xPi", "yPi"], *, parameters: Annotated[Vector, "parameters"]
    ) -> Point2:
        """The distorted point."""
        return self.degree.distort(point, parameters)


@dataclass(frozen=True)
class DistortionBasis(Formula):
    """What multiplies each parameter of a distortion: a family of maps of the plane, not a residual.

    Values: the x components for all parameters in order, then the y components; dimensionless. The identity
    is not one of them: the distorted point is the point plus the parameters times these. Without parameters
    there is no value. MMVII has the values only, here they have derivatives as well. Defined everywhere.
    """

    degree: Degree = Degree()
    pattern = "EqDist_Dist_Base_{degree}"
    source = CAMERA
    typical = {"point": (0.0, 0.7)}

    @property
    def outputs(self) -> tuple[str, ...]:
        """A name for each component of the maps of each parameter."""
        return tuple(f"d{on}_d{parameter}" for on in "xy" for parameter in self.degree.parameters)

    def residual(self, point: Annotated[Point2, "xPi", "yPi"]) -> tuple[Scalar, ...]:
        """The x components, then the y components."""
        basis = self.degree.basis(point)
        return (*(function.x for function in basis), *(function.y for function in basis))


FRASER = (
    Degree(0, 0, 0),
    Degree(0, 0, 1),
    Degree(2, 0, 0),
    Degree(3, 0, 0),
    Degree(3, 1, 0),
    Degree(3, 1, 1),
    Degree(3, 1, 5),
    Degree(5, 1, 1),
    Degree(5, 1, 2),
    Degree(5, 1, 5),
    Degree(5, 2, 2),
    Degree(7, 2, 5),
)
"""Fraser's degrees that MMVII generates."""

NOT_FRASER = (
    Degree(0, 0, 1, fraser=False),
    Degree(3, 1, 1, fraser=False),
    Degree(5, 1, 1, fraser=False),
    Degree(2, 0, 0, fraser=False),
)
"""The other degrees that MMVII generates."""

DISTORTIONS: tuple[Formula, ...] = tuple(
    family(degree) for degree in (*FRASER, *NOT_FRASER) for family in (Distortion, DistortionBasis)
)
