"""Circles in space and their images: the true centre, the ellipse's, and names for spots without code."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.targets.measures import UNCODED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.geometry import RigidMotion
    from obseq.images import Camera, ControlPoints
    from obseq.targets.measures import Measure


def eccentricity(camera: Camera, centre: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """(2,) the centre of the ellipse minus the image of the centre of a circle, pixels.

    The dual conic of the circle is `radius^2 (I - n n') - C C'`; the ellipse's centre is the pole of the line
    at infinity.

    Args:
        camera: that sees it.
        centre: (3,) in its frame.
        normal: (3,) of the plane of the circle, of any length.
        radius: in the unit of the centre.

    Raises:
        InputError: the circle is not in front of the camera.
    """
    n = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    c = np.asarray(centre, dtype=float)
    dual = radius**2 * (np.eye(3) - np.outer(n, n)) - np.outer(c, c)
    if c[2] <= 0.0 or dual[2, 2] >= 0.0:
        raise InputError("a circle that is not in front of the camera has no ellipse")
    pole = np.array([dual[0, 2] / dual[2, 2], dual[1, 2] / dual[2, 2], 1.0])
    seen = camera.project(np.stack([pole, c]))
    found: FloatArray = seen[0] - seen[1]
    return found


def completed(
    measures: Sequence[Measure],
    camera: Camera,
    pose: RigidMotion,
    points: ControlPoints,
    threshold: float,
) -> list[Measure]:
    """The measures of one image, in which spots without code have the names of the points they are images of.

    A spot gets a name where it is the nearest of all to where a point without measure should be seen, and
    that point is the nearest to it.

    Args:
        measures: of the image.
        camera: of the image.
        pose: of the image: `X_world = centre + rotation x_camera`.
        points: in the world.
        threshold: largest distance of a spot from where its point should be, pixels.
    """
    known = {one.point for one in measures}
    free = [k for k, name in enumerate(points.names) if name not in known]
    spots = [k for k, one in enumerate(measures) if one.point.startswith(UNCODED)]
    if not free or not spots:
        return list(measures)
    places = (points.coordinates[free] - pose.centre) @ pose.rotation
    pixels = np.where(camera.sees(places)[:, None], camera.project(places), np.inf)
    away = np.hypot(*np.moveaxis(pixels[:, None] - np.array([measures[k].xy for k in spots]), 2, 0))
    found = list(measures)
    for row, k in enumerate(free):
        spot = int(np.argmin(away[row]))
        if away[row, spot] <= threshold and int(np.argmin(away[:, spot])) == row:
            found[spots[spot]] = replace(found[spots[spot]], point=points.names[k])
    return found
