"""How the vertical turns when its point moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.crs.rigid import RigidSystem


def turn_of_vertical(system: RigidSystem, points: FloatArray, axes: FloatArray) -> FloatArray:
    """(n, 3, 3) rotation vectors of east, north, up for movements of their points, in a system.

    East, north and up turn about the east by -1 / (M + h) for each metre to the north, and for each metre to
    the east by 1 / (N + h) about the north and by tan(latitude) / (N + h) upwards, the convergence of the
    meridians. M and N: radii of curvature of meridian and prime vertical.

    Args:
        system: a system whose frame is Euclidean and has a place on the Earth.
        points: (n, 3).
        axes: (n, 3, 3) from the system to east, north, up at the points (`vertical_rotation`).

    Returns:
        For each point what its axes turn by (rad), by columns of the movement (m).
    """
    ground = system.ground
    equatorial, squared = ground.equatorial / ground.scale, ground.squared_eccentricity
    own = ground.own(system.to_geocentric(points)) / ground.scale
    up = axes[:, 2] @ system.ground_rotation.T
    inside = np.sqrt(1.0 - squared * np.square(up[:, 2]))
    height = np.einsum("ni,ni->n", up, own) - equatorial * inside
    prime = equatorial / inside
    meridian = prime * (1.0 - squared) / np.square(inside)
    local = np.zeros((len(points), 3, 3))
    local[:, 0, 1] = -1.0 / (meridian + height)
    local[:, 1, 0] = 1.0 / (prime + height)
    local[:, 2, 0] = up[:, 2] / np.hypot(up[:, 0], up[:, 1]) * local[:, 1, 0]
    return np.asarray(np.swapaxes(axes, 1, 2) @ local @ axes)
