"""Rotations written as quaternions or three angles, and what a small rotation makes of the angles.

| form | values | rotation R from the local frame to the world |
|---|---|---|
| `matrix` | 3 by 3 | itself |
| `quaternion` | w, x, y, z | scalar first, of any length but zero |
| `opk` | omega, phi, kappa | R = Rx Ry Rz diag(1, -1, -1): photogrammetry, camera y up, z backwards |
| `wpk` | omega, phi, kappa | R = Rx Ry Rz: MMVII, camera y down, z forward |
| `ypr` | yaw, pitch, roll | R = Rz Ry Rx: MMVII |

Angles are in radians. Rx, Ry, Rz turn right-handed about their axes by the angle that stands for them: omega,
phi, kappa; roll, pitch, yaw.
"""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import DegenerateGeometryError, InputError
from obseq.geometry.matrices import inverse3
from obseq.geometry.rotations import (
    closest_rotation,
    quaternion_of_rotation,
    rotation_x,
    rotation_y,
    rotation_z,
)

TURNS = (rotation_x, rotation_y, rotation_z)
ORTHOGONAL = 1e-6
"""A matrix farther than this from a rotation is refused."""


@dataclass(frozen=True)
class _Angles:
    """Three turns in a row, and the axes of the local frame that they carry."""

    axes: tuple[int, int, int]
    signs: tuple[float, float, float]


ANGLES = {
    "opk": _Angles((0, 1, 2), (1.0, -1.0, -1.0)),
    "wpk": _Angles((0, 1, 2), (1.0, 1.0, 1.0)),
    "ypr": _Angles((2, 1, 0), (1.0, 1.0, 1.0)),
}
FORMS = ("matrix", "quaternion", *ANGLES)


def rotations_from(values: npt.ArrayLike, form: str = "matrix") -> FloatArray:
    """Rotation matrices (..., 3, 3) from the values of a form: (..., 3, 3), (..., 4) or (..., 3) radians.

    Raises:
        DegenerateGeometryError: a matrix is farther than 1e-6 from a rotation, or a quaternion is zero.
        InputError: the form is unknown.
    """
    array = np.asarray(values, dtype=np.float64)
    if form == "matrix":
        return _checked_matrices(array)
    if form == "quaternion":
        return _of_quaternions(array)
    angles = _angles(form)
    first, second, third = (TURNS[axis](array[..., k]) for k, axis in enumerate(angles.axes))
    return np.asarray(first @ second @ third * np.array(angles.signs))


def attitudes(rotations: npt.ArrayLike, form: str) -> FloatArray:
    """The values of a form (..., 3) radians, (..., 4) or (..., 3, 3), of rotation matrices (..., 3, 3).

    The second angle of three is within a quarter turn of zero; quaternions have w >= 0.
    """
    matrices = np.asarray(rotations, dtype=np.float64)
    if form == "matrix":
        return matrices
    if form == "quaternion":
        return quaternion_of_rotation(matrices)
    if form == "ypr":
        return -_cardan(np.swapaxes(matrices, -1, -2))[..., ::-1]
    return _cardan(matrices * np.array(_angles(form).signs))


def attitude_jacobian(rotations: npt.ArrayLike, form: str) -> FloatArray:
    """(..., 3, 3) derivatives of three angles with respect to w, where R = R0 exp(-[w]x); at w = 0.

    Where the second angle is a quarter turn, the entries are not finite.
    """
    angles = _angles(form)
    values = attitudes(rotations, form)
    rates = np.stack([_body_rate(values, angles.axes, k) for k in range(3)], axis=-1)
    rates *= np.array(angles.signs)[:, None]
    return -inverse3(rates)


def _body_rate(values: FloatArray, axes: tuple[int, int, int], k: int) -> FloatArray:
    """(..., 3) what a change of the k-th angle is as a rotation vector in the local frame."""
    rate = np.zeros((*values.shape[:-1], 3))
    rate[..., axes[k]] = 1.0
    for later in range(k + 1, 3):
        turn = TURNS[axes[later]](values[..., later])
        rate = (np.swapaxes(turn, -1, -2) @ rate[..., None])[..., 0]
    return rate


def _cardan(matrices: FloatArray) -> FloatArray:
    """omega, phi, kappa (..., 3) of Rx(omega) Ry(phi) Rz(kappa)."""
    cosine = np.hypot(matrices[..., 0, 0], matrices[..., 0, 1])
    omega = np.arctan2(-matrices[..., 1, 2], matrices[..., 2, 2])
    phi = np.arctan2(matrices[..., 0, 2], cosine)
    kappa = np.arctan2(-matrices[..., 0, 1], matrices[..., 0, 0])
    return np.stack([omega, phi, kappa], axis=-1)


def _of_quaternions(quaternions: FloatArray) -> FloatArray:
    length = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if not np.all(np.isfinite(length) & (length > 0.0)):
        raise DegenerateGeometryError("A quaternion is zero or not finite: it is no rotation.")
    w, x, y, z = np.moveaxis(quaternions / length, -1, 0)
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _checked_matrices(matrices: FloatArray) -> FloatArray:
    if not np.isfinite(matrices).all():
        raise DegenerateGeometryError("A rotation matrix has entries that are not finite.")
    closest = closest_rotation(matrices)
    gap = float(np.abs(closest - matrices).max(initial=0.0))
    if gap > ORTHOGONAL:
        raise DegenerateGeometryError(
            f"A matrix is not a rotation: its columns are not orthogonal unit vectors, by {gap:.3g}."
        )
    return closest


def _angles(form: str) -> _Angles:
    if form not in ANGLES:
        raise InputError(f"{form!r} is no form of a rotation; the forms are {', '.join(FORMS)}")
    return ANGLES[form]
