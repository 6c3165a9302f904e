"""Central projections: points of the camera frame to dimensionless image coordinates, and back to directions.

The camera looks along +Z. With `s = X^2 + Y^2`, `r = sqrt(s)`, `R = |P|` and the angle t from the axis, a
point P = (X, Y, Z) goes to (u, v), at the distance rho from (0, 0); all but `EquiRect` are radial:

| projection | (u, v) | rho |
|---|---|---|
| `Stenope` | (X, Y) / Z | tan t |
| `FE_EquiDist` | (X, Y) atan2(r, Z)/r | t |
| `StereroGraphik` | 2 (X, Y) / (R + Z) | 2 tan(t/2) |
| `OrthoGraphik` | (X, Y) / R | sin t |
| `FE_EquiSolid` | 2 (X, Y) / sqrt(2 R (R + Z)) | 2 sin(t/2) |
| `EquiRect` | (atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2))) | |

The equations are written in smooth functions of s, so that values and derivatives are exact on the optical
axis, where r itself has no derivative (MMVII's are not numbers there), and in the cone around the backward
axis (where MMVII's FE_EquiDist is wrong). The names are MMVII's, spelling included.
"""

from dataclasses import dataclass
from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Point2, Point3
from obseq.formulas.functions import (
    Scalar,
    angle_ratio,
    atan2,
    axial_sum,
    cos,
    cos_sqrt,
    sin,
    sinc_sqrt,
    sqrt,
)
from obseq.formulas.naming import OneOf

SOURCE = "MMVII Formulas_CentralProj.h"


@dataclass(frozen=True)
class Projection:
    """A central projection; `direct` takes any point of a ray, `inverse` gives a direction."""

    @property
    def name(self) -> str:
        """MMVII's name."""
        return type(self).__name__

    def direct(self, point: Point3) -> Point2:
        """Image coordinates of a point of the camera frame."""
        raise NotImplementedError

    def inverse(self, image: Point2) -> Point3:
        """A direction of the camera frame, from image coordinates."""
        raise NotImplementedError


class Stenope(Projection):
    """Perspective, a pinhole. Undefined for Z = 0; a point behind gives the image of its opposite."""

    def direct(self, point: Point3) -> Point2:
        """(X, Y)/Z."""
        return Point2(point.x / point.z, point.y / point.z)

    def inverse(self, image: Point2) -> Point3:
        """(u, v, 1), which is not a unit vector."""
        return Point3(image.x, image.y, 1)


class FE_EquiDist(Projection):  # noqa: N801  (MMVII's name)
    """Equidistant fish-eye. Undefined on the backward axis, exact in the cone around it."""

    def direct(self, point: Point3) -> Point2:
        """(X, Y) times the angle from the axis over the distance to it."""
        scale = angle_ratio(_axial_square(point), point.z)
        return Point2(scale * point.x, scale * point.y)

    def inverse(self, image: Point2) -> Point3:
        """(u sinc(rho), v sinc(rho), cos(rho)), a unit vector."""
        s = image.dot(image)
        sine = sinc_sqrt(s)
        return Point3(image.x * sine, image.y * sine, cos_sqrt(s))


class StereroGraphik(Projection):
    """Stereographic. Undefined on the backward axis, exact in the cone around it."""

    def direct(self, point: Point3) -> Point2:
        """2 (X, Y)/(R + Z)."""
        scale = 2 / axial_sum(_axial_square(point), point.z)
        return Point2(scale * point.x, scale * point.y)

    def inverse(self, image: Point2) -> Point3:
        """(u, v, 2 - D)/D with D = 1 + rho^2/4, a unit vector."""
        scale = 1 / (1 + 0.25 * image.dot(image))
        return Point3(image.x * scale, image.y * scale, 2 * scale - 1)


class OrthoGraphik(Projection):
    """Orthographic, of the front half-space: a point behind gives the image of its mirror.

    The inverse is not a number for rho > 1, and has no derivative at 1.
    """

    def direct(self, point: Point3) -> Point2:
        """(X, Y)/R."""
        scale = 1 / sqrt(_axial_square(point) + point.z * point.z)
        return Point2(scale * point.x, scale * point.y)

    def inverse(self, image: Point2) -> Point3:
        """(u, v, sqrt(1 - rho^2)), a unit vector."""
        return Point3(image.x, image.y, sqrt(1 - image.dot(image)))


class FE_EquiSolid(Projection):  # noqa: N801  (MMVII's name)
    """Equisolid fish-eye. Undefined on the backward axis; the inverse is not a number for rho > 2."""

    def direct(self, point: Point3) -> Point2:
        """2 (X, Y)/sqrt(2 R (R + Z))."""
        s = _axial_square(point)
        scale = 2 / sqrt(2 * sqrt(s + point.z * point.z) * axial_sum(s, point.z))
        return Point2(scale * point.x, scale * point.y)

    def inverse(self, image: Point2) -> Point3:
        """(u cos(t/2), v cos(t/2), cos t) with sin(t/2) = rho/2, a unit vector."""
        quarter = 0.25 * image.dot(image)
        cosine = sqrt(1 - quarter)
        return Point3(image.x * cosine, image.y * cosine, 1 - 2 * quarter)


class EquiRect(Projection):
    """Equirectangular: longitude and latitude, Y upwards along the axis of the sphere.

    Undefined on the Y axis; jumps by a turn across X = 0, Z < 0.
    """

    def direct(self, point: Point3) -> Point2:
        """(atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2))); MMVII writes asin(Y/R), less precise near the Y axis."""
        horizontal = sqrt(point.x * point.x + point.z * point.z)
        return Point2(atan2(point.x, point.z), atan2(point.y, horizontal))

    def inverse(self, image: Point2) -> Point3:
        """(cos v sin u, sin v, cos v cos u), a unit vector."""
        horizontal = cos(image.y)
        return Point3(horizontal * sin(image.x), sin(image.y), horizontal * cos(image.x))


def _axial_square(point: Point3) -> Scalar:
    """Squared distance to the optical axis."""
    return point.x * point.x + point.y * point.y


PROJECTIONS = {
    projection.name: projection
    for projection in (
        Stenope(),
        FE_EquiDist(),
        StereroGraphik(),
        OrthoGraphik(),
        FE_EquiSolid(),
        EquiRect(),
    )
}
"""The projections by name."""

AnyProjection = Annotated[Projection, OneOf(PROJECTIONS)]


@dataclass(frozen=True)
class Direct(Formula):
    """Central projection: dimensionless image coordinates of a point of the camera frame, not a residual.

    Value: `(u, v)` of the module. Undefined where the projection is: see its class.
    """

    projection: AnyProjection
    pattern = "Dir_{projection}"
    source = SOURCE
    typical = {"PtZ": (3.0, 1.0)}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The image coordinates."""
        return ("u", "v")

    def residual(self, point: Annotated[Point3, "PtX", "PtY", "PtZ"]) -> Point2:
        """The image coordinates."""
        return self.projection.direct(point)


@dataclass(frozen=True)
class Inverse(Formula):
    """Inverse of a central projection: a direction of the camera frame, not a residual.

    Value: `(X, Y, Z)` from dimensionless image coordinates; a unit vector, but for `Stenope` (Z = 1).
    Undefined where the projection is: see its class.
    """

    projection: AnyProjection
    pattern = "Inv_{projection}"
    source = SOURCE
    typical = {"image": (0.0, 0.6)}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The components of the direction."""
        return ("x", "y", "z")

    def residual(self, image: Annotated[Point2, "PixI", "PixJ"]) -> Point3:
        """The direction."""
        return self.projection.inverse(image)


CENTRAL_PROJECTIONS: tuple[Formula, ...] = tuple(
    family(projection) for projection in PROJECTIONS.values() for family in (Direct, Inverse)
)
