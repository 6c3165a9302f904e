"""Unknowns that live on a curved space, rotations and unit directions, and how a step moves them.

A rotation is a matrix R0 from the local frame (camera, instrument) to the world frame, and an unknown small
rotation w around it: R = R0 (I - [w]x). After a step, w is absorbed by the exact exponential,
R0 <- R0 exp(-[w]x), and reset to zero. A direction is a unit vector N0 with two tangent vectors U, V and
the unknowns du, dv: N = N0 + du U + dv V, normalised when the step is absorbed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.geometry.rotations import absorb

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


def orthonormalised(matrices: FloatArray) -> FloatArray:
    """Rotations from matrices (n, 3, 3) that rounding moved away: one step of Newton's iteration."""
    return np.asarray(matrices @ (1.5 * np.eye(3) - 0.5 * np.swapaxes(matrices, 1, 2) @ matrices))


def checked_rotations(matrices: FloatArray, what: str) -> FloatArray:
    """Matrices (n, 3, 3) checked to be rotations to 1e-6, and made so to rounding."""
    gap = np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = np.flatnonzero((gap > 1e-6) | (np.linalg.det(matrices) < 0.0))
    if wrong.size:
        raise InputError(f"{what}: row {wrong[0]} is not a rotation matrix (R R^T = I, det R = 1)")
    return orthonormalised(orthonormalised(matrices))


def turned(matrices: FloatArray, small: FloatArray) -> FloatArray:
    """R0 exp(-[w]x) for matrices (n, 3, 3) and small rotations (n, 3), kept orthonormal over many steps."""
    return orthonormalised(absorb(matrices, small))


def rotation_context(matrices: FloatArray) -> FloatArray:
    """(n, 18): each matrix row by row, then its transpose, for kernels that read either."""
    n = len(matrices)
    return np.hstack([matrices.reshape(n, 9), np.swapaxes(matrices, 1, 2).reshape(n, 9)])


def direction_context(vectors: FloatArray) -> FloatArray:
    """(n, 9): unit vector N0 and two unit vectors U, V that complete it to a direct orthonormal frame.

    U is the projection of the coordinate axis that is farthest from N0.
    """
    unit = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    axis = np.eye(3)[np.argmin(np.abs(unit), axis=1)]
    first = axis - np.sum(axis * unit, axis=1)[:, None] * unit
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.hstack([unit, first, np.cross(unit, first)])


def moved_directions(context: FloatArray, small: FloatArray) -> FloatArray:
    """Contexts (n, 9) of N0 + du U + dv V, for contexts (n, 9) and steps (n, 2)."""
    unit, first, second = context[:, :3], context[:, 3:6], context[:, 6:]
    return direction_context(unit + small[:, :1] * first + small[:, 1:] * second)
