"""Colinearity: the image of a ground point, or of a point of a ground line, in a camera with distortion.

    P = (I + [W]x) M (X - C)         camera frame, M the current world to camera matrix (context)
    q = projection(P)                dimensionless
    q' = distortion(q)
    pixel = PP + F q'                one focal length; PP and F in pixels

The camera is the pose of its frame in the world: centre C, rotation from camera to world. The derivative with
respect to F is the distorted point q'; that of MMVII's engine is wrong in fourteen of these formulas.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import WORLD_TO_LOCAL, Number, Pixel, Point2, Point3, Pose, Vector, norm
from obseq.formulas.distortion import CAMERA, FRASER, NOT_FRASER, Degree
from obseq.formulas.functions import Scalar, let
from obseq.formulas.projections import AnyProjection, EquiRect, FE_EquiDist, Stenope

Ground = Annotated[Point3, "PGround"]
Camera = Annotated[Pose, "CCam", "W", "M", WORLD_TO_LOCAL]
Calibration = Annotated[Vector, "calibration"]

FOCAL_AND_PRINCIPAL_POINT = ("F_", "PPx_", "PPy_")
INTERNAL = {
    "calibration": (0.0, 0.05),
    "F_": (3000.0, 500.0),
    "PPx_": (2000.0, 100.0),
    "PPy_": (1500.0, 100.0),
}
IN_IMAGE = (2000.0, 1000.0)
IN_FRONT = (5.0, 1.0)


@dataclass(frozen=True)
class CentralCamera:
    """What a family of colinearity equations is about: a projection and the degrees of a distortion."""

    projection: AnyProjection
    degree: Degree

    @property
    def calibration(self) -> tuple[str, ...]:
        """Names of the internal unknowns: focal length, principal point, distortion."""
        return (*FOCAL_AND_PRINCIPAL_POINT, *self.degree.parameters)

    def pixel(self, point: Point3, camera: Pose, calibration: Sequence[Scalar]) -> Point2:
        """The image of a ground point, in pixels."""
        focal, x, y, *distortion = calibration
        image = let("image", self.projection.direct(let("point", camera.inverse() @ point)))
        distorted = let("distorted", self.degree.distort(image, distortion))
        return Point2(x + focal * distorted.x, y + focal * distorted.y)


@dataclass(frozen=True)
class Colinearity(CentralCamera, Formula):
    """Image of a ground point.

    Residual: `PP + F distortion(projection((I + [W]x) M (PGround - CCam))) - Im`, in pixels. Undefined where
    the projection is: for `Stenope` in the plane of the centre parallel to the image. Nothing tells a point
    in front from one behind. `EquiRect`: differences of columns are not brought to one turn.
    """

    pattern = "EqColinearityCamPPC_{projection}_Dist_{degree}"
    observation_order = ("image", "camera")
    source = CAMERA
    typical = {**INTERNAL, "PGround_z": IN_FRONT, "Im_x": IN_IMAGE, "Im_y": IN_IMAGE}

    def residual(
        self, point: Ground, camera: Camera, calibration: Calibration, *, image: Annotated[Point2, "Im"]
    ) -> Point2:
        """The image computed, minus the image observed (pixels)."""
        return self.pixel(point, camera, calibration) - image


@dataclass(frozen=True)
class LineColinearity(CentralCamera, Formula):
    """A point of a ground line projects on a curve of the image.

    The line goes through `Q1 = Pt1 + a_x Norm_x + a_y Norm_y` and `Q2 = Pt2 + b_x Norm_x + b_y Norm_y`, with
    the unknowns a (`N1Coords`) and b (`N2Coords`); the point is `(1 - Lambda) Q1 + Lambda Q2`.
    Residual: `Line2D_Norm . (pixel - Line2D_Pt)`, in pixels for a unit normal. Undefined where `Colinearity`
    is.
    """

    pattern = "EqLineProjCamPPC_{projection}_Dist_{degree}"
    observation_order = (
        "image_point",
        "image_normal",
        "line_start",
        "line_end",
        "normal_x",
        "normal_y",
        "abscissa",
        "camera",
    )
    source = CAMERA
    typical = {
        **INTERNAL,
        "image_point": IN_IMAGE,
        "Line3d_Pt1_z": IN_FRONT,
        "Line3d_Pt2_z": IN_FRONT,
        "abscissa": (0.5, 0.5),
    }

    def residual(
        self,
        start: Annotated[Point2, "N1Coords"],
        end: Annotated[Point2, "N2Coords"],
        camera: Camera,
        calibration: Calibration,
        *,
        image_point: Annotated[Point2, "Line2D_Pt"],
        image_normal: Annotated[Point2, "Line2D_Norm"],
        line_start: Annotated[Point3, "Line3d_Pt1"],
        line_end: Annotated[Point3, "Line3d_Pt2"],
        normal_x: Annotated[Point3, "Line3d_Norm_x"],
        normal_y: Annotated[Point3, "Line3d_Norm_y"],
        abscissa: Annotated[Number, "Line3d_Lambda"],
    ) -> Scalar:
        """Distance of the image computed from the image line, positive on the side of its normal (pixels)."""
        across = start + abscissa * (end - start)
        along = line_start + abscissa * (line_end - line_start)
        point = let("ground", along + across.x * normal_x + across.y * normal_y)
        return image_normal.dot(self.pixel(point, camera, calibration) - image_point)


class ColinearityOnDirection(Formula):
    """Image of a ground point in a perfect pinhole camera, dimensionless.

    Residual: `(X, Y)/Z - Bundle` of the point in the camera frame. Undefined for Z = 0.
    """

    pattern = "cFormula_EqColinearityCamProj"
    observation_order = ("image", "camera")
    source = CAMERA
    typical = {"PGround_z": IN_FRONT}

    def residual(self, point: Ground, camera: Camera, *, image: Annotated[Point2, "Bundle"]) -> Point2:
        """The image computed, minus the image observed."""
        return Stenope().direct(let("point", camera.inverse() @ point)) - image


class ColinearityOnBundle(Formula):
    """Angular distance of a ground point to an observed ray, in any central camera.

    Residual: `focal (P . u)/(|P| |u|)` and the same with v, where P is the point in the camera frame and u, v
    are orthogonal to the ray there: in pixels for a focal length in pixels. Undefined at the camera's centre.
    """

    pattern = "cFormula_EqColinearityOnBundle"
    observation_order = ("u", "v", "focal", "camera")
    source = CAMERA
    typical = {"PGround_z": IN_FRONT}

    def residual(
        self, point: Ground, camera: Camera, *, u: Point3, v: Point3, focal: Annotated[Pixel, "focal"]
    ) -> Point2:
        """The components of the unit vector to the point along u and v, times the focal length (pixels)."""
        direction = let("point", camera.inverse() @ point)
        scale = focal / norm(direction)
        return Point2(scale * (direction.dot(u) / norm(u)), scale * (direction.dot(v) / norm(v)))


FISH_EYE = (
    Degree(3, 1, 1),
    Degree(3, 1, 5),
    Degree(5, 1, 1),
    Degree(5, 1, 5),
    Degree(5, 2, 2),
    Degree(7, 2, 5),
)
"""Degrees that MMVII generates for the equidistant fish-eye."""

COLINEARITIES: tuple[Formula, ...] = (
    *(Colinearity(Stenope(), degree) for degree in (*FRASER, *NOT_FRASER)),
    *(Colinearity(FE_EquiDist(), degree) for degree in FISH_EYE),
    Colinearity(EquiRect(), Degree(0, 0, 0)),
    *(LineColinearity(Stenope(), degree) for degree in FRASER),
    ColinearityOnDirection(),
    ColinearityOnBundle(),
)


class AntennaPosition(Formula):
    """Position of the antenna of a receiver that the camera carries.

    Residual: `CCam + R Lever - GPS` (m), with R from camera to world and the lever arm in the camera frame.
    Defined everywhere.
    """

    source = "Definition"
    typical: ClassVar = {"camera.centre": (0.0, 10.0), "position": (0.0, 10.0)}

    def residual(
        self,
        camera: Camera,
        lever: Annotated[Point3, "Lever"],
        *,
        position: Annotated[Point3, "GPS"],
    ) -> Point3:
        """The antenna computed, minus the antenna observed (m)."""
        return camera @ lever - position

    @property
    def outputs(self) -> tuple[str, ...]:
        """The observed coordinates."""
        return ("GPS_x", "GPS_y", "GPS_z")


@dataclass(frozen=True)
class RollingColinearity(CentralCamera, Formula):
    """Image of a ground point in a camera whose lines are exposed one after the other while it moves.

    The pose is that of the middle line. Line y is exposed `t = Readout (y / Height - 1/2)` later (s), from
    `CCam + t V`: V is the velocity in the world (m/s), and the turn of the camera during the readout is
    neglected. y is the line computed, by two steps from the middle line on: the observed one has errors,
    those of the residual, and would pull the readout. The steps leave the square of the share of the image by
    which the camera moves meanwhile: 1e-5 of a pixel for drones.
    Residual: that of `Colinearity` from there, in pixels. Undefined where that is.
    """

    pattern = "EqColinearityRolling_{projection}_Dist_{degree}"
    observation_order = ("image", "velocity", "height", "camera")
    source = "Definition"
    typical = {
        **INTERNAL,
        "PGround_z": IN_FRONT,
        "Im_x": IN_IMAGE,
        "Im_y": IN_IMAGE,
        "Height": (3000.0, 500.0),
        "Readout": (0.03, 0.01),
    }

    def residual(
        self,
        point: Ground,
        camera: Camera,
        calibration: Calibration,
        readout: Annotated[Number, "Readout"],
        *,
        image: Annotated[Point2, "Im"],
        velocity: Annotated[Point3, "V"],
        height: Annotated[Pixel, "Height"],
    ) -> Point2:
        """The image computed, minus the image observed (pixels)."""
        found = self.pixel(point, camera, calibration)
        for step in ("first", "second"):
            later = let(f"{step}_later", readout * (found.y / height - 0.5))
            moved = Pose(camera.centre + later * velocity, camera.rotation)
            found = self.pixel(point, moved, calibration)
        return found - image


DRONE: tuple[Formula, ...] = (AntennaPosition(), RollingColinearity(Stenope(), Degree(3, 1, 1)))
