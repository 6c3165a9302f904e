"""Resection on a plane: poses and the focal length of a camera from images of points in one plane.

Each image of a plane is a homography H, from plane coordinates to pixels about the principal point, which is
the middle of the image here. With K = diag(f, f, 1) its columns are K [r1 r2 t] up to a factor, r1 and r2
being two axes at right angles and of one length:

    (h1x h2x + h1y h2y) / f^2 + h1z h2z = 0
    (h1x^2 + h1y^2 - h2x^2 - h2y^2) / f^2 + h1z^2 - h2z^2 = 0

linear in 1/f^2 for all images together (Zhang, 2000). Images that look straight at the plane say nothing of
f.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import RigidMotion, closest_rotation
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.initial.distribution import check_spread, spread_indices
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of
from obseq.images.poses import Poses

LEAST_POINTS = 4
FLAT = 0.02
"""Planarity up to which points count as being in a plane: a start takes no more."""
LEAST_OBLIQUE = 1e-9
"""Size of the coefficients of 1/f^2, of homographies of unit size, below which they vanish."""
WORST_FOCAL = 0.2
"""Share of the focal length that its sigma may be."""
STRAIGHT = (
    "the images look straight at the plane of the control points, which leaves the focal length "
    "undetermined; take some obliquely, or give a calibration"
)


@dataclass(frozen=True, eq=False)
class PlaneResection:
    """Poses and camera found on a plane.

    Attributes:
        poses: of the images.
        camera: of all of them.
        rms: (n,) quadratic mean of the residuals' lengths per image, pixels.
    """

    poses: Poses
    camera: Camera
    rms: FloatArray


def resect_on_plane(
    measures: ImagePoints,
    control: ControlPoints,
    size: tuple[int, int],
    name: str = "camera",
    degree: tuple[int, int, int] = (3, 1, 1),
    free: str = "F",
) -> PlaneResection:
    """The poses of images of a plane and the focal length of the camera that took them all.

    Args:
        measures: points in images; those that are no control points are left aside.
        control: known points of one plane, taken as they are.
        size: columns and lines of the images.
        name: of the camera.
        degree: of its distortion, which is zero unless it is freed.
        free: pattern of the parameters that least squares find in the end; the others stay: the principal
            point in the middle of the image, the distortion zero.

    Raises:
        InputError: an image has fewer than four control points, or they are on a line, or not in a plane; no
            image sees the plane obliquely.
    """
    known = measures.of_points(control.names)
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")]
    middle, axes = _plane(ground)
    flat = ((ground - middle) @ axes.T)[:, :2]
    found = {}
    for image in measures.image_names:
        part = known.of_image(image) if image in known.image_names else known.rows([])
        rows = index_of(known.point_names, [part.point_names[k] for k in part.point], "control point")
        _check(image, ground[rows])
        found[image] = homography(flat[rows], part.xy - np.array(size) / 2.0)
    focal = focal_length(np.array(list(found.values())))
    poses = [_pose(matrix, focal, middle, axes) for matrix in found.values()]
    camera = Camera(name, *size, focal, degree=degree)
    return _refined(known, control, list(found), poses, camera, free)


def homography(plane: FloatArray, pixels: FloatArray) -> FloatArray:
    """(3, 3) map of least algebraic error from plane coordinates (n, 2) to pixels (n, 2), of determinant > 0.

    Its sign is the one that has the points in front: the third row is positive on them.
    """
    (a, scale_a), (b, scale_b) = _normalised(plane), _normalised(pixels)
    points = np.column_stack([a, np.ones(len(a))])
    nothing = np.zeros_like(points)
    rows = np.vstack(
        [
            np.hstack([points, nothing, -b[:, :1] * points]),
            np.hstack([nothing, points, -b[:, 1:] * points]),
        ]
    )
    inner = np.linalg.svd(rows)[2][-1].reshape(3, 3)
    found = np.linalg.inv(scale_b) @ inner @ scale_a
    front = np.column_stack([plane, np.ones(len(plane))]) @ found[2]
    return np.asarray(found * np.sign(np.median(front)) / np.linalg.norm(found))


def focal_length(homographies: FloatArray) -> float:
    """The focal length of one camera from homographies (k, 3, 3) to pixels about its principal point.

    Raises:
        InputError: they do not determine it.
    """
    h1, h2 = homographies[:, :, 0], homographies[:, :, 1]
    sizes = np.linalg.norm(homographies[:, :2, :2], axis=(1, 2)) ** 2
    factors = np.concatenate(
        [np.sum(h1[:, :2] * h2[:, :2], axis=1), np.sum(h1[:, :2] ** 2 - h2[:, :2] ** 2, axis=1)]
    ) / np.tile(sizes, 2)
    right = -np.concatenate([h1[:, 2] * h2[:, 2], h1[:, 2] ** 2 - h2[:, 2] ** 2]) / np.tile(sizes, 2)
    inverse = float(factors @ right) / max(float(factors @ factors), 1e-300)
    if np.abs(factors).max() < LEAST_OBLIQUE or not inverse > 0.0:
        raise InputError(STRAIGHT)
    return float(1.0 / np.sqrt(inverse))


def _plane(ground: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle of points (n, 3) and their axes (3, 3), rows, the normal last, right-handed."""
    if len(ground) < LEAST_POINTS:
        raise InputError(f"{len(ground)} control points are measured; a plane takes {LEAST_POINTS}")
    middle = ground.mean(axis=0)
    axes = np.linalg.svd(ground - middle)[2]
    return middle, axes * np.array([[1.0], [1.0], [np.sign(np.linalg.det(axes))]])


def _check(image: str, ground: FloatArray) -> None:
    if len(ground) < LEAST_POINTS:
        raise InputError(
            f"image {image}: {len(ground)} control points; a resection on a plane takes {LEAST_POINTS}"
        )
    check_spread(ground, f"image {image}")
    _, planarity = spread_indices(ground)
    if planarity > FLAT:
        raise InputError(
            f"image {image}: its control points are not in a plane (planarity {planarity:.3f}); use "
            "resect_uncalibrated, which needs them off it"
        )


def _normalised(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) about their middle, of unit spread, and the (3, 3) map that makes them so."""
    middle = points.mean(axis=0)
    size = np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=1)))
    change = np.array(
        [[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size], [0, 0, 1.0]]
    )
    return (points - middle) / size, change


def _pose(matrix: FloatArray, focal: float, middle: FloatArray, axes: FloatArray) -> RigidMotion:
    """The pose whose image of the plane is a homography."""
    columns = matrix / np.array([[focal], [focal], [1.0]])
    columns = columns * (2.0 / np.linalg.norm(columns[:, :2], axis=0).sum())
    first, second, shift = columns.T
    turn = closest_rotation(np.column_stack([first, second, np.cross(first, second)]))
    return RigidMotion(middle - axes.T @ (turn.T @ shift), (turn @ axes).T)


def _refined(
    known: ImagePoints,
    control: ControlPoints,
    images: list[str],
    poses: list[RigidMotion],
    camera: Camera,
    free: str,
) -> PlaneResection:
    """The same by least squares."""
    block = BundleAdjustment()
    block.add_cameras(camera)
    block.freeze_parameters()
    block.free_parameters(free)
    centres, rotations = [pose.centre for pose in poses], [pose.rotation for pose in poses]
    block.add_poses(Poses.of(images, centres, rotations, cameras=camera.name))
    block.add_control_points(control.select(known.point_names).held())
    block.add_measures(known)
    solution = block.solve()
    if solution.camera_precisions(camera.name)["F"] > WORST_FOCAL * camera.focal:
        raise InputError(STRAIGHT)
    return PlaneResection(solution.poses, solution.cameras[camera.name], solution.by_image().rms)
