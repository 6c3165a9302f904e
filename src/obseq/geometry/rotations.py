"""Rotations of space: matrices, rotation vectors, and the small rotation of the adjustment.

A rotation matrix acts on column vectors. A rotation vector w turns by |w| radians about its own direction,
right-handed: a quarter turn about z takes x to y. Functions take one rotation, (3,) or (3, 3), or a batch.
"""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.errors import DegenerateGeometryError

RANK_TOLERANCE = 1e-13
TINY = np.finfo(np.float64).tiny
"""Radians: an angle that may be divided by and turns nothing."""
IDENTITY = np.eye(3)
GENERATORS = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]],
    dtype=np.float64,
)
"""(3, 9) the matrices [e]x of the three axes, row by row."""


def skew(w: npt.ArrayLike) -> FloatArray:
    """[w]x (..., 3, 3), with [w]x a = w x a."""
    vector = np.asarray(w, dtype=np.float64)
    matrices: FloatArray = (vector @ GENERATORS).reshape(*vector.shape, 3)
    return matrices


def exponential(w: npt.ArrayLike) -> FloatArray:
    """exp([w]x) (..., 3, 3): the rotation of a rotation vector (..., 3), radians.

    Rodrigues' formula, without cancellation at small angles.
    """
    vector = np.asarray(w, dtype=np.float64)
    length = np.sqrt(np.add.reduce(vector * vector, axis=-1))  # of `numpy.linalg.norm`, in half the time
    half = np.maximum(0.5 * length, TINY)[..., None, None]
    cross = skew(vector)
    first = np.sin(2.0 * half) / (2.0 * half)
    second = 0.5 * np.square(np.sin(half) / half)  # (1 - cos(angle)) / angle^2
    rotation: FloatArray = IDENTITY + first * cross + second * (cross @ cross)
    return rotation


def logarithm(rotation: npt.ArrayLike) -> FloatArray:
    """The rotation vector (..., 3), of at most half a turn, of rotation matrices (..., 3, 3).

    Inverse of `exponential`; as accurate near zero as near half a turn, where the sign is free.
    """
    quaternion = quaternion_of_rotation(np.asarray(rotation, dtype=np.float64))
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1, keepdims=True)
    half_angle = np.arctan2(sine, quaternion[..., :1])
    ratio = np.divide(half_angle, sine, out=np.ones_like(sine), where=sine > 0.0)
    vector: FloatArray = 2.0 * ratio * quaternion[..., 1:]
    return vector


def quaternion_of_rotation(rotation: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4), scalar first and not negative, of rotation matrices (..., 3, 3).

    The largest row of 4 q q^T, linear in the matrix, gives q without cancellation (Shepperd 1978).
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = np.moveaxis(rotation, (-2, -1), (0, 1))
    rows = (
        (1.0 + r00 + r11 + r22, r21 - r12, r02 - r20, r10 - r01),
        (r21 - r12, 1.0 + r00 - r11 - r22, r01 + r10, r02 + r20),
        (r02 - r20, r01 + r10, 1.0 - r00 + r11 - r22, r12 + r21),
        (r10 - r01, r02 + r20, r12 + r21, 1.0 - r00 - r11 + r22),
    )
    products = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    unit: FloatArray = row / np.linalg.norm(row, axis=-1, keepdims=True)
    return np.where(unit[..., :1] < 0.0, -unit, unit)


def absorb(rotation: npt.ArrayLike, w: npt.ArrayLike) -> FloatArray:
    """R0 exp(-[w]x) (..., 3, 3): the current rotation after a solution w (..., 3) of its small rotation.

    In the equations R = R0 (I - [w]x), with R0 from the local frame of the station or camera to the world.
    """
    turned: FloatArray = np.asarray(rotation, dtype=np.float64) @ exponential(
        -np.asarray(w, dtype=np.float64)
    )
    return turned


def rotation_x(angle: npt.ArrayLike) -> FloatArray:
    """Rotation (..., 3, 3) about the x axis, right-handed: y goes to z."""
    return _about(0, angle)


def rotation_y(angle: npt.ArrayLike) -> FloatArray:
    """Rotation (..., 3, 3) about the y axis, right-handed: z goes to x."""
    return _about(1, angle)


def rotation_z(angle: npt.ArrayLike) -> FloatArray:
    """Rotation (..., 3, 3) about the z axis, right-handed: x goes to y."""
    return _about(2, angle)


def _about(axis: int, angle: npt.ArrayLike) -> FloatArray:
    radians = np.asarray(angle, dtype=np.float64)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.zeros((*radians.shape, 3, 3))
    rotation[..., axis, axis] = 1.0
    rotation[..., first, first] = rotation[..., second, second] = np.cos(radians)
    rotation[..., second, first] = np.sin(radians)
    rotation[..., first, second] = -np.sin(radians)
    return rotation


def closest_rotation(matrix: npt.ArrayLike) -> FloatArray:
    """The rotation matrix (..., 3, 3) closest to a matrix, by the sum of squares of the differences.

    Raises:
        DegenerateGeometryError: several rotations are as close; a matrix that mirrors is told as that.
    """
    left, values, right = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    sign = np.where(np.linalg.det(left @ right) < 0.0, -1.0, 1.0)
    unclear = values[..., 1] + sign * values[..., 2] <= RANK_TOLERANCE * values[..., 0]
    if np.any(unclear & (values[..., 2] > RANK_TOLERANCE * values[..., 0])):
        raise DegenerateGeometryError(
            "A matrix mirrors (its determinant is negative), and several rotations are equally close to it: "
            "one of its axes, or all three, point the wrong way."
        )
    if np.any(unclear):
        raise DegenerateGeometryError(
            "Several rotations are equally close to this matrix; its rank is too low."
        )
    left[..., :, 2] *= sign[..., None]
    closest: FloatArray = left @ right
    return closest
