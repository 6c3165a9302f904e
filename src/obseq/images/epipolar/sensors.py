"""What an epipolar residual needs of a sensor: its rays, and its projection, in one Euclidean frame."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion
from obseq.images.camera import Camera

ORTHONORMAL = 1e-6
"""How far a rotation of a file may be from orthonormal."""


class Sensor(Protocol):
    """An oriented image."""

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A point (n, 3) of each line of sight; its unit direction (n, 3) from the sensor to the scene."""

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3); nan where the sensor does not see."""


@dataclass(frozen=True)
class Pinhole:
    """A camera without distortion.

    Attributes:
        centre: (3,) projection centre.
        rotation: (3, 3) from the frame to image axes: x right, y down, z forward.
        focal: pixels.
        principal_point: (2,) pixels.
    """

    centre: FloatArray
    rotation: FloatArray
    focal: float
    principal_point: FloatArray

    def __post_init__(self) -> None:
        turn = np.asarray(self.rotation)
        if turn.shape != (3, 3) or np.abs(turn @ turn.T - np.eye(3)).max() > ORTHONORMAL:
            raise InputError("camera: its rotation is not a 3 x 3 matrix with orthonormal rows.")
        if not (np.isfinite(self.focal) and self.focal > 0.0):
            raise InputError(f"camera: its focal {self.focal} must be positive.")

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The centre, and unit directions (n, 3) to the scene, of pixels (n, 2)."""
        inner = np.column_stack([pixels - self.principal_point, np.full(len(pixels), self.focal)])
        directions = inner @ self.rotation
        length = np.sqrt((directions**2).sum(axis=1, keepdims=True))
        return np.broadcast_to(self.centre, directions.shape), directions / length

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3); nan behind the camera."""
        sight = (points - self.centre) @ self.rotation.T
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = np.where(sight[:, 2:] > 0.0, sight[:, 2:], np.nan)
            return np.asarray(self.principal_point + self.focal * sight[:, :2] / depth)


@dataclass(frozen=True)
class OrientedCamera:
    """A camera of any model, with its pose.

    Attributes:
        camera: projection and distortion.
        pose: camera to world.
    """

    camera: Camera
    pose: RigidMotion

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The centre, and unit directions (n, 3) to the scene, of pixels (n, 2)."""
        directions = self.camera.directions(pixels) @ self.pose.rotation.T
        return np.broadcast_to(self.pose.centre, directions.shape), directions

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3); nan where the projection is not defined."""
        local = self.pose.to_local(points)
        pixels = self.camera.project(local)
        pixels[~self.camera.is_in_front(local)] = np.nan
        return pixels
