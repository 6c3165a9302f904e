"""Cameras whose distortion corrects the point measured, instead of moving the point computed.

The "backward" or photogrammetric models (Brown's, as DBAT, PhotoModeler or Australis write it):

    q' = (Im - PP)/F                 dimensionless, then (1 + b1) x + b2 y instead of x
    q  = q' + q' sum_n K_n s^n + decentric terms, all at q'
    F projection(P) = F q            pixels, in the plane without distortion

The terms and the names of the parameters are those of `distortion`, but that the affine ones (b1, b2) come
first, and the other terms see the point that they have corrected.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from obseq.errors import FormulaError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Point2, Vector
from obseq.formulas.colinearity import (
    FOCAL_AND_PRINCIPAL_POINT,
    IN_FRONT,
    IN_IMAGE,
    INTERNAL,
    Calibration,
    Camera,
    Ground,
)
from obseq.formulas.distortion import Degree
from obseq.formulas.functions import Scalar, let
from obseq.formulas.naming import Patterned
from obseq.formulas.projections import AnyProjection, Stenope

SOURCE = "DBAT, lens distortion model 3 (backward Brown)"


@dataclass(frozen=True)
class Backward(Patterned):
    """What the equations of such a camera have in common: the degrees of the correction."""

    degree: Degree

    def __post_init__(self) -> None:
        """Raises FormulaError when the correction has general terms beyond b1 and b2."""
        super().__post_init__()
        if self.degree.polynomial > 1 or not self.degree.fraser:
            raise FormulaError(
                f"{type(self).__name__}: of the general terms there are b1 and b2, not {self.degree.name}"
            )

    def correct(self, measured: Point2, parameters: Sequence[Scalar]) -> Point2:
        """The point without distortion, both dimensionless."""
        inner = Degree(self.degree.radial, self.degree.decentric)
        split = len(inner.parameters)
        if self.degree.polynomial:
            b1, b2 = parameters[split:]
            measured = Point2(measured.x + b1 * measured.x + b2 * measured.y, measured.y)
        return inner.distort(measured, parameters[:split])


@dataclass(frozen=True)
class BackwardDistortion(Backward, Formula):
    """Correction of a measured point as a map of the plane: the point without distortion, not a residual.

    Value: `(x, y)` of the module, at `(xPi, yPi)`; dimensionless. Defined everywhere.
    """

    pattern = "EqDist_Backward_{degree}"
    source = SOURCE
    typical = {"point": (0.0, 0.7), "parameters": (0.0, 0.1)}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The components of the corrected point."""
        return ("x", "y")

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.degree.parameters

    def residual(
        self, point: Annotated[Point2, "xPi", "yPi"], *, parameters: Annotated[Vector, "parameters"]
    ) -> Point2:
        """The corrected point."""
        return self.correct(point, parameters)


@dataclass(frozen=True)
class BackwardColinearity(Backward, Formula):
    """Image of a ground point, in a camera whose distortion corrects the measure.

    Residual: `F (projection((I + [W]x) M (PGround - CCam)) - corrected((Im - PP)/F))`, in pixels. Undefined
    where the projection is; nothing tells a point in front from one behind.
    """

    projection: AnyProjection

    pattern = "EqColinearityCamPPC_{projection}_Backward_{degree}"
    observation_order = ("image", "camera")
    source = SOURCE
    typical = {**INTERNAL, "PGround_z": IN_FRONT, "Im_x": IN_IMAGE, "Im_y": IN_IMAGE}

    @property
    def calibration(self) -> tuple[str, ...]:
        """Names of the internal unknowns: focal length, principal point, correction."""
        return (*FOCAL_AND_PRINCIPAL_POINT, *self.degree.parameters)

    def residual(
        self, point: Ground, camera: Camera, calibration: Calibration, *, image: Annotated[Point2, "Im"]
    ) -> Point2:
        """The image computed, minus the image observed and corrected (pixels)."""
        focal, x, y, *parameters = calibration
        measured = let("measured", Point2((image.x - x) / focal, (image.y - y) / focal))
        corrected = let("corrected", self.correct(measured, parameters))
        computed = let("image", self.projection.direct(let("point", camera.inverse() @ point)))
        residual: Point2 = focal * (computed - corrected)
        return residual


DEGREES = (Degree(3, 1, 0), Degree(3, 1, 1))

BACKWARD: tuple[Formula, ...] = (
    *(BackwardDistortion(degree) for degree in DEGREES),
    *(BackwardColinearity(degree, Stenope()) for degree in DEGREES),
)
"""Brown's model without and with the affine terms."""
