"""Coordinate systems that PROJ defines, each with the one operation that leads to geocentric WGS 84."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.crs.operations import Operation, from_geocentric, known_crs, operation_of
from obseq.crs.points import as_points, check_finite
from obseq.crs.system import CoordinateSystem, Kind


@dataclass(frozen=True)
class ProjSystem(CoordinateSystem):
    """A geographic, projected or geocentric system that PROJ knows.

    The order of axes is always x, easting or longitude first, whatever the authority says: longitude comes
    first in EPSG:4326. (MMVII follows the authority and reads the latitude first there; its documentation
    does not.) Angles are in the unit of the system, mostly degrees. Heights are ellipsoidal, above the
    ellipsoid of the system, unless the definition itself has a vertical system.

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
        check_finite(moved, given, f"is outside the domain of {self.definition!r}.", names)
        return moved

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
