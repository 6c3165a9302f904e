"""The ellipsoid to which heights and verticals refer, and where it lies in geocentric WGS 84 axes."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.crs.operations import (
    Operation,
    geodetic_from_geocentric,
    known_crs,
    operation_of,
)
from obseq.crs.point_arrays import check_finite
from obseq.crs.refraction import EQUATORIAL_RADIUS, SQUARED_ECCENTRICITY
from obseq.dataclass import dataclass
from obseq.errors import CrsError
from obseq.geometry import similarity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.crs.proj import ProjSystem

_AROUND = 10_000.0
"""Metres around a place within which the ellipsoid of a datum is fitted there."""
_KEPT = 1e-5
"""Metres by which heights may change where a system is said to keep them."""
_RIGID = 1e-3
"""Metres by which a change of datum may differ from a similarity within that distance."""
_LEAST = 4
"""Places that determine a similarity, and one more."""


@dataclass(frozen=True, eq=False)
class Ground:
    """An ellipsoid in space: heights are above it, verticals are its normals.

    Coordinates along its own axes are `scale rotation X + translation` of geocentric WGS 84 ones.

    Attributes:
        equatorial: Equatorial radius (m).
        flattening: Of the ellipsoid.
        squared_eccentricity: Of the ellipsoid.
        rotation: (3, 3).
        translation: (3,) m.
        scale: Of its metres to those of WGS 84.
        is_plain: Whether it is the ellipsoid of WGS 84, where it is.
    """

    equatorial: float
    flattening: float
    squared_eccentricity: float
    rotation: FloatArray
    translation: FloatArray
    scale: float = 1.0
    is_plain: bool = False

    def own(self, geocentric: FloatArray) -> FloatArray:
        """Coordinates along its own axes of geocentric points (..., 3)."""
        if self.is_plain:
            return geocentric
        return np.asarray(self.scale * (geocentric @ self.rotation.T) + self.translation)

    def geodetic(self, geocentric: FloatArray, names: Sequence[str] | None = None) -> FloatArray:
        """Longitude, latitude (rad) and height (m) of geocentric points (..., 3), on this ellipsoid."""
        if self.is_plain:
            return geodetic_from_geocentric(geocentric, names)
        own = self.own(geocentric)
        place = _cartesian(self.equatorial, self.flattening).inverse(own)
        check_finite(place, own, "(geocentric) has no place on the ellipsoid.", names)
        place[..., :2] = np.deg2rad(place[..., :2])
        return place


WGS84 = Ground(
    EQUATORIAL_RADIUS, 1.0 / 298.257223563, SQUARED_ECCENTRICITY, np.eye(3), np.zeros(3), is_plain=True
)
"""The ellipsoid itself; its eccentricity is rounded as in MMVII."""


def ground_at(system: ProjSystem, place: tuple[float, float, float]) -> Ground:
    """The ellipsoid to which heights refer in a system, around a place.

    A system of the plan alone says nothing of heights: they are levelled, and no change of datum tilts what
    is level. They are above the ellipsoid of the system itself, where it lies in WGS 84, and verticals are
    its normals. Where the change of datum leaves heights as they are, and in systems with a vertical axis of
    their own, it is that of WGS 84.

    Args:
        system: As PROJ knows it.
        place: (3,) coordinates in it.

    Raises:
        CrsError: The change of datum is no similarity around there, or the system ends there.
    """
    if len(known_crs(system.definition).axis_info) != 2:
        return WGS84
    return _ground_of(system.definition, place)


@lru_cache(maxsize=64)
def _ground_of(definition: str, place: tuple[float, float, float]) -> Ground:
    """That of a system of the plan."""
    given = _around(definition, np.array(place))
    there = operation_of(definition).forward(given)
    is_placed = np.isfinite(there).all(axis=1)
    given, there = given[is_placed], there[is_placed]
    if not np.abs(geodetic_from_geocentric(there)[:, 2] - given[:, 2]).max(initial=0.0) > _KEPT:
        return WGS84
    if len(there) < _LEAST:
        raise CrsError(f"{definition!r} ends here: the vertical of its datum is not determined")
    equatorial, flattening = _shape(definition)
    geodetic = np.column_stack([_degrees(definition, given), given[:, 2]])
    own = _cartesian(equatorial, flattening).forward(geodetic)
    scale, motion = similarity(there, own)
    left = np.linalg.norm(scale * there @ motion.rotation.T + motion.centre - own, axis=1).max()
    if left > _RIGID:
        raise CrsError(_bent(definition, float(left)))
    squared = flattening * (2.0 - flattening)
    return Ground(equatorial, flattening, squared, motion.rotation, motion.centre, scale)


@lru_cache(maxsize=64)
def _cartesian(equatorial: float, flattening: float) -> Operation:
    """From longitude, latitude (degrees) and height on an ellipsoid to coordinates along its axes."""
    from pyproj import Transformer

    shape = f"+a={equatorial!r} +b={equatorial * (1.0 - flattening)!r}"
    steps = f"+step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart {shape}"
    return Operation("geodetic to cartesian", 0.0, Transformer.from_pipeline(f"+proj=pipeline {steps}"))


def _shape(definition: str) -> tuple[float, float]:
    """Equatorial radius and flattening of the ellipsoid of a system."""
    ellipsoid = known_crs(definition).ellipsoid
    assert ellipsoid is not None
    inverse = float(ellipsoid.inverse_flattening)
    return float(ellipsoid.semi_major_metre), 1.0 / inverse if inverse else 0.0


def _bent(definition: str, left: float) -> str:
    return (
        f"The change of datum of {definition!r} bends the ellipsoid of the system by {1e3 * left:.1f} mm "
        f"within {_AROUND / 1e3:.0f} km: give the system with `@h` (heights stay what they are, above the "
        "ellipsoid of WGS 84), or with its vertical system"
    )


def _around(definition: str, place: FloatArray) -> FloatArray:
    """(9, 3) coordinates at and around a place, at two heights."""
    unit = known_crs(definition).axis_info[0].unit_conversion_factor
    step = (_AROUND / EQUATORIAL_RADIUS if known_crs(definition).is_geographic else _AROUND) / unit
    sides = np.array([[0, 0, 0], [1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0]], np.float64)
    sides = np.concatenate([sides, sides[1:] + np.array([0.0, 0.0, 1.0])])
    return np.asarray(place + sides * [step, step, 1000.0])


def _degrees(definition: str, given: FloatArray) -> FloatArray:
    """(n, 2) longitudes, from the prime meridian of the system, and latitudes of coordinates in it."""
    from pyproj import Transformer

    known = known_crs(definition)
    plan = known.source_crs if known.is_bound else known
    geodetic = plan.geodetic_crs if plan else None
    assert geodetic is not None
    if plan == geodetic:
        found = given[:, :2]
    else:
        found = np.stack(
            Transformer.from_crs(plan, geodetic, always_xy=True).transform(*given[:, :2].T), axis=1
        )
    return np.asarray(np.rad2deg(found * geodetic.axis_info[0].unit_conversion_factor))
