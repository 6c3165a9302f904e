"""Resection: the poses of images from control points, starting from nothing.

Per image: three-point resections of many triplets, the one chosen whose weighted mean angle to all points is
least, gross errors left out; then all poses together by least squares on the colinearity equations, with
points and calibrations as they are given.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.initial.distribution import check_spread
from obseq.images.initial.three_points import poses_of_triplets
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of
from obseq.images.poses import Poses
from obseq.kernels.loading import Kernel
from obseq.leastsquares import LeastSquares, LeastSquaresResult

LEAST_POINTS = 4
TIMES_MEDIAN = 10.0
"""Residuals above this many medians, and above `LEAST_GROSS`, are gross errors."""
LEAST_GROSS = 3.0
"""Pixels."""
APART = 0.1
"""Two poses are different solutions when their rotations differ by this (radians), or their centres by this
share of the distance to the points."""
AMBIGUOUS = 1.05
"""A different solution whose score is within this factor of the best makes the image ambiguous."""


@dataclass(frozen=True)
class ResectionOptions:
    """How poses are searched and refined.

    Attributes:
        triplets: most triplets tried per image; all there are when these are fewer.
        max_error: pixels; an image whose median residual after the search is above is refused.
        seed: of the choice of triplets: the same seed gives the same poses.
        max_iterations: of the refinement.
        covariance: False where no precision of the poses will be asked for.
    """

    triplets: int = 500
    max_error: float = 20.0
    seed: int = 0
    max_iterations: int = 20
    covariance: bool = True


@dataclass(frozen=True, eq=False)
class Resection:
    """Poses found by resection, and what was left out.

    Attributes:
        poses: of the images, in the order of the measures.
        covariances: (n, 6, 6) of centre and small rotation, with the given sigmas of the measures (a priori);
            NaN where they were not asked for.
        sigma0: (n,) unit-weight estimate per image; NaN without redundancy.
        measures: the measures that were used: those of control points.
        residuals: (m, 2) computed minus measured, pixels, of all of them.
        is_used: (m,) False for gross errors.
        second_scores: (n,) score of the best different solution over that of the one chosen; infinite when
            there is none. Close to 1, the choice is fragile.
    """

    poses: Poses
    covariances: FloatArray
    sigma0: FloatArray
    measures: ImagePoints
    residuals: FloatArray
    is_used: BoolArray
    second_scores: FloatArray


def resect(
    measures: ImagePoints,
    control: ControlPoints,
    cameras: Mapping[str, Camera] | Camera,
    options: ResectionOptions | None = None,
) -> Resection:
    """The poses of the images that measures name, with calibrated cameras, from control points.

    Args:
        measures: points measured in the images; those that are no control points are left aside.
        control: known points; held or not, they are taken as they are.
        cameras: camera of each image by name, or the one of all.
        options: of the search and the refinement.

    Raises:
        InputError: an image has fewer than four control points, or these are on a line; it has no camera; no
            pose comes near its measures; or two poses fit it alike.
    """
    chosen = options or ResectionOptions()
    known = measures.of_points(control.names)
    per_image = _cameras_of(measures.image_names, cameras)
    _check_counts(measures, known, control)
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")][known.point]
    order = index_of(known.image_names, measures.image_names, "image")
    searches = [
        _search(known, np.flatnonzero(known.image == number), ground, per_image[k], chosen)
        for k, number in enumerate(order)
    ]
    is_used = np.zeros(len(known), dtype=bool)
    for rows, _, _, used in searches:
        is_used[rows] = used
    start = Poses.of(
        measures.image_names,
        [pose.centre for _, pose, _, _ in searches],
        [pose.rotation for _, pose, _, _ in searches],
        cameras=[camera.name for camera in per_image],
    )
    refined = refine_poses(start, known, ground, per_image, is_used, chosen.max_iterations, chosen.covariance)
    second = np.array([ratio for _, _, ratio, _ in searches])
    return Resection(*refined[:3], known, *refined[3:], is_used, second)


def _cameras_of(images: Sequence[str], cameras: Mapping[str, Camera] | Camera) -> list[Camera]:
    if isinstance(cameras, Camera):
        return [cameras] * len(images)
    missing = [image for image in images if image not in cameras]
    if missing:
        raise InputError(f"image {missing[0]}: it has no camera; add its calibration")
    return [cameras[image] for image in images]


def _check_counts(measures: ImagePoints, known: ImagePoints, control: ControlPoints) -> None:
    seen = dict(zip(known.image_names, np.bincount(known.image), strict=True)) if len(known) else {}
    for image in measures.image_names:
        n = int(seen.get(image, 0))
        if n < LEAST_POINTS:
            raise InputError(
                f"image {image}: {n} of its points are control points; a resection takes {LEAST_POINTS} "
                f"or more ({len(control)} control points are known)"
            )


# The search, image by image


def _search(
    known: ImagePoints, rows: IntArray, ground: FloatArray, camera: Camera, options: ResectionOptions
) -> tuple[IntArray, RigidMotion, float, BoolArray]:
    """Rows of an image, its pose, score of the second solution over that of the first, rows to be used."""
    image = known.image_names[known.image[rows[0]]]
    points = ground[rows]
    check_spread(points, f"image {image}")
    rays = camera.directions(known.xy[rows])
    if np.isnan(rays).any():
        row = rows[np.flatnonzero(np.isnan(rays).any(axis=1))[0]]
        raise InputError(
            f"{known.label(row)}: the distortion of camera {camera.name} cannot be inverted there"
        )
    triplets = _triplets(len(rows), options)
    found, _ = poses_of_triplets(rays[triplets], points[triplets])
    sound = np.isfinite(found.centre).all(axis=1) & np.isfinite(found.rotation).all(axis=(1, 2))
    found = RigidMotion(found.centre[sound], found.rotation[sound])
    if not len(found.centre):
        raise InputError(f"image {image}: no pose sees three of its points in the measured directions")
    scores = _scores(found, rays, points)
    best = int(np.argmin(scores))
    pose = RigidMotion(found.centre[best], found.rotation[best])
    second = _second_score(found, scores, pose, points)
    errors = camera.focal * _angles(RigidMotion(pose.centre[None], pose.rotation[None]), rays, points)[0]
    _check_fit(image, camera, errors, second, options)
    used = errors <= max(LEAST_GROSS, TIMES_MEDIAN * float(np.median(errors)))
    return rows, pose, second, used


def _triplets(n: int, options: ResectionOptions) -> IntArray:
    """(k, 3) different triplets of n points, all of them or a random choice."""
    if math.comb(n, 3) <= options.triplets:
        return np.array(list(itertools.combinations(range(n), 3)))
    rng = np.random.default_rng(options.seed)
    drawn = np.sort(np.argsort(rng.random((2 * options.triplets, n)), axis=1)[:, :3], axis=1)
    return np.asarray(np.unique(drawn, axis=0)[: options.triplets])


def _angles(poses: RigidMotion, rays: FloatArray, points: FloatArray) -> FloatArray:
    """(k, n) distances of unit vectors: measured rays, and rays to the points, in each of k poses."""
    sights = points - poses.centre[:, None, :]
    sights /= np.linalg.norm(sights, axis=2, keepdims=True)
    turned = rays @ np.swapaxes(poses.rotation, 1, 2)
    return np.asarray(np.linalg.norm(turned - sights, axis=2))


def _scores(poses: RigidMotion, rays: FloatArray, points: FloatArray) -> FloatArray:
    """(k,) mean angles of the poses, the larger ones counting less: as good as half of the points is good."""
    scores = np.empty(len(poses.centre))
    n = len(points)
    weights = 1.0 + np.cos(np.pi * (np.arange(n) + 0.5) / n)
    step = max(1, 1_000_000 // n)
    for first in range(0, len(scores), step):
        part = slice(first, first + step)
        errors = np.sort(_angles(RigidMotion(poses.centre[part], poses.rotation[part]), rays, points), axis=1)
        scores[part] = errors @ weights / weights.sum()
    return scores


def _second_score(found: RigidMotion, scores: FloatArray, pose: RigidMotion, points: FloatArray) -> float:
    """The best score of a different solution, over the best of all."""
    distance = float(np.linalg.norm(points.mean(axis=0) - pose.centre))
    moved = np.linalg.norm(found.centre - pose.centre, axis=1) > APART * distance
    turned = np.linalg.norm(found.rotation - pose.rotation, axis=(1, 2)) > np.sqrt(2.0) * APART
    others = scores[moved | turned]
    least = max(float(scores.min()), 1e-12)
    return float(others.min()) / least if others.size else math.inf


def _check_fit(
    image: str, camera: Camera, errors: FloatArray, second: float, options: ResectionOptions
) -> None:
    middle = float(np.median(errors))
    if not middle <= options.max_error:
        raise InputError(
            f"image {image}: the best pose leaves a median residual of {middle:.1f} pixels; look for wrong "
            f"point names, a wrong camera ({camera.name}, focal length {camera.focal:g} pixels), "
            "a distortion that is not zero, lines that were counted upwards (y goes down here), or control "
            "points whose x and y are exchanged"
        )
    if second < AMBIGUOUS:
        raise InputError(
            f"image {image}: two different poses fit its points alike (within {second - 1:.1%}); add a point "
            "away from the plane of the others, or give its pose"
        )


# The refinement, all images at once


def refine_poses(
    start: Poses,
    measures: ImagePoints,
    ground: FloatArray,
    cameras: Sequence[Camera],
    is_used: BoolArray,
    max_iterations: int = 20,
    covariance: bool = True,
) -> tuple[Poses, FloatArray, FloatArray, FloatArray]:
    """Poses by least squares, with points and calibrations as they are.

    Args:
        start: poses of images.
        measures: points in these images.
        ground: (n, 3) world coordinates of each measure.
        cameras: camera of each image of `start`.
        is_used: (n,) False for measures without influence.
        max_iterations: no more than these.
        covariance: False for NaN instead of covariances.

    Returns:
        Poses, (k, 6, 6) a-priori covariances, (k,) sigma0 per image, (n, 2) residuals.
    """
    system = LeastSquares()
    image = index_of(start.images, measures.image_names, "image")[measures.image]
    centres = system.add_points([f"{name} centre" for name in start.images], start.centres)
    rotations = system.add_rotations(start.images, start.rotations)
    points = system.add_points([f"row {k}" for k in range(len(ground))], ground)
    system.freeze(points)
    residuals = np.zeros((len(measures), 2))
    batches = []
    for formula, rows in _by_formula(cameras, image):
        calibrations = _frozen_calibrations(system, cameras, image[rows])
        blocks = {
            "point": points[rows],
            "camera.centre": centres[image[rows]],
            "camera.rotation": rotations[image[rows]],
            "calibration": calibrations,
        }
        labels = [measures.label(row) for row in rows]
        batch = system.add(
            formula, blocks, measures.xy[rows], measures.sigmas[rows], labels, active=is_used[rows]
        )
        batches.append((rows, batch))
    result = system.solve(max_iterations=max_iterations, covariance=covariance)
    for rows, batch in batches:
        residuals[rows] = result.residuals(batch)
    poses = Poses.of(start.images, result.values(centres), result.values(rotations), cameras=start.cameras)
    covariances = np.full((len(start), 6, 6), np.nan)
    if covariance:
        covariances = _pose_covariances(result, centres, rotations)
    squares = np.sum(np.square(residuals / measures.sigmas), axis=1) * is_used
    return poses, covariances, _sigma0(squares, image, is_used, len(start)), residuals


def _by_formula(cameras: Sequence[Camera], image: IntArray) -> list[tuple[str | Kernel, IntArray]]:
    """The colinearity equations of the cameras, and the rows of measures of each."""
    names = [camera.formula for camera in cameras]
    equations = {camera.formula: camera.equation for camera in cameras}
    number = index_of(list(equations), names, "formula")[image]
    return [(equation, np.flatnonzero(number == k)) for k, equation in enumerate(equations.values())]


def _frozen_calibrations(system: LeastSquares, cameras: Sequence[Camera], image: IntArray) -> IntArray:
    """(n,) blocks of the calibrations of measures, all of one model."""
    here = {id(cameras[number]): cameras[number] for number in np.unique(image)}
    names = [f"{camera.name} ({k})" for k, camera in enumerate(here.values())]
    values = [camera.parameters for camera in here.values()]
    ids = system.add_vectors(names, values, next(iter(here.values())).parameter_names)
    system.freeze(ids)
    block = dict(zip(here, ids, strict=True))
    return np.array([block.get(id(camera), -1) for camera in cameras])[image]


def _pose_covariances(result: LeastSquaresResult, centres: IntArray, rotations: IntArray) -> FloatArray:
    covariances = np.empty((len(centres), 6, 6))
    covariances[:, :3, :3] = result.covariance(centres, a_priori=True)
    covariances[:, 3:, 3:] = result.covariance(rotations, a_priori=True)
    for k, (centre, rotation) in enumerate(zip(centres, rotations, strict=True)):
        cross = result.covariance_between([centre], [rotation], a_priori=True)
        covariances[k, :3, 3:], covariances[k, 3:, :3] = cross, cross.T
    return covariances


def _sigma0(squares: FloatArray, image: IntArray, is_used: BoolArray, n: int) -> FloatArray:
    sums = np.bincount(image, squares, n)
    redundancy = 2.0 * np.bincount(image, is_used, n) - 6.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(np.where(redundancy > 0.0, sums / redundancy, np.nan))
