"""What every coordinate system offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, expecting
from obseq.arrays import FloatArray
from obseq.crs.operations import geodetic_from_geocentric
from obseq.dataclass import dataclass
from obseq.errors import CrsError


class Kind(StrEnum):
    """The five kinds of coordinate systems of MMVII (src/SysCo/SysCo.cpp)."""

    LOCAL = "Local"
    GEOCENTRIC = "GeoC"
    LOCAL_EUCLIDEAN = "LEuc"
    LOCAL_TANGENT = "RTL"
    PROJ = "Proj"


@dataclass(frozen=True)
class CoordinateSystem(ABC):
    """A coordinate system; two of them are equal when their definitions are.

    Points are arrays (n, 3) float64, or (3,) for one point, always x or easting or longitude first.
    `names`, where it is accepted, gives the names of the points for the messages of errors.

    Attributes:
        definition: the text that `parse` reads; aliases in it are resolved.
    """

    definition: str

    @property
    @abstractmethod
    def kind(self) -> Kind:
        """Which of the five kinds this is."""

    @property
    def is_euclidean(self) -> bool:
        """Whether straight lines and metres mean the same along all axes: all but PROJ definitions."""
        return self.kind is not Kind.PROJ

    @property
    def is_geographic(self) -> bool:
        """Whether the first two coordinates are longitude and latitude, in the unit `plan_unit`."""
        return False

    @property
    def plan_unit(self) -> Unit:
        """Unit of the first two coordinates."""
        return METRE

    @property
    def height_unit(self) -> Unit:
        """Unit of the third coordinate."""
        return METRE

    def differences(self, coordinates: FloatArray, others: FloatArray) -> FloatArray:
        """(n, 3) coordinates minus others, in the units of the system; also across the date line."""
        result = np.asarray(coordinates - others)
        if self.plan_unit.is_angle:
            turn = 2.0 * np.pi / self.plan_unit.factor
            result[:, 0] -= turn * np.round(result[:, 0] / turn)
        return result

    @property
    def is_complete(self) -> bool:
        """False for a bare `RTL`, whose origin is still to be chosen."""
        return True

    @abstractmethod
    def to_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Geocentric WGS 84 coordinates (metres) of points of this system."""

    @abstractmethod
    def from_geocentric(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Coordinates in this system of geocentric WGS 84 points (metres)."""

    def geodetic(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """Longitude, latitude (radians), ellipsoidal height (metres) on WGS 84 of points of this system."""
        return geodetic_from_geocentric(self.to_geocentric(points, names), names)

    def geocentric_pose(self) -> tuple[FloatArray, FloatArray]:
        """R (3, 3) and T (3,) with geocentric = R x + T; for GeoC, LEuc and RTL.

        Raises:
            CrsError: for the other kinds, whose relation to geocentric coordinates is no such pose.
        """
        raise CrsError(
            f"{self.definition!r} has no rotation and translation to geocentric coordinates: only RTL, LEuc "
            "and GeoC have them. Compute in a local tangent frame (RTL*X0*Y0*Z0*DEFINITION)."
        )

    def vertical_rotation(self, points: npt.ArrayLike, names: Sequence[str] | None = None) -> FloatArray:
        """R (n, 3, 3) from this system to the local frame east, north, up of each point.

        Rows are the east, north and up directions at the point (ellipsoid normal of WGS 84), in this system:
        `R[k, 2]` is upwards. R(P) = ENU(P)^T R_system (MMVII, getRot2Vert). MMVII offers it for RTL only;
        here GeoC and LEuc have it too, for they are as Euclidean.

        Raises:
            CrsError: for Local systems, which have no vertical, and PROJ definitions, whose axes turn and
                stretch from point to point.
        """
        raise CrsError(
            f"There is no rotation from {self.definition!r} to the vertical of a point: it takes a Euclidean "
            "system with a place on the Earth (RTL, LEuc or GeoC). "
            "Compute in a local tangent frame (RTL*X0*Y0*Z0*DEFINITION)."
        )


@expecting(longitude=ARRAY, latitude=ARRAY)
def east_north_up(longitude: npt.ArrayLike, latitude: npt.ArrayLike) -> FloatArray:
    """ENU (..., 3, 3), whose columns are the east, north and up directions in geocentric axes.

    Args:
        longitude: geodetic longitudes (...), radians.
        latitude: geodetic latitudes (...), radians; up is the normal of the ellipsoid.
    """
    lon, lat = np.broadcast_arrays(np.asarray(longitude, np.float64), np.asarray(latitude, np.float64))
    (sin_lon, sin_lat), (cos_lon, cos_lat) = np.sin((lon, lat)), np.cos((lon, lat))
    columns = np.zeros((3, 3, *lon.shape))
    columns[0] = -sin_lon, -sin_lat * cos_lon, cos_lat * cos_lon
    columns[1] = cos_lon, -sin_lat * sin_lon, cos_lat * sin_lon
    columns[2, 1:] = cos_lat, sin_lat
    return np.ascontiguousarray(np.moveaxis(columns, (0, 1), (-2, -1)))


@dataclass(frozen=True)
class Unit:
    """A unit of lengths or of angles.

    Attributes:
        name: What to call it: `m`, `degree`, `grad`, `US survey foot`.
        factor: Metres, or radians, in one unit.
        is_angle: Whether it measures angles.
    """

    name: str
    factor: float
    is_angle: bool = False


METRE = Unit("m", 1.0)
