"""Cameras that fly: the antenna of a receiver beside the camera, and a shutter that rolls.

The camera frame is that of colinearity: x right, y down, z forward. Metres, pixels, seconds.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number, Pixel, Point2, Point3, Pose
from obseq.formulas.colinearity import (
    IN_FRONT,
    IN_IMAGE,
    INTERNAL,
    Calibration,
    Camera,
    CentralCamera,
    Ground,
)
from obseq.formulas.distortion import Degree
from obseq.formulas.functions import let
from obseq.formulas.projections import Stenope


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
