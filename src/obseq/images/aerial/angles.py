"""Omega, phi, kappa in any order of axes: matrices from angles and back.

The letters o, p, k stand for the axes x, y, z. With the order ``a1 a2 a3`` and stored angles t1 t2 t3,
``M = R_a1(t1) R_a2(t2) R_a3(t3)`` turns vectors of the photogrammetric camera (x right, y up, z backwards)
into the map; the i-th stored angle goes with the i-th letter (as in Borea: B1 of its list). The matrix kept
is ``D M^T`` with D = diag(1, -1, -1): from the map to image axes (column, line, forward).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.geometry.attitudes import TURNS

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


UNITS = {"degree": np.pi / 180.0, "gon": np.pi / 200.0, "radian": 1.0}
"""Radians in each unit of angle."""
_AXES = {"o": 0, "p": 1, "k": 2}
_FLIP = np.array([1.0, -1.0, -1.0])


def axes_of(order: str) -> tuple[int, int, int]:
    """The axes (0, 1, 2 for x, y, z) of an order such as ``opk``.

    Raises:
        InputError: if the order is not a permutation of o, p, k.
    """
    if sorted(order) != ["k", "o", "p"]:
        raise InputError(f"order of rotations {order!r}: must be a permutation of the letters o, p, k.")
    first, second, third = (_AXES[letter] for letter in order)
    return first, second, third


def unit_of(name: str) -> float:
    """Radians in a unit of angle called degree, gon or radian.

    Raises:
        InputError: for another name.
    """
    if name not in UNITS:
        raise InputError(f"unit of angles {name!r}: must be one of {', '.join(UNITS)}.")
    return UNITS[name]


def matrices_from_angles(angles: FloatArray, order: str = "opk") -> FloatArray:
    """Rotations (n, 3, 3) from the map to image axes, of stored angles (n, 3), radians."""
    turned = np.eye(3)
    for axis, angle in zip(axes_of(order), angles.T, strict=True):
        turned = turned @ TURNS[axis](angle)
    return _FLIP[:, None] * np.swapaxes(turned, -1, -2)


def angles_from_matrices(matrices: FloatArray, order: str = "opk") -> FloatArray:
    """Stored angles (n, 3), radians, of rotations (n, 3, 3) from the map to image axes."""
    a, b, c = axes_of(order)
    turned = np.swapaxes(_FLIP[:, None] * matrices, -1, -2)
    sign = 1.0 if (a, b, c) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    first = np.arctan2(-sign * turned[..., b, c], turned[..., c, c])
    second = np.arcsin(np.clip(sign * turned[..., a, c], -1.0, 1.0))
    third = np.arctan2(-sign * turned[..., a, b], turned[..., a, a])
    return np.stack([first, second, third], axis=-1)
