"""Clinometers: angles with the vertical, of a camera or in a block of instruments. Radians."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.errors import FormulaError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import (
    Angle,
    Direction,
    Matrix3,
    Point2,
    Point3,
    Pose,
    Rotation,
    Unit,
    Vector,
    norm,
)
from obseq.formulas.functions import Scalar, angle_difference, atan2, cos, let, sin


@dataclass(frozen=True)
class ClinoInBlock(Formula):
    """Clinometer of a block of instruments: inclination of its axis on the vertical, with a correction.

    Residual: `c . v - sum_k DCorrAng_k sin(ValueTeta)^k`, dimensionless (a sine), where `c = m1 (I -
    [Omega]x) N` is the axis of the clinometer in the world and `v` the vertical, both unit vectors `PNorm +
    du DirU + dv DirV`. The neutral correction is the sine itself: 1 for degree 1, 0 for the others. The
    centre of the block does not appear. Defined everywhere. MMVII generates the degrees 0 to 3 only.

    Attributes:
        first: Lowest degree of the correction.
        last: Highest degree of the correction.
    """

    first: int = 0
    last: int = 3

    pattern = "Clino_{first}_{last}"
    source = "MMVII Formulas_BlockRigid.h"
    typical: ClassVar = {"block.centre": (0.0, 10.0), "ValueTeta": (0.0, 1.0)}

    def __post_init__(self) -> None:
        """Raises FormulaError when the degrees are out of order, or too large."""
        super().__post_init__()
        if self.first > self.last:
            raise FormulaError(f"ClinoInBlock: first must be at most last, {self.last}, not {self.first}")

    @property
    def corrections(self) -> tuple[str, ...]:
        """Names of the coefficients of the correction."""
        return tuple(f"DCorrAng_{k}" for k in range(self.first, self.last + 1))

    def residual(
        self,
        block: Annotated[Pose, "Center", "Omega", "m1"],
        axis: Annotated[Direction, "DuDvClino", "Clino"],
        vertical: Annotated[Direction, "DuDvVert", "Vert"],
        correction: Annotated[Vector, "corrections"],
        *,
        angle: Annotated[Angle, "ValueTeta"],
    ) -> Scalar:
        """The sine of the inclination computed, minus the corrected sine of the angle observed."""
        inclination = let("inclination", (block.rotation @ axis).dot(vertical))
        sine = let("sine", sin(angle))
        corrected = sum(c * sine**k for k, c in enumerate(correction, self.first))
        return inclination - corrected


class ClinoBloc(Formula):
    """Clinometer fixed to a camera: angle of the vertical in the plane of the clinometer.

    Residual: `(v_x / n - cos C, v_y / n - sin C)`, dimensionless, with `v = B (R^T Vert)` the downward
    vertical in the frame of the clinometer, `n = sqrt(v_x^2 + v_y^2)`, `B = mB (I - [W1]x)` from camera to
    clinometer and `R = mR (I - [WA]x)` from camera to world. The angle C is counted from x towards y of the
    clinometer; the centre of the camera does not appear. Undefined where the vertical is the third axis of
    the clinometer.
    """

    source = "MMVII Formulas_ClinoBloc.h"
    observation_order = ("boresight", "vertical", "camera", "angle")
    typical: ClassVar = {"camera.centre": (0.0, 10.0), "angle": (0.0, 3.0), "vertical": (0.5, 0.4)}

    def residual(
        self,
        boresight: Annotated[Rotation, "W1", "mB"],
        camera: Annotated[Pose, "CA", "WA", "mR"],
        *,
        vertical: Annotated[Point3, "mVert_0_0", "mVert_0_1", "mVert_0_2", Unit("")],
        angle: Annotated[Angle, "C"],
    ) -> tuple[Scalar, Scalar]:
        """Cosine and sine of the angle computed, minus those of the angle observed."""
        down = let("down", boresight @ (camera.rotation.inverse() @ vertical))
        horizontal = let("horizontal", norm(Point2(down.x, down.y)))
        return down.x / horizontal - cos(angle), down.y / horizontal - sin(angle)


class ClinoNeedle(Formula):
    """Clinometer fixed to a camera, a pendulum: direction of the vertical in its plane, in one equation.

    Residual: `atan2(v_y, v_x) - C`, radians, wrapped, with the downward vertical `v = B (R^T Vert)` of
    `ClinoBloc`, whose two residuals are of one reading. Undefined where the vertical is the third axis of the
    clinometer.
    """

    source = "Definition"
    typical: ClassVar = {"angle": (0.0, 3.0), "vertical": (0.5, 0.4)}

    def residual(
        self,
        boresight: Annotated[Rotation, "W1", "mB"],
        rotation: Annotated[Rotation, "WA", "mR"],
        *,
        vertical: Annotated[Point3, "mVert_0_0", "mVert_0_1", "mVert_0_2", Unit("")],
        angle: Annotated[Angle, "C"],
    ) -> Scalar:
        """The angle computed, from x towards y of the clinometer, minus that observed."""
        down = let("down", boresight @ (rotation.inverse() @ vertical))
        return angle_difference(atan2(down.y, down.x), angle)


class ClinoRot(Formula):
    """Relative orientation of two clinometers of a camera, kept near its initial value.

    Residual: the nine entries, row by row, of `B2 B1^T - R0`, with `B = mB (I - [W]x)` the rotation from
    camera to clinometer. Defined everywhere.
    """

    source = "MMVII Formulas_ClinoRot.h"

    def residual(
        self,
        first: Annotated[Rotation, "W1", "mB1"],
        second: Annotated[Rotation, "W2", "mB2"],
        *,
        relative: Annotated[Matrix3, "mR0"],
    ) -> Matrix3:
        """The relative orientation computed, minus the initial one."""
        return second.matrix() @ first.inverse().matrix() - relative
