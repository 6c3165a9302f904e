"""Rotations, poses and rigid motions, with numpy only."""

from obseq.arrays import FloatArray
from obseq.errors import DegenerateGeometryError
from obseq.geometry.attitudes import FORMS, attitude_jacobian, attitudes, rotations_from
from obseq.geometry.isometry import isometry, similarity
from obseq.geometry.matrices import inverse3, sums_by_owner
from obseq.geometry.poses import RigidMotion
from obseq.geometry.rotations import (
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
    "FORMS",
    "DegenerateGeometryError",
    "FloatArray",
    "RigidMotion",
    "absorb",
    "attitude_jacobian",
    "attitudes",
    "closest_rotation",
    "exponential",
    "inverse3",
    "isometry",
    "logarithm",
    "rotation_x",
    "rotation_y",
    "rotation_z",
    "rotations_from",
    "similarity",
    "skew",
    "sums_by_owner",
]
