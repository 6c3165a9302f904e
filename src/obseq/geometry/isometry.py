"""The rigid motion that takes points to their homologues."""

import numpy as np
import numpy.typing as npt

from obseq.arrays import FloatArray
from obseq.errors import DegenerateGeometryError
from obseq.geometry.poses import RigidMotion
from obseq.geometry.rotations import closest_rotation

COLLINEAR = 1e-6
"""Points whose width is below this fraction of their length are called collinear."""


def isometry(source: npt.ArrayLike, target: npt.ArrayLike) -> RigidMotion:
    """The pose that takes points `source` (n, 3) closest to `target` (n, 3), by least squares; n >= 3.

    target = rotation source + centre; no scale, no reflection. Singular value decomposition of the
    cross-covariance (Arun, Huang and Blostein 1987; Umeyama 1991 for the sign).

    Raises:
        DegenerateGeometryError: for fewer than 3 pairs, or if the points of one side are collinear.
    """
    start, end = _pairs(source, target)
    start_mean, end_mean = start.mean(axis=0), end.mean(axis=0)
    rotation = closest_rotation((end - end_mean).T @ (start - start_mean))
    return RigidMotion(end_mean - rotation @ start_mean, rotation)


def similarity(source: FloatArray, target: FloatArray) -> tuple[float, RigidMotion]:
    """Scale and motion that take points (n, 3), not on a line, closest to others (Umeyama, 1991)."""
    a, b = source - source.mean(axis=0), target - target.mean(axis=0)
    rotation = closest_rotation(b.T @ a)
    scale = float(np.sum((a @ rotation.T) * b) / np.sum(a * a))
    return scale, RigidMotion(target.mean(axis=0) - scale * rotation @ source.mean(axis=0), rotation)


def _pairs(source: npt.ArrayLike, target: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    start, end = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if start.shape != end.shape or start.ndim != 2 or start.shape[1] != 3:
        raise DegenerateGeometryError(
            f"A rigid motion needs pairs of points: two arrays (n, 3), not {start.shape} and {end.shape}."
        )
    if len(start) < 3:
        raise DegenerateGeometryError(f"A rigid motion needs three pairs of points, there are {len(start)}.")
    for points, side in ((start, "source"), (end, "target")):
        _check_spread(points, side)
    return start, end


def _check_spread(points: FloatArray, side: str) -> None:
    if not np.isfinite(points).all():
        raise DegenerateGeometryError(f"A {side} point of the rigid motion has no finite coordinates.")
    length, width, _ = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if width <= COLLINEAR * length:
        raise DegenerateGeometryError(
            f"The {len(points)} {side} points are on one line or at one place (length {length:.3g}, "
            f"width {width:.3g}): the rotation about it is not determined. Add a point beside the line."
        )
