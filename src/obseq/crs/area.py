"""Where a system of PROJ is used: points that lie outside, and what explains it."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from obseq.crs.operations import geodetic_from_geocentric, known_crs, operation_of
from obseq.crs.proj import ProjSystem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.crs.system import CoordinateSystem

MARGIN = 3.0
"""Degrees by which points may lie outside the area of use before it is said."""

SHOWN = 5
"""Names in a message."""

LONGEST = 60
"""Characters of the description of an area in a message."""


def area_warning(system: CoordinateSystem, points: FloatArray, names: Sequence[str]) -> str | None:
    """What to say of points outside the area of use of their system; None when there are none.

    Args:
        system: the system of the points.
        points: (n, 3) coordinates, in its units.
        names: (n,) of the points.
    """
    outside = outside_area(system, points)
    if not isinstance(system, ProjSystem) or not outside.any():
        return None
    which = [names[row] for row in np.flatnonzero(outside).tolist()]
    more = f", ... ({len(which)} points)" if len(which) > SHOWN else ""
    area = known_crs(system.definition).area_of_use
    first, second = ("longitude", "latitude") if system.is_geographic else ("easting", "northing")
    is_swapped = not _outside(system, points[outside][:, [1, 0, 2]]).any()
    hint = f"{first} and {second} look swapped" if is_swapped else "is it the system of these coordinates?"
    name = area.name if area else ""
    where = f"the area where {system.definition!r} is used ({name[:LONGEST]}{'...' * (len(name) > LONGEST)})"
    return f"{', '.join(which[:SHOWN])}{more}: outside {where}; {hint}"


def outside_area(system: CoordinateSystem, points: FloatArray) -> BoolArray:
    """(n,) whether points (n, 3) are outside the area of use of their system; false where it has none."""
    if not isinstance(system, ProjSystem) or not len(points):
        return np.zeros(len(points), dtype=bool)
    return _outside(system, points)


def _outside(system: ProjSystem, points: FloatArray) -> BoolArray:
    """(n,) whether points are farther outside the area of use than the margin, or cannot be placed at all."""
    area = known_crs(system.definition).area_of_use
    if area is None:
        return np.zeros(len(points), dtype=bool)
    geocentric = operation_of(system.definition).forward(points)
    is_placed: BoolArray = np.asarray(np.isfinite(geocentric).all(axis=1))
    outside: BoolArray = np.logical_not(is_placed)
    longitude, latitude, _ = np.rad2deg(geodetic_from_geocentric(geocentric[is_placed])).T
    width = (area.east - area.west) % 360.0 or 360.0
    beyond = (longitude - area.west + MARGIN) % 360.0 > width + 2.0 * MARGIN
    beyond |= (latitude < area.south - MARGIN) | (latitude > area.north + MARGIN)
    outside[is_placed] = beyond & (width + 2.0 * MARGIN < 360.0)
    return outside


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
