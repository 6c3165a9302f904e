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


def triangle_isometry(source: npt.ArrayLike, target: npt.ArrayLike) -> RigidMotion:
    """The pose that takes the frame of one triangle (3, 3) to that of another, points in rows.

    It takes the first point to the first, the first side along the first side, and one plane to the other;
    it is exact if the triangles have equal sides (MMVII section 9.2: origin P0, x along P1 - P0, z along
    (P1 - P0) x (P2 - P1)).

    Raises:
        DegenerateGeometryError: if the points of one triangle are collinear.
    """
    start, end = _pairs(source, target)
    if len(start) != 3:
        raise DegenerateGeometryError(f"A triangle has three points, not {len(start)}.")
    return _triangle_frame(end) @ _triangle_frame(start).inverse()


def _triangle_frame(points: FloatArray) -> RigidMotion:
    along = points[1] - points[0]
    x = along / np.linalg.norm(along)
    normal = np.cross(along, points[2] - points[1])
    z = normal / np.linalg.norm(normal)
    return RigidMotion(points[0], np.stack([x, np.cross(z, x), z], axis=-1))


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
