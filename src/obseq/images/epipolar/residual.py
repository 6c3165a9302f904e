"""The epipolar residual of two oriented images: MicMac's ``EpipolarEcart``, for arrays of points.

For a point seen at p1 in image 1 and p2 in image 2, let I be the middle of the common perpendicular of both
rays, J a point a little farther along ray 2, and d the unit direction from the projection of I to that of J
in image 1: the way the scene moves there when going away from camera 2. The residual is the component of
``p1 - projection(I)`` across d, counted positive on the side of d turned by +90 degrees (from +x to +y; the
y of images goes down, so clockwise on the screen), in pixels of image 1.

It is half the distance from p1 to the epipolar line of p2, since I is in the middle; not a parallax.
Exchanging the images gives another number of about the same size. Rays count from the sensor to the scene
for every sensor (the original turns the sign for satellites).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.images.aerial.rays import meet

if TYPE_CHECKING:
    import numpy.typing as npt

    from obseq.arrays import FloatArray
    from obseq.images.epipolar.sensors import Sensor


NEXT_LINE = np.array([0.0, 1.0])


class EpipolarResiduals(NamedTuple):
    """Residuals of points seen by two images.

    Attributes:
        values: (n,) signed, pixels of image 1; nan at the epipole, for parallel rays and behind a camera.
        directions: (n, 2) unit epipolar directions in image 1.
        points: (n, 3) middles of the common perpendiculars.
    """

    values: FloatArray
    directions: FloatArray
    points: FloatArray


def epipolar_residuals(
    first: Sensor, first_pixels: npt.ArrayLike, second: Sensor, second_pixels: npt.ArrayLike
) -> EpipolarResiduals:
    """Signed epipolar residuals of pixels (n, 2) of image 1 and the same points in image 2.

    Raises:
        InputError: if the two arrays are not of one shape (n, 2), or a pixel is not finite.
    """
    p1, p2 = _pixels(first_pixels, "first"), _pixels(second_pixels, "second")
    if p1.shape != p2.shape:
        raise InputError(f"epipolar residuals: {len(p1)} points in the first image, {len(p2)} in the second.")
    start, towards = first.rays(p1)
    other, along = second.rays(p2)
    pairs = meet(start, towards, other, along)
    points = np.where((pairs.reach > 0.0).all(axis=1, keepdims=True), pairs.middle, np.nan)
    step = _ground_pixel(points, start, towards, *first.rays(p1 + NEXT_LINE))
    seen = first.project(points)
    way = first.project(points + step[:, None] * along) - seen
    with np.errstate(divide="ignore", invalid="ignore"):
        directions = way / np.sqrt((way**2).sum(axis=1, keepdims=True))
    off = p1 - seen
    values = directions[:, 0] * off[:, 1] - directions[:, 1] * off[:, 0]
    return EpipolarResiduals(values, directions, points)


def _ground_pixel(
    points: FloatArray, start: FloatArray, towards: FloatArray, below: FloatArray, beside: FloatArray
) -> FloatArray:
    """Step (n,) of the finite difference: about a pixel on the ground, more where rays miss each other."""
    return np.maximum(_distance(points, below, beside), _distance(points, start, towards))


def _distance(points: FloatArray, start: FloatArray, unit: FloatArray) -> FloatArray:
    """Distances (n,) from points to lines."""
    away = points - start
    return np.asarray(np.sqrt((np.cross(away, unit) ** 2).sum(axis=1)))


def _pixels(values: npt.ArrayLike, which: str) -> FloatArray:
    pixels = np.asarray(values, dtype=np.float64)
    if pixels.ndim != 2 or pixels.shape[1] != 2:
        raise InputError(f"epipolar residuals: the {which} pixels have shape {pixels.shape}, not (n, 2).")
    wrong = np.flatnonzero(~np.isfinite(pixels).all(axis=1))
    if wrong.size:
        raise InputError(f"epipolar residuals: {which} pixel of index {wrong[0]} is not finite.")
    return pixels
