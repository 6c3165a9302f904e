"""Plane geometry: distances, their ratios, sums of squares, and rigid motions of groups of points.

Lengths are in the unit of the points. The rigid motion of a group is `(X, Y) = (x_tr, y_tr) + R(teta) (x,
y)`, a turn by `teta` radians from x to y and a translation, without scale.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Length, Number, Point2, Points2, Vector, norm
from obseq.formulas.functions import Scalar, cos, let, sin
from obseq.formulas.naming import Whole

SOURCE = "MMVII Formulas_Geom2D.h"

Translation = Annotated[Point2, "x_tr", "y_tr"]
Turn = Annotated[Angle, "teta"]
GroupPoints = Annotated[Points2, "x_P{}", "y_P{}", "number"]
AtLeastOne = Annotated[int, Whole(least=1)]


@dataclass(frozen=True)
class SumSquare(Formula):
    """Sum of the squares of some unknowns, an example of a constraint that is not linear.

    Residual: `SXX - sum_k X_k^2`: observed minus computed, MMVII's order. Defined everywhere. MMVII generates
    8 unknowns only.

    Attributes:
        number: How many unknowns.
    """

    number: AtLeastOne = 8
    pattern = "SumSquare_{number}"

    source = SOURCE
    typical: ClassVar = {"total": (8.0, 4.0)}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(f"X{k}" for k in range(self.number))

    def residual(self, terms: Annotated[Vector, "names"], *, total: Annotated[Number, "SXX"]) -> Scalar:
        """The sum observed, minus the sum of squares computed."""
        return total - sum(x * x for x in terms)


class Dist2DCons(Formula):
    """Conservation of the distance of two points of the plane, relative to its size.

    Residual: `|p2 - p1| / D - 1`, dimensionless. Undefined where the two points coincide.
    """

    source = SOURCE
    typical: ClassVar = {"p1": (0.0, 10.0), "p2": (0.0, 10.0), "D": (10.0, 5.0)}

    def residual(self, p1: Point2, p2: Point2, *, distance: Annotated[Length, "D"]) -> Scalar:
        """The distance computed, relative to the distance observed, minus one."""
        return norm(p2 - p1) / distance - 1


class RatioDist2DCons(Formula):
    """Conservation of the ratios of the three distances of a triangle of the plane.

    Residual: `(r_12 - r_13, r_12 - r_23, r_13 - r_23)`, dimensionless, with `r_ij = |p_j - p_i| / D_ij`. The
    three have rank 2. Undefined where two of the points coincide.
    """

    source = SOURCE
    typical: ClassVar = {
        "p1": (0.0, 10.0),
        "p2": (0.0, 10.0),
        "p3": (0.0, 10.0),
        "D12": (10.0, 5.0),
        "D13": (10.0, 5.0),
        "D23": (10.0, 5.0),
    }

    @property
    def outputs(self) -> tuple[str, ...]:
        """The differences of ratios, by the sides that they compare."""
        return ("r_12_13", "r_12_23", "r_13_23")

    def residual(
        self,
        p1: Point2,
        p2: Point2,
        p3: Point2,
        *,
        distance_12: Annotated[Length, "D12"],
        distance_13: Annotated[Length, "D13"],
        distance_23: Annotated[Length, "D23"],
    ) -> tuple[Scalar, Scalar, Scalar]:
        """The differences of the three ratios of computed to observed distances."""
        ratio_12 = let("ratio_12", norm(p2 - p1) / distance_12)
        ratio_13 = let("ratio_13", norm(p3 - p1) / distance_13)
        ratio_23 = let("ratio_23", norm(p3 - p2) / distance_23)
        return ratio_12 - ratio_13, ratio_12 - ratio_23, ratio_13 - ratio_23


@dataclass(frozen=True)
class PropCovNwCD(Formula):
    """A linear form of the points of a group, observed up to a rigid motion of the group.

    Residual: `sum_k (xLEq_k X_k + yLEq_k Y_k) - Cste`, with `(X_k, Y_k)` the point k after the motion; the
    normal matrix of a sub-network becomes such forms, weighted by its eigenvalues. Defined everywhere. MMVII
    generates 4 points only.

    Attributes:
        number: How many points.
    """

    number: AtLeastOne = 4
    pattern = "PropCovNwCD_{number}"

    source = SOURCE
    typical: ClassVar = {"teta": (0.0, 3.0), "translation": (0.0, 10.0)}

    def residual(
        self,
        translation: Translation,
        turn: Turn,
        points: GroupPoints,
        *,
        coefficients: Annotated[Points2, "xLEq_{}", "yLEq_{}", "number"],
        constant: Annotated[Number, "Cste"],
    ) -> Scalar:
        """The form computed from the points moved, minus its value observed."""
        pairs = list(zip(coefficients, points, strict=True))
        along = sum(c.dot(p) for c, p in pairs)
        across = sum(c.y * p.x - c.x * p.y for c, p in pairs)
        shifted = translation.dot(Point2(sum(c.x for c in coefficients), sum(c.y for c in coefficients)))
        return shifted + cos(turn) * let("along", along) + sin(turn) * let("across", across) - constant


@dataclass(frozen=True)
class SetPointNwCDUnknown(Formula):
    """Shape of a group of points, known up to a rigid motion that is adjusted with it.

    Residual: `(X_k - xRef_k, Y_k - yRef_k)` for each point k, with `(X_k, Y_k)` the point after the motion.
    Defined everywhere. MMVII generates 3 and 4 points only.

    Attributes:
        number: How many points.
    """

    number: AtLeastOne
    pattern = "SetPointNwCD_RotUK{number}"

    source = SOURCE
    typical: ClassVar = {"teta": (0.0, 3.0), "points": (0.0, 10.0), "references": (0.0, 10.0)}

    def residual(
        self,
        translation: Translation,
        turn: Turn,
        points: GroupPoints,
        *,
        references: Annotated[Points2, "xRef_{}", "yRef_{}", "number"],
    ) -> list[Point2]:
        """The points moved, minus their references."""
        moved = rigid_motion(translation, turn, points)
        return [point - reference for point, reference in zip(moved, references, strict=True)]


@dataclass(frozen=True)
class SetPointNwCDFixed(Formula):
    """Shape of a group of points, known in its place: the rigid motion is given.

    Residual: `(X_k - xRef_k, Y_k - yRef_k)` for each point k, with `(X_k, Y_k)` the point after the motion.
    Defined everywhere. MMVII generates 4 points only.

    Attributes:
        number: How many points.
    """

    number: AtLeastOne
    pattern = "SetPointNwCD_RotFix{number}"

    source = SOURCE
    typical: ClassVar = {"teta": (0.0, 3.0), "points": (0.0, 10.0), "references": (0.0, 10.0)}

    def residual(
        self,
        points: GroupPoints,
        *,
        translation: Translation,
        turn: Turn,
        references: Annotated[Points2, "xRef_{}", "yRef_{}", "number"],
    ) -> list[Point2]:
        """The points moved, minus their references."""
        moved = rigid_motion(translation, turn, points)
        return [point - reference for point, reference in zip(moved, references, strict=True)]


def rigid_motion(translation: Point2, turn: Scalar, points: Sequence[Point2]) -> list[Point2]:
    """The points turned from x to y, then translated."""
    c, s = let("cosine", cos(turn)), let("sine", sin(turn))
    return [translation + Point2(c * p.x - s * p.y, s * p.x + c * p.y) for p in points]
