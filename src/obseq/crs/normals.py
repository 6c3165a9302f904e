"""The vertical of single points, without PROJ: the normal of the ellipsoid in closed form."""

import math
from dataclasses import field

from obseq.arrays import FloatArray
from obseq.crs.rigid import RigidSystem
from obseq.dataclass import dataclass

Row = tuple[float, float, float]

_ROUNDS = 3
"""Bowring's iteration gains four digits a round near the Earth's surface: three leave rounding only."""


@dataclass(frozen=True)
class Normals:
    """East, north and up at points of a rigid system; as `vertical_rotation`, and quick for one point too.

    Attributes:
        system: a system whose frame is Euclidean and has a place on the Earth.
    """

    system: RigidSystem
    _pose: tuple[tuple[Row, Row, Row], Row] = field(init=False, repr=False, compare=False)
    _shape: tuple[float, float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        ground = self.system.ground
        translation = ground.own(self.system.translation) / ground.scale
        pose = tuple(map(tuple, self.system.ground_rotation.tolist())), tuple(translation.tolist())
        object.__setattr__(self, "_pose", pose)
        object.__setattr__(self, "_shape", (ground.equatorial / ground.scale, ground.flattening))

    def __call__(self, points: FloatArray) -> FloatArray:
        """R (n, 3, 3) from the system to east, north, up at points (n, 3)."""
        return self.system.vertical_rotation(points)

    def at(self, position: Row) -> tuple[Row, Row, Row]:
        """The same for one point, as plain numbers."""
        rotation, (tx, ty, tz) = self._pose
        (a, b, c), (d, e, f), (g, h, i) = rotation
        px, py, pz = position
        x, y, z = a * px + b * py + c * pz + tx, d * px + e * py + f * pz + ty, g * px + h * py + i * pz + tz
        sin_lon, cos_lon, sin_lat, cos_lat = _directions(x, y, z, *self._shape)
        u, v = -sin_lat * cos_lon, -sin_lat * sin_lon
        p, q = cos_lat * cos_lon, cos_lat * sin_lon
        return (
            (-sin_lon * a + cos_lon * d, -sin_lon * b + cos_lon * e, -sin_lon * c + cos_lon * f),
            (u * a + v * d + cos_lat * g, u * b + v * e + cos_lat * h, u * c + v * f + cos_lat * i),
            (p * a + q * d + sin_lat * g, p * b + q * e + sin_lat * h, p * c + q * f + sin_lat * i),
        )


def _directions(
    x: float, y: float, z: float, equatorial: float, flattening: float
) -> tuple[float, float, float, float]:
    """Sine and cosine of the longitude, then of the geodetic latitude, of a geocentric point."""
    polar, first = equatorial * (1.0 - flattening), flattening * (2.0 - flattening)
    second = first / (1.0 - first)  # squares of the two eccentricities
    flat = math.hypot(x, y)
    sin_lon, cos_lon = (y / flat, x / flat) if flat > 0.0 else (0.0, 1.0)
    over, along = z * equatorial, flat * polar
    for _ in range(_ROUNDS):
        size = math.hypot(over, along) or 1.0
        sine, cosine = over / size, along / size
        up = z + second * polar * sine**3
        out = flat - first * equatorial * cosine**3
        over, along = polar * up, equatorial * out
    size = math.hypot(up, out) or 1.0
    return sin_lon, cos_lon, up / size, out / size
