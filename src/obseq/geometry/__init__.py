"""Rotations, poses and rigid motions, with numpy only."""

from obseq.arrays import FloatArray
from obseq.geometry.isometry import isometry, triangle_isometry
from obseq.geometry.poses import Pose
from obseq.geometry.rotations import (
    DegenerateGeometryError,
    absorb,
    closest_rotation,
    exponential,
    logarithm,
    rotation_x,
    rotation_y,
    rotation_z,
    skew,
)

__all__ = [
    "DegenerateGeometryError",
    "FloatArray",
    "Pose",
    "absorb",
    "closest_rotation",
    "exponential",
    "isometry",
    "logarithm",
    "rotation_x",
    "rotation_y",
    "rotation_z",
    "skew",
    "triangle_isometry",
]
