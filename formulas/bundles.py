"""Elementary bundle adjustment of two or three images, on directions observed in each camera.

The frame is that of the first camera; camera k has the pose X = C_k + R_k x. The second camera is at the end
of a base of unit length, and its direction is the unknown; the others have a free centre. Directions need not
be unit vectors, unless said.
"""

from dataclasses import dataclass
from typing import Annotated

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Direction, Point3, Rotation, norm
from obseq.formulas.functions import Scalar, let
from obseq.formulas.naming import OneOf

SOURCE = "MMVII Formulas_CalibBundles.h"
IN_FRONT = {"PGround_z": (5.0, 1.0)}

Ground = Annotated[Point3, "PGround"]
BaseDirection = Annotated[Direction, "DuDv2", "Base"]
Turning = Annotated[Rotation, "Omega", "Rot"]
Bundle = Annotated[Point3, "Bundle"]

MODES = ("Angle", "Product")


@dataclass(frozen=True)
class PointOnBundle:
    """How the distance of a point to a ray is measured.

    Attributes:
        mode: `Product`: `d ^ v`, with d the direction of the ray and v the vector from camera to point;
            `Angle`: `(d ^ v)/(d . v)`, the tangent of their angle along its axis, undefined at a right angle.
    """

    mode: Annotated[str, OneOf({mode: mode for mode in MODES})]

    def distance(self, direction: Point3, sight: Point3) -> Point3:
        """Three components, of rank 2: the one along the ray is 0."""
        direction, sight = let("direction", direction), let("sight", sight)
        product = direction.cross(sight)
        if self.mode == "Product":
            return product
        scale = 1 / direction.dot(sight)
        return Point3(scale * product.x, scale * product.y, scale * product.z)

    @property
    def outputs(self) -> tuple[str, ...]:
        """The components of the distance."""
        return ("x", "y", "z")


@dataclass(frozen=True)
class PointOnFirstBundle(PointOnBundle, Formula):
    """Point on a ray of the first camera, which is at the origin.

    Residual: `d ^ v` or `(d ^ v)/(d . v)` with `d = Bundle`, `v = PGround`. Undefined, in mode
    `Angle`, when they are at a right angle.
    """

    pattern = "BunleElem_Cam1_{mode}"
    source = SOURCE
    typical = {**IN_FRONT, "Bundle_z": (1.0, 0.1)}

    def residual(self, point: Ground, *, bundle: Bundle) -> Point3:
        """The distance of the point to the ray."""
        return self.distance(bundle, point)


@dataclass(frozen=True)
class PointOnSecondBundle(PointOnBundle, Formula):
    """Point on a ray of the second camera, at the end of a base of unit length.

    Residual: `d ^ v` or `(d ^ v)/(d . v)` with `d = Rot (I - [Omega]x) Bundle` and `v = PGround - B`, where B
    is the direction of the base. Undefined, in mode `Angle`, when they are at a right angle.
    """

    pattern = "BunleElem_Cam2_{mode}"
    observation_order = ("bundle", "base", "rotation")
    source = SOURCE
    typical = {**IN_FRONT, "Bundle_z": (1.0, 0.1)}

    def residual(self, point: Ground, base: BaseDirection, rotation: Turning, *, bundle: Bundle) -> Point3:
        """The distance of the point to the ray."""
        return self.distance(rotation @ bundle, point - base)


@dataclass(frozen=True)
class PointOnOtherBundle(PointOnBundle, Formula):
    """Point on a ray of any camera from the third on.

    Residual: `d ^ v` or `(d ^ v)/(d . v)` with `d = Rot (I - [Omega]x) Bundle` and `v = PGround - Base`.
    Undefined, in mode `Angle`, when they are at a right angle.
    """

    pattern = "BunleElem_Cam3_{mode}"
    observation_order = ("bundle", "rotation")
    source = SOURCE
    typical = {**IN_FRONT, "Bundle_z": (1.0, 0.1)}

    def residual(
        self, point: Ground, centre: Annotated[Point3, "Base"], rotation: Turning, *, bundle: Bundle
    ) -> Point3:
        """The distance of the point to the ray."""
        return self.distance(rotation @ bundle, point - centre)


class Coplanarity(Formula):
    """Two rays and the base in one plane: their determinant.

    Residual: `B . (u_1 ^ u_2)` with `u_1 = Bund1`, `u_2 = Rot (I - [Omega]x) Bund2`. Defined everywhere.
    """

    pattern = "BunleElem_Det12"
    observation_order = ("first", "second", "base", "rotation")
    source = SOURCE

    @property
    def outputs(self) -> tuple[str, ...]:
        """The determinant."""
        return ("det",)

    def residual(
        self,
        base: BaseDirection,
        rotation: Turning,
        *,
        first: Annotated[Point3, "Bund1"],
        second: Annotated[Point3, "Bund2"],
    ) -> Scalar:
        """The determinant of the base and of both rays."""
        return base.dot(first.cross(rotation @ second))


class BundleDistance(Formula):
    """Distance of two rays, for a base of unit length.

    Residual: `c = B . (u_1 ^ u_2)/|u_1 ^ u_2|`, of the sign of the determinant, with `u_1 = Bund1`,
    `u_2 = Rot (I - [Omega]x) Bund2`. Undefined for parallel rays.
    """

    pattern = "BunleElem_Dist12"
    observation_order = ("first", "second", "base", "rotation")
    source = SOURCE

    @property
    def outputs(self) -> tuple[str, ...]:
        """The distance."""
        return ("distance",)

    def residual(
        self,
        base: BaseDirection,
        rotation: Turning,
        *,
        first: Annotated[Point3, "Bund1"],
        second: Annotated[Point3, "Bund2"],
    ) -> Scalar:
        """The distance of the rays, in bases."""
        normal = let("normal", first.cross(rotation @ second))
        return base.dot(normal) / norm(normal)


class BundleAngles(Formula):
    """Distance of two rays, seen from each camera.

    Residual: `(c/a, c/b)`, tangents of angles, with `B = a u_1 + b u_2 + c n/|n|`, `n = u_1 ^ u_2`,
    `u_1 = Bund1`, `u_2 = Rot (I - [Omega]x) Bund2`; Bund1 and Bund2 must be unit vectors. Since b is counted
    from the end of the base, it is negative for a point in front of both cameras. Undefined for parallel rays
    and for a ray along the base.
    """

    pattern = "BunleElem_Ang12"
    observation_order = ("first", "second", "base", "rotation")
    source = SOURCE

    @property
    def outputs(self) -> tuple[str, ...]:
        """The angles at the first and at the second camera."""
        return ("first", "second")

    def residual(
        self,
        base: BaseDirection,
        rotation: Turning,
        *,
        first: Annotated[Point3, "Bund1"],
        second: Annotated[Point3, "Bund2"],
    ) -> tuple[Scalar, Scalar]:
        """The distance of the rays over the distances along them."""
        turned = let("turned", rotation @ second)
        normal = let("normal", first.cross(turned))
        cosine, along_first, along_second = first.dot(turned), base.dot(first), base.dot(turned)
        # c and a, b times the squared sine of the angle of the rays, which is 1 - cosine^2 for unit vectors.
        distance = base.dot(normal) / norm(normal) * (1 - cosine * cosine)
        return distance / (along_first - cosine * along_second), distance / (
            along_second - cosine * along_first
        )


BUNDLES: tuple[Formula, ...] = (
    *(PointOnFirstBundle(mode) for mode in MODES),
    *(PointOnSecondBundle(mode) for mode in MODES),
    *(PointOnOtherBundle(mode) for mode in MODES),
    Coplanarity(),
    BundleDistance(),
    BundleAngles(),
)
