"""Shapes in longitude and latitude, cut where they cross the meridian of 180 degrees (RFC 7946, 3.1.9)."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import FloatArray

HALF, TURN = 180.0, 360.0


def cut(corners: FloatArray) -> list[FloatArray]:
    """The parts of a line, or of a convex ring, on both sides of the meridian; the shape itself elsewhere.

    Args:
        corners: (n, 3) longitude (degrees, -180 to 180), latitude, height; of a ring the last is the first.
    """
    steps = np.diff(corners[:, 0])
    unwrapped = corners.copy()
    unwrapped[1:, 0] -= np.cumsum(TURN * np.round(steps / TURN))
    border = HALF if unwrapped[:, 0].max() > HALF else -HALF
    if (np.abs(unwrapped[:, 0]) <= HALF).all():
        return [unwrapped]
    is_ring = len(corners) > 2
    parts = []
    for side in (1.0, -1.0):  # inside, and beyond
        inward = -side * np.sign(border)
        part = _clipped(unwrapped, border, inward, is_ring=is_ring)
        if side < 0.0:
            part[:, 0] -= np.copysign(TURN, border)
        if len(part) > 1 and np.ptp(part[:, 0]) > 0.0:
            parts.append(part)
    return parts


def _clipped(corners: FloatArray, border: float, inward: float, *, is_ring: bool) -> FloatArray:
    """What lies on one side of a meridian (Sutherland and Hodgman); closed again where it is a ring."""
    inside = inward * (corners[:, 0] - border) >= 0.0
    found = [corners[0]] if inside[0] else []
    for (start, end), (was, is_in) in zip(pairwise(corners), pairwise(inside), strict=True):
        if was != is_in:
            share = (border - start[0]) / (end[0] - start[0])
            found.append(np.array([border, *(start[1:] + share * (end[1:] - start[1:]))]))
        if is_in:
            found.append(end)
    if is_ring and found and (found[0] != found[-1]).any():
        found.append(found[0])
    return np.array(found).reshape(-1, 3)
