"""Circles through points in space."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray


def axis_of(points: FloatArray) -> FloatArray:
    """Normal (3,) of the plane of points (n, 3), by its largest triangle; zero if there is none."""
    sides = _largest_sides(points)
    if sides is None:
        return np.zeros(3)
    normal = np.cross(*sides)
    return np.asarray(normal * np.sign(normal[np.abs(normal).argmax()]))


def centre_of(points: FloatArray) -> FloatArray | None:
    """Centre (3,) of the circle through points (n, 3), by their largest triangle; None if there is none."""
    sides = _largest_sides(points)
    if sides is None:
        return None
    p, q = sides
    normal = np.cross(p, q)
    twice = 2.0 * float(normal @ normal)
    if not twice > 0.0:
        return None
    start = points[_farthest_pair(points)[0]]
    return np.asarray(start + np.cross((p @ p) * q - (q @ q) * p, normal) / twice)


def _largest_sides(points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
    """From the first point of the largest triangle to both others."""
    if len(points) < 3:
        return None
    a, b = _farthest_pair(points)
    heights = np.linalg.norm(np.cross(points - points[a], points[b] - points[a]), axis=1)
    return points[b] - points[a], points[int(heights.argmax())] - points[a]


def _farthest_pair(points: FloatArray) -> tuple[int, int]:
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
    a, b = np.unravel_index(int(gaps.argmax()), gaps.shape)
    return int(a), int(b)
