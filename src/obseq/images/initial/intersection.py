"""Intersection of rays: points from images whose poses and calibrations are known.

First the point closest to all rays in space, then, from there, the least reprojection error: otherwise far
images would count as much as near ones. Each point has its own covariance.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.geometry import inverse3, sums_by_owner
from obseq.images.camera import Camera
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of
from obseq.images.poses import Poses

PARALLEL = 1e-10
"""Mean squared sine of the angles between rays below which they are parallel."""
STEPS = 15
TOLERANCE = 1e-6
"""Pixels: steps that move no image farther end the iterations; each is far smaller than the one before it."""
ROUNDING = 1e-12
"""Share of a sum of squares by which a step may make it larger: rounding, where the step is none any more."""


@dataclass(frozen=True, eq=False)
class Intersection:
    """Points by intersection of rays, and those that cannot be.

    Attributes:
        names: (n,) names of the points of the measures.
        coordinates: (n, 3); NaN where a point is not placed.
        covariances: (n, 3, 3) a priori, from the sigmas of the measures, poses and cameras being exact.
        n_rays: (n,) rays of each.
        reasons: (n,) why a point is not placed; empty where it is.
        residuals: (m, 2) computed minus measured, pixels; NaN where the point is not placed.
        directions: (m, 3) unit vectors of the rays in the world; NaN where none can be formed.
    """

    names: tuple[str, ...]
    coordinates: FloatArray
    covariances: FloatArray
    n_rays: IntArray
    reasons: tuple[str, ...]
    residuals: FloatArray
    directions: FloatArray

    @property
    def is_placed(self) -> BoolArray:
        """(n,) whether a point has coordinates."""
        return np.asarray(np.isfinite(self.coordinates).all(axis=1))


@dataclass(frozen=True, eq=False)
class _Rays:
    """Measures with the poses and cameras of their images, by row."""

    measures: ImagePoints
    centres: FloatArray
    rotations: FloatArray
    groups: list[tuple[Camera, IntArray | slice]]

    @classmethod
    def of(cls, measures: ImagePoints, poses: Poses, cameras: Sequence[Camera]) -> _Rays:
        row_of = index_of(poses.images, measures.image_names, "poses: image")[measures.image]
        return cls(measures, poses.centres[row_of], poses.rotations[row_of], _by_camera(cameras, row_of))

    def directions(self) -> FloatArray:
        """(m, 3) unit directions of the rays in the world."""
        local = np.empty((len(self.measures), 3))
        for camera, rows in self.groups:
            local[rows] = camera.directions(self.measures.xy[rows])
        return np.asarray((self.rotations @ local[:, :, None])[:, :, 0])

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (m, 2) and derivatives (m, 2, 3) for the point of each ray, divided by the sigmas."""
        arms = points[self.measures.point] - self.centres
        local = (arms[:, None, :] @ self.rotations)[:, 0]
        residuals, jacobian = np.empty((len(local), 2)), np.empty((len(local), 2, 3))
        for camera, rows in self.groups:
            residuals[rows], jacobian[rows] = camera.project_with_jacobian(local[rows])
        turned = jacobian @ np.swapaxes(self.rotations, 1, 2)
        sigmas = self.measures.sigmas
        return (residuals - self.measures.xy) / sigmas, turned / sigmas[:, :, None]

    def in_front(self, points: FloatArray) -> BoolArray:
        """(m,) whether the point of each ray is where its camera can see it."""
        local = ((points[self.measures.point] - self.centres)[:, None, :] @ self.rotations)[:, 0]
        seen = np.empty(len(local), dtype=bool)
        for camera, rows in self.groups:
            seen[rows] = camera.is_in_front(local[rows])
        return seen


def intersect(measures: ImagePoints, poses: Poses, cameras: Sequence[Camera]) -> Intersection:
    """The points that measures name, from known poses and cameras.

    Args:
        measures: of at least two images per point, or the point is not placed.
        poses: of all images of the measures.
        cameras: camera of each image of `poses`.

    Raises:
        InputError: an image has no pose.
    """
    rays = _Rays.of(measures, poses, cameras)
    n = len(measures.point_names)
    counts = np.bincount(measures.point, minlength=n)
    with np.errstate(invalid="ignore", divide="ignore"):
        directions = rays.directions()
        start, spread = closest_to_rays(rays.centres, directions, measures.point, n)
        reasons = np.where(spread <= PARALLEL, "its rays are parallel", "").astype(object)
        reasons[~np.isfinite(spread)] = "a ray cannot be formed: the distortion has no inverse there"
        reasons[counts < 2] = "fewer than two rays"
        start[reasons != ""] = np.nan
        points, covariances, residuals = _refined(rays, start)
        behind = np.unique(measures.point[~rays.in_front(points) & np.isfinite(points[measures.point, 0])])
        reasons[behind] = "its rays meet behind a camera"
        lost = ~np.isfinite(points).all(axis=1) & (reasons == "")
        reasons[lost] = "its rays do not meet"
        lost = reasons != ""
        points[lost], covariances[lost], residuals[lost[measures.point]] = np.nan, np.nan, np.nan
    residuals *= measures.sigmas
    return Intersection(
        measures.point_names, points, covariances, counts, tuple(reasons), residuals, directions
    )


def elsewhere(
    measures: ImagePoints, poses: Poses, cameras: Sequence[Camera], known: FloatArray, limit: float
) -> tuple[IntArray, FloatArray]:
    """The points whose rays meet within a limit (pixels), but pass where the points are known by more.

    Args:
        measures: rays of the points.
        poses: of all images of the measures.
        cameras: camera of each image of `poses`.
        known: (n, 3) where the points are known to be.
        limit: pixels.

    Returns:
        (k,) numbers of such points, and (k, 3) where their rays meet.
    """
    rays = _Rays.of(measures, poses, cameras)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        missed = np.linalg.norm(rays.project(known)[0] * measures.sigmas, axis=1)
    missed[~rays.in_front(known)] = np.inf
    is_far = np.zeros(len(known), dtype=bool)
    is_far[measures.point[~(missed <= limit)]] = True
    if not is_far.any():
        return np.zeros(0, np.int64), np.zeros((0, 3))
    own = measures.rows(is_far[measures.point])
    found = intersect(own, poses, cameras)
    worst = np.zeros(len(own.point_names))
    np.maximum.at(worst, own.point, np.nan_to_num(np.linalg.norm(found.residuals, axis=1), nan=np.inf))
    met = worst <= limit
    names = list(itertools.compress(found.names, met.tolist()))
    return index_of(measures.point_names, names, "point"), found.coordinates[met]


def _by_camera(cameras: Sequence[Camera], image: IntArray) -> list[tuple[Camera, IntArray | slice]]:
    """Cameras and their rows, of rows that say an image; all rows at once where there is one camera."""
    _, first, number = np.unique([id(camera) for camera in cameras], return_index=True, return_inverse=True)
    if len(first) == 1:
        return [(cameras[0], slice(None))]
    return [(cameras[k], np.flatnonzero(number[image] == j)) for j, k in enumerate(first)]


def closest_to_rays(
    centres: FloatArray, directions: FloatArray, point: IntArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """Points (n, 3) with the least sum of squared distances to their rays.

    Args:
        centres: (m, 3) a point of each ray.
        directions: (m, 3) unit vectors.
        point: (m,) which point a ray belongs to.
        n: number of points.

    Returns:
        The points, and (n,) how well they are determined: the mean squared sine of the angles of the rays to
        the direction that is closest to all of them; 0 for parallel rays.
    """
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    reference = sums_by_owner(centres, point, n) / np.maximum(np.bincount(point, minlength=n), 1)[:, None]
    normal = sums_by_owner(across, point, n)
    right = sums_by_owner((across @ (centres - reference[point])[:, :, None])[:, :, 0], point, n)
    sound = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    spread = np.full(n, np.nan)
    counts = np.maximum(np.bincount(point, minlength=n), 1)
    spread[sound] = np.linalg.eigvalsh(normal[sound])[:, 0] / counts[sound]
    found = reference + (inverse3(normal) @ right[:, :, None])[:, :, 0]
    return found, spread


def _refined(rays: _Rays, start: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points of least reprojection error, their covariances, and residuals (m, 2) divided by the sigmas.

    A step that makes the error of a point larger is shortened.
    """
    points, point = start.copy(), rays.measures.point
    residuals, jacobian = rays.project(points)
    cost = _costs(rays, residuals, len(points))
    share = np.ones(len(points))
    for _ in range(STEPS):
        normal, gradient = _normals(rays, residuals, jacobian, len(points))
        step = -(inverse3(normal) @ gradient[:, :, None])[:, :, 0]
        trial = points + share[:, None] * step
        residuals_there, jacobian_there = rays.project(trial)
        cost_there = _costs(rays, residuals_there, len(points))
        better = cost_there <= cost * (1.0 + ROUNDING)
        if better.all():
            points, cost, residuals, jacobian = trial, cost_there, residuals_there, jacobian_there
        else:
            kept = better[point]
            for now, there in ((points, trial), (cost, cost_there)):
                now[better] = there[better]
            for now, there in ((residuals, residuals_there), (jacobian, jacobian_there)):
                now[kept] = there[kept]
        share = np.where(better, 1.0, 0.25 * share)
        moved = np.abs((jacobian @ step[point][:, :, None])[:, :, 0] * rays.measures.sigmas)
        if np.fmax.reduce(moved, axis=None, initial=0.0) <= TOLERANCE:
            break
    return points, inverse3(_normals(rays, residuals, jacobian, len(points))[0]), residuals


def _costs(rays: _Rays, residuals: FloatArray, n: int) -> FloatArray:
    x, y = residuals.T
    return np.bincount(rays.measures.point, x * x + y * y, n).astype(np.float64)


def _normals(
    rays: _Rays, residuals: FloatArray, jacobian: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """Normal matrices (n, 3, 3) of the points, and half the gradients (n, 3) of their sums of squares."""
    both = np.concatenate([jacobian, residuals[:, :, None]], axis=2)
    sums = sums_by_owner(np.swapaxes(jacobian, 1, 2) @ both, rays.measures.point, n)
    return sums[:, :, :3], sums[:, :, 3]
