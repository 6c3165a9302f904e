"""Map systems of aerial work: from map coordinates to longitude and latitude, to geocentric ones, and back.

One datum throughout: the geocentric coordinates are those of the ellipsoid of the map itself, so that nothing
but the projection stands between a map and the rays. Longitude comes first, whatever the authority says.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.crs import east_north_up
from obseq.dataclass import dataclass
from obseq.errors import CrsError

if TYPE_CHECKING:
    import pyproj

    from obseq.arrays import FloatArray

METRE = 1.0


class MapSystem:
    """A projected coordinate system in metres, and the ellipsoid that it stands on.

    Heights are ellipsoidal, metres.

    Args:
        definition: what PROJ knows, such as ``EPSG:2154`` or an integer EPSG code.

    Raises:
        CrsError: if PROJ does not know it, if it is not a projected system, or if it is not in metres.
    """

    def __init__(self, definition: str | int) -> None:
        self.definition = f"EPSG:{definition}" if isinstance(definition, int) else definition
        self.crs = _projected(self.definition)
        ellipsoid = self.crs.ellipsoid
        if ellipsoid is None:
            raise CrsError(f"{self.definition!r}: has no ellipsoid; rays need one.")
        major, minor = float(ellipsoid.semi_major_metre), float(ellipsoid.semi_minor_metre)
        self.ellipsoid = Ellipsoid(major, 1.0 - (minor / major) ** 2)

    def __getstate__(self) -> dict[str, object]:
        return {"definition": self.definition}

    def __setstate__(self, state: dict[str, str]) -> None:
        self.__init__(state["definition"])  # type: ignore[misc]  # PROJ's objects are made again

    @cached_property
    def _to_geodetic(self) -> pyproj.Transformer:
        from pyproj import Transformer

        return Transformer.from_crs(self.crs, self.crs.geodetic_crs, always_xy=True)

    @cached_property
    def _projection(self) -> pyproj.Proj:
        from pyproj import Proj

        return Proj(self.crs)

    def geodetic(self, plan: FloatArray) -> FloatArray:
        """Longitude and latitude (n, 2), radians, of map points (n, 2); not finite outside the domain."""
        lon, lat = self._to_geodetic.transform(*_columns(plan))
        return np.stack([np.deg2rad(lon), np.deg2rad(lat)], axis=-1)

    def plan(self, geodetic: FloatArray) -> FloatArray:
        """Map points (n, 2) of longitude and latitude (n, 2), radians."""
        lon, lat = np.rad2deg(_columns(geodetic))
        x, y = self._to_geodetic.transform(lon, lat, direction="INVERSE")
        return np.stack([np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)], axis=-1)

    def to_system(self, plan: FloatArray, definition: str) -> FloatArray:
        """Coordinates (n, 2) of map points (n, 2) in another system, easting or longitude first.

        Raises:
            CrsError: if PROJ does not know the system.
        """
        from pyproj import Transformer
        from pyproj.exceptions import CRSError as ProjError

        try:
            transformer = Transformer.from_crs(self.crs, definition, always_xy=True)
        except ProjError as error:
            raise CrsError(f"Unknown coordinate system {definition!r}. PROJ said: {error}") from None
        x, y = transformer.transform(*_columns(plan))
        return np.stack([np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)], axis=-1)

    def convergence(self, geodetic: FloatArray) -> FloatArray:
        """Angle (n,), radians, from grid north to geographic north, counted positive west of the axis.

        Minus PROJ's meridian convergence; Borea's sign.
        """
        lon, lat = _columns(geodetic)
        factors = self._projection.get_factors(lon, lat, radians=True)
        return -np.deg2rad(np.asarray(factors.meridian_convergence, dtype=np.float64))

    def alteration(self, plan: FloatArray) -> FloatArray:
        """Linear alteration (n,) of map points (n, 2): meridional scale minus one."""
        lon, lat = _columns(self.geodetic(plan))
        factors = self._projection.get_factors(lon, lat, radians=True)
        return np.asarray(factors.meridional_scale, dtype=np.float64) - 1.0

    def geocentric(self, points: FloatArray) -> FloatArray:
        """Geocentric coordinates (n, 3) of map points (n, 3) with ellipsoidal heights."""
        return self.ellipsoid.geocentric(self.geodetic(points[:, :2]), points[:, 2])

    def from_geocentric(self, points: FloatArray) -> FloatArray:
        """Map points (n, 3) with ellipsoidal heights of geocentric points (n, 3)."""
        geodetic, heights = self.ellipsoid.geodetic(points)
        return np.concatenate([self.plan(geodetic), heights[:, None]], axis=1)

    def axes(self, plan: FloatArray, geodetic: FloatArray | None = None) -> FloatArray:
        """Directions of the map at points (n, 2): grid east, grid north, up, as rows of (n, 3, 3) rotations.

        They turn geocentric vectors into the local frame of the map.
        """
        place = self.geodetic(plan) if geodetic is None else geodetic
        east, north, up = np.moveaxis(east_north_up(*place.T), -1, 0)
        turn = self.convergence(place)[:, None]
        return np.stack(
            [np.cos(turn) * east + np.sin(turn) * north, -np.sin(turn) * east + np.cos(turn) * north, up],
            axis=1,
        )


def _columns(pairs: FloatArray) -> FloatArray:
    """The two coordinates of points (n, 2), each contiguous."""
    return np.ascontiguousarray(pairs[:, :2].T)


def _projected(definition: str) -> pyproj.CRS:
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    try:
        crs = CRS.from_user_input(definition)
    except ProjError as error:
        raise CrsError(f"Unknown coordinate system {definition!r}. PROJ said: {error}") from None
    plan = crs.sub_crs_list[0] if crs.is_compound else crs
    if not plan.is_projected:
        raise CrsError(f"{definition!r} ({crs.name}) is not a projected system: give one, such as EPSG:2154.")
    unit = plan.axis_info[0]
    if unit.unit_conversion_factor != METRE:
        raise CrsError(
            f"{definition!r} ({crs.name}) is in {unit.unit_name}; give a projected system in metres."
        )
    return plan


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid of revolution.

    Attributes:
        major: semi-major axis, metres.
        squared_eccentricity: of the meridian.
    """

    major: float
    squared_eccentricity: float

    def geocentric(self, geodetic: FloatArray, heights: FloatArray) -> FloatArray:
        """Geocentric coordinates (n, 3) of longitude and latitude (n, 2), radians, and heights (n,)."""
        lon, lat = geodetic[:, 0], geodetic[:, 1]
        normal = self.major / np.sqrt(1.0 - self.squared_eccentricity * np.sin(lat) ** 2)
        radius = (normal + heights) * np.cos(lat)
        up = (normal * (1.0 - self.squared_eccentricity) + heights) * np.sin(lat)
        return np.stack([radius * np.cos(lon), radius * np.sin(lon), up], axis=-1)

    def geodetic(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Longitude and latitude (n, 2), radians, and ellipsoidal heights (n,) of geocentric points (n, 3).

        Bowring's formula on tangents, twice: exact to the rounding error from the sea floor to satellites.
        """
        x, y, z = points[:, 0], points[:, 1], points[:, 2]
        axis_distance = np.hypot(x, y)
        flattening = np.sqrt(1.0 - self.squared_eccentricity)
        minor, second = self.major * flattening, self.squared_eccentricity / flattening**2
        tangent = z / (axis_distance * flattening)
        for _ in range(2):
            cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
            sine = tangent * cosine
            above = z + second * minor * sine**3
            across = axis_distance - self.squared_eccentricity * self.major * cosine**3
            tangent = flattening * above / across
        ratio = above / across
        cosine = 1.0 / np.sqrt(1.0 + ratio * ratio)
        sine = ratio * cosine
        root = np.sqrt(1.0 - self.squared_eccentricity * sine * sine)
        heights = axis_distance * cosine + z * sine - self.major * root
        return np.stack([np.arctan2(y, x), np.arctan(ratio)], axis=-1), heights


WGS84 = Ellipsoid(6_378_137.0, (2.0 - 1.0 / 298.257223563) / 298.257223563)
