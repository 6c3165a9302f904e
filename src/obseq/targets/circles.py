"""Circles in space and their images: the true centre, the ellipse's, and names for spots without code."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.targets.measures import UNCODED

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from obseq.arrays import FloatArray, FloatRows
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


HORIZONTAL = np.array([0.0, 0.0, 1.0])
"""Normal of the circles that the original corrects."""
SAME = 1e-3
"""Pixels within which a measure is the centre of its ellipse; else it is the true one already."""
AROUND = 48
"""Places of an ellipse that are carried to its plane."""


def radii_of(
    measures: Sequence[Measure],
    ellipses: Mapping[str, tuple[FloatArray, FloatRows]],
    camera: Camera,
    pose: RigidMotion,
    points: ControlPoints,
) -> list[float]:
    """The radii of the horizontal circles that the ellipses around known points are."""
    turns = np.arange(AROUND) * (2.0 * np.pi / AROUND)
    circle = np.column_stack((np.cos(turns), np.sin(turns)))
    found = []
    for _, place, (centre, shape) in _on_ellipses(measures, ellipses, points):
        rays = camera.directions(centre + circle @ np.linalg.cholesky(shape).T) @ pose.rotation.T
        away = pose.centre + rays * ((place - pose.centre)[2] / rays[:, 2:])
        x, y = (away - away.mean(axis=0))[:, :2].T
        area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
        found.append(math.sqrt(area / (0.5 * AROUND * math.sin(2.0 * math.pi / AROUND))))
    return found


def refined(
    measures: Sequence[Measure],
    ellipses: Mapping[str, tuple[FloatArray, FloatRows]],
    camera: Camera,
    pose: RigidMotion,
    points: ControlPoints,
    radius: float,
) -> list[Measure]:
    """Measures of one image, with the true centres of horizontal circles where they were those of ellipses.

    Args:
        measures: of the image.
        ellipses: of its central figures, by name.
        camera: of the image.
        pose: of the image: `X_world = centre + rotation x_camera`.
        points: in the world.
        radius: of the circles, in the unit of the points.
    """
    found = list(measures)
    normal = HORIZONTAL @ pose.rotation
    for k, place, _ in _on_ellipses(measures, ellipses, points):
        off = eccentricity(camera, (place - pose.centre) @ pose.rotation, normal, radius)
        found[k] = replace(found[k], xy=found[k].xy - off)
    return found


def _on_ellipses(
    measures: Sequence[Measure],
    ellipses: Mapping[str, tuple[FloatArray, FloatRows]],
    points: ControlPoints,
) -> Iterator[tuple[int, FloatArray, tuple[FloatArray, FloatRows]]]:
    """The measures of known points that are centres of ellipses: number, point, and ellipse."""
    known = dict(zip(points.names, points.coordinates, strict=True))
    for k, one in enumerate(measures):
        if one.point in known and one.point in ellipses:
            ellipse = ellipses[one.point]
            if np.abs(one.xy - ellipse[0]).max() < SAME:
                yield k, known[one.point], ellipse
