"""Curvature of the Earth and refraction of zenith angles (MMVII src/Topo, topo-adjustment section 8.4)."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from obseq.arguments import ARRAY, NOTHING, NUMBER, TEXTS, expecting, instance
from obseq.arrays import FloatArray
from obseq.crs.operations import geodetic_from_geocentric
from obseq.crs.system import CoordinateSystem

EQUATORIAL_RADIUS = 6378137.0
"""a of the ellipsoid of MMVII's topometric code, metres."""
SQUARED_ECCENTRICITY = 0.00669438
"""e2 of the same, with its rounding."""
REFRACTION_COEFFICIENT = 0.12


@expecting(latitude=ARRAY)
def curvature_radius(latitude: npt.ArrayLike) -> FloatArray:
    """Gaussian mean radius of curvature rho (metres) at geodetic latitudes (radians).

    rho = sqrt(M N) = a sqrt(1 - e2) / (1 - e2 sin^2 latitude).
    """
    sine = np.sin(np.asarray(latitude, dtype=np.float64))
    radius: FloatArray = (
        EQUATORIAL_RADIUS
        * np.sqrt(1.0 - SQUARED_ECCENTRICITY)
        / (1.0 - SQUARED_ECCENTRICITY * np.square(sine))
    )
    return radius


@expecting(system=instance(CoordinateSystem), origins=ARRAY, targets=ARRAY, names=TEXTS | NOTHING)
def horizontal_distance(
    system: CoordinateSystem,
    origins: npt.ArrayLike,
    targets: npt.ArrayLike,
    names: Sequence[str] | None = None,
) -> FloatArray:
    """D (n,) metres: length at the height of each origin of the arc to its target.

    D = alpha (rho + h), where alpha is the angle of the two points at the centre of the Earth, and rho and h
    are those of the origin. MMVII takes alpha as the arc cosine of a cosine close to 1, quantised at 0.1 m;
    here it comes from cross and scalar products and is good to the rounding of coordinates, zero included.

    Args:
        system: the system of the points; any but Local.
        origins: (n, 3).
        targets: (n, 3).
        names: names of the origins, for messages.
    """
    return _distance_and_radius(system, origins, targets, names)[0]


@expecting(
    system=instance(CoordinateSystem),
    origins=ARRAY,
    targets=ARRAY,
    coefficient=NUMBER,
    names=TEXTS | NOTHING,
)
def refraction_correction(
    system: CoordinateSystem,
    origins: npt.ArrayLike,
    targets: npt.ArrayLike,
    coefficient: float = REFRACTION_COEFFICIENT,
    names: Sequence[str] | None = None,
) -> FloatArray:
    """Refraction (n,) radians of zenith angles, origins (n, 3) to targets (n, 3): coefficient D / (2 rho).

    It is how much too high the target seems: true zenith angle = measured + correction.
    """
    distance, rho = _distance_and_radius(system, origins, targets, names)
    return coefficient * distance / (2.0 * rho)


def _distance_and_radius(
    system: CoordinateSystem, origins: npt.ArrayLike, targets: npt.ArrayLike, names: Sequence[str] | None
) -> tuple[FloatArray, FloatArray]:
    """D (n,), and rho (n,) of the origins."""
    start = system.to_geocentric(origins, names)
    return arc_and_radius(start, system.to_geocentric(targets), geodetic_from_geocentric(start, names))


def arc_and_radius(
    origins: FloatArray, targets: FloatArray, place: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """D (n,) metres, length at the height of each origin of the arc to its target, and rho (n,) there.

    Args:
        origins: (n, 3) geocentric.
        targets: (n, 3) geocentric.
        place: (n, 3) longitude, latitude (rad) and height of the origins.
    """
    sight = targets - origins
    # origin x target = origin x sight, without the cancellation
    (x, y, z), (u, v, w) = np.moveaxis(origins, -1, 0), np.moveaxis(sight, -1, 0)
    sine = np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)
    cosine = x * (x + u) + y * (y + v) + z * (z + w)
    rho = curvature_radius(place[..., 1])
    distance: FloatArray = np.arctan2(sine, cosine) * (rho + place[..., 2])
    return distance, rho


def slopes_of_arc(
    origins: FloatArray, targets: FloatArray, place: FloatArray, up: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(n, 3) derivatives of D / (2 rho) by origins and by targets, of `arc_and_radius`; in 1 / m.

    Without what the flattening adds through rho, below 1e-17.

    Args:
        origins: (n, 3) geocentric.
        targets: (n, 3) geocentric.
        place: (n, 3) longitude, latitude (rad) and height of the origins.
        up: (n, 3) upwards at the origins.
    """
    distance, rho = arc_and_radius(origins, targets, place)
    larger = 1.0 + place[:, 2] / rho
    slopes = []
    for ends, sign in ((origins, -1.0), (targets, 1.0)):
        length = np.linalg.norm(ends, axis=1)[:, None]
        sight = targets - origins
        flat = sight - np.einsum("ni,ni->n", sight, ends)[:, None] * ends / np.square(length)
        along = flat / np.maximum(np.linalg.norm(flat, axis=1), 1e-9)[:, None]
        slopes.append(sign * larger[:, None] * along / (2.0 * length))
    slopes[0] += (distance / larger / (2.0 * np.square(rho)))[:, None] * up
    return slopes[0], slopes[1]
