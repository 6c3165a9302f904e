"""Coordinate systems that PROJ defines, each with the one operation that leads to geocentric WGS 84."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.crs.operations import Operation, from_geocentric, known_crs, operation_of
from obseq.crs.point_arrays import as_points, check_finite
from obseq.crs.system import METRE, CoordinateSystem, Kind, Unit
from obseq.dataclass import dataclass

ZONED, MOST_ZONES = 1e6, 60
"""Metres by which eastings are larger for each number of their zone, where they begin with it."""


@dataclass(frozen=True)
class ProjSystem(CoordinateSystem):
    """A geographic, projected or geocentric system that PROJ knows.

    The order of axes is always x, easting or longitude first, whatever the authority says: longitude comes
    first in EPSG:4326. (MMVII follows the authority and reads the latitude first there; its documentation
    does not.) Angles are in the unit of the system, mostly degrees. Heights are above the ellipsoid of the
    system, unless the definition itself has a vertical system (`Ground`).

    One operation, the first of PROJ's list for the area of the system, serves all points both ways: no
    network is torn along the border of two areas of use.
    """

    @property
    def kind(self) -> Kind:
        """Proj."""
        return Kind.PROJ

    @property
    def is_geographic(self) -> bool:
        """Whether the first two coordinates are longitude and latitude."""
        return bool(known_crs(self.definition).is_geographic)

    @property
    def plan_unit(self) -> Unit:
        """Unit of the first two coordinates: degrees, grads, metres, feet, ..."""
        return _units_of(self.definition)[0]

    @property
    def height_unit(self) -> Unit:
        """Unit of heights: metres, unless the definition has a vertical system in another unit."""
        return _units_of(self.definition)[1]

    @property
    def operation(self) -> Operation:
        """The transformation to geocentric coordinates, with its accuracy.

        Raises:
            CrsError: if it needs a grid that is not installed, or if none exists but a ballpark one.
        """
        return operation_of(self.definition)

    def to_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Geocentric WGS 84 coordinates (metres) of points of this system."""
        given = as_points(points)
        moved = self.operation.forward(given)
        if not np.isfinite(moved).all():
            complaint = f"is outside the domain of {self.definition!r}.{self._hint(given)}"
            check_finite(moved, given, complaint, names)
        return moved

    def _hint(self, given: FloatArray) -> str:
        """What may be wrong with coordinates (..., 3) outside the domain."""
        zones = np.unique(given[..., 0] // ZONED)
        if not self.is_geographic and len(zones) == 1 and 1 <= zones[0] <= MOST_ZONES:
            bare = given - np.array([zones[0] * ZONED, 0.0, 0.0])
            if np.isfinite(self.operation.forward(bare)).all():
                return f" Without the zone number {zones[0]:.0f} in front of the easting it is inside."
        if np.isfinite(self.operation.forward(given[..., [1, 0, 2]])).all():
            first, second = ("longitude", "latitude") if self.is_geographic else ("easting", "northing")
            return f" With {first} and {second} exchanged it is inside: {first} comes first."
        return f" It takes longitude and latitude ({self.plan_unit.name})." if self.is_geographic else ""

    def from_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Coordinates in this system of geocentric WGS 84 points (metres)."""
        return from_geocentric(self.definition, points, names)


def proj_system(definition: str) -> ProjSystem:
    """The system of a PROJ definition.

    Raises:
        CrsError: if PROJ does not know it, or knows it as something else than a system of positions.
    """
    known_crs(definition)
    return ProjSystem(definition)


@lru_cache(maxsize=256)
def _units_of(definition: str) -> tuple[Unit, Unit]:
    """Units of plan and height of a PROJ definition."""
    known = known_crs(definition)
    first, _, height = known.to_3d().axis_info
    plan, up = (
        METRE if axis.unit_name == "metre" else Unit(axis.unit_name, axis.unit_conversion_factor, angular)
        for axis, angular in ((first, bool(known.is_geographic)), (height, False))
    )
    return plan, up
