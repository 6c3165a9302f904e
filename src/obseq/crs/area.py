"""Where a system of PROJ is used: points that lie outside, and what explains it."""

from __future__ import annotations

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
