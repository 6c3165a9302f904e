"""Ellipsoids of revolution: geodetic and geocentric coordinates, both ways, for arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


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
