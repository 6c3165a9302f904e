"""Resection without calibration: pose and interior orientation of each image, from six control points.

The linear map (eleven parameters) is the least singular vector of the usual equations, in coordinates that
are centred and scaled; its factors are F, principal point, b1 and b2, and the pose. Another degree of
distortion is then found by least squares on the colinearity equations, one camera per image.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace

import numpy as np
from scipy.linalg import rq

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera, median_camera
from obseq.images.control import ControlPoints
from obseq.images.initial.distribution import spread_indices
from obseq.images.measures import ImagePoints
from obseq.images.names import index_of
from obseq.images.poses import Poses

LEAST_POINTS = 6
FLAT = 0.01
"""Below this planarity (MMVII's `MinPlane11P`), points are in a plane for eleven parameters."""
NEARLY_FLAT = 0.05
"""Below this one they are nearly in a plane: the result may be worth little, and it is said."""


@dataclass(frozen=True, eq=False)
class UncalibratedResection:
    """Poses, and a camera per image, named after the images.

    Attributes:
        poses: of the images.
        cameras: by image.
        rms: (n,) quadratic mean of the residuals' lengths, pixels.
        planarity: by image, of its control points (see `Distribution`): 0 in a plane.
    """

    poses: Poses
    cameras: dict[str, Camera]
    rms: FloatArray
    planarity: dict[str, float] = field(default_factory=dict)

    @property
    def nearly_flat(self) -> tuple[str, ...]:
        """Images whose control points are nearly in a plane: focal length and pose are weak there."""
        return tuple(image for image, value in self.planarity.items() if value < NEARLY_FLAT)

    def medians(self, groups: Mapping[str, Sequence[str]]) -> dict[str, Camera]:
        """The median camera of groups of images, by name of the group (MMVII's shared calibrations)."""
        return {
            name: median_camera([self.cameras[image] for image in images], name)
            for name, images in groups.items()
        }


def resect_uncalibrated(
    measures: ImagePoints,
    control: ControlPoints,
    size: tuple[int, int],
    degree: tuple[int, int, int] | None = None,
    frozen: str | None = None,
    principal_point: tuple[float, float] | None = None,
) -> UncalibratedResection:
    """The poses and calibrations of images, each by itself.

    Args:
        measures: points in images; those that are no control points are left aside.
        control: known points, taken as they are.
        size: columns and lines of the images.
        degree: of the distortion; None for the linear map (degree (0, 0, 1)).
        frozen: pattern of parameters that stay as the linear map has them, distortion zero.
        principal_point: shares of columns and lines where it is held, (0.5, 0.5) in the middle; None: found.

    Raises:
        InputError: an image has fewer than six control points, or they are in a plane, or so near to one that
            nothing is found.
    """
    known = measures.of_points(control.names)
    ground = control.coordinates[index_of(control.names, known.point_names, "control point")]
    rows = {image: _rows_of(known, image) for image in measures.image_names}
    planarity = {image: _planarity(image, ground[known.point[part]]) for image, part in rows.items()}
    with _naming_planes(planarity):
        found = {
            image: _linear(image, known.xy[part], ground[known.point[part]], size)
            for image, part in rows.items()
        }
        start = _start(found, degree or (0, 0, 1), size, principal_point)
        if principal_point is not None:
            frozen = f"{frozen}|PP[xy]" if frozen else "PP[xy]"
        return replace(_refined(known, control, *start, frozen), planarity=planarity)


def _rows_of(known: ImagePoints, image: str) -> IntArray:
    if image not in known.image_names:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(known.image == known.image_names.index(image))


@contextmanager
def _naming_planes(planarity: Mapping[str, float]) -> Iterator[None]:
    """Says with whatever fails which images have their control points nearly in a plane."""
    try:
        yield
    except (ObseqError, np.linalg.LinAlgError) as error:
        flat = [
            f"{image} (planarity {value:.2g})" for image, value in planarity.items() if value < NEARLY_FLAT
        ]
        if not flat:
            raise
        raise InputError(
            f"image {', '.join(flat)}: the control points are nearly in a plane, which hardly determines "
            f"eleven parameters; add points off the plane, use a calibration, or resect_on_plane ({error})"
        ) from error


def _start(
    found: Mapping[str, tuple[Camera, FloatArray, FloatArray]],
    degree: tuple[int, int, int],
    size: tuple[int, int],
    principal_point: tuple[float, float] | None,
) -> tuple[Poses, dict[str, Camera]]:
    """Poses and cameras of linear maps, with the degree and the principal point that are wanted."""
    cameras = {image: camera for image, (camera, _, _) in found.items()}
    poses = Poses.of(
        list(found),
        [centre for _, centre, _ in found.values()],
        [rotation for _, _, rotation in found.values()],
        cameras=[camera.name for camera in cameras.values()],
    )
    start = {image: _with_degree(camera, degree) for image, camera in cameras.items()}
    if principal_point is not None:
        middle = np.array(size) * np.array(principal_point)
        start = {image: replace(camera, principal_point=middle) for image, camera in start.items()}
    return poses, start


def _with_degree(camera: Camera, degree: tuple[int, int, int]) -> Camera:
    """The camera with other degrees: b1 and b2 stay where there is room for them, all else is zero."""
    given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    kept = given if degree[2] >= 1 else {}
    return Camera(
        camera.name, camera.width, camera.height, camera.focal, camera.principal_point, degree, kept
    )


def _planarity(image: str, ground: FloatArray) -> float:
    """The planarity of the control points of an image, which must be enough and not in a plane."""
    _, planarity = spread_indices(ground)
    if len(ground) < LEAST_POINTS:
        raise InputError(
            f"image {image}: {len(ground)} control points; eleven parameters take {LEAST_POINTS} or more"
        )
    if not planarity > FLAT:
        raise InputError(
            f"image {image}: its {len(ground)} control points are in a plane, which leaves eleven parameters "
            "undetermined; add points off the plane, use a calibration, or resect_on_plane"
        )
    return planarity


def _linear(
    image: str, xy: FloatArray, ground: FloatArray, size: tuple[int, int]
) -> tuple[Camera, FloatArray, FloatArray]:
    """Camera, centre and rotation of the linear map from ground to image."""
    middle, scale = _frame(ground)
    projection = _projection(xy, (ground - middle) / scale)
    matrix = projection[:, :3] / scale
    matrix = matrix * np.sign(np.linalg.det(matrix))
    projection = projection * np.sign(np.linalg.det(projection[:, :3]))
    centre = middle - scale * np.linalg.solve(projection[:, :3], projection[:, 3])
    interior, turn = rq(matrix)
    signs = np.sign(np.diagonal(interior))
    interior, turn = interior * signs, turn * signs[:, None]
    interior = interior / interior[2, 2]
    focal = interior[1, 1]
    given = {"b1": interior[0, 0] / focal - 1.0, "b2": interior[0, 1] / focal}
    camera = Camera(image, *size, float(focal), interior[:2, 2], (0, 0, 1), given)
    return camera, centre, turn.T


def _projection(xy: FloatArray, ground: FloatArray) -> FloatArray:
    """(3, 4) the linear map of least algebraic error, from points (n, 3) to pixels (n, 2)."""
    middle, scale = _frame(xy)
    u, v = ((xy - middle) / scale).T
    points = np.column_stack([ground, np.ones(len(ground))])
    nothing = np.zeros_like(points)
    rows = np.vstack(
        [
            np.hstack([points, nothing, -u[:, None] * points]),
            np.hstack([nothing, points, -v[:, None] * points]),
        ]
    )
    found = np.linalg.svd(rows)[2][-1].reshape(3, 4)
    back = np.array([[scale, 0.0, middle[0]], [0.0, scale, middle[1]], [0.0, 0.0, 1.0]])
    return np.asarray(back @ found)


def _frame(points: FloatArray) -> tuple[FloatArray, float]:
    """The middle of points and their mean distance to it."""
    middle = points.mean(axis=0)
    return middle, float(np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=1))))


def _refined(
    known: ImagePoints,
    control: ControlPoints,
    poses: Poses,
    cameras: dict[str, Camera],
    frozen: str | None,
) -> UncalibratedResection:
    """The same by least squares; images share nothing."""
    block = BundleAdjustment()
    block.add_cameras(*cameras.values())
    block.add_poses(poses)
    block.add_control_points(control.select(known.point_names).held())
    block.add_measures(known)
    if frozen:
        block.freeze_parameters(frozen)
    solution = block.solve(covariance=False)
    return UncalibratedResection(
        solution.poses,
        {image: solution.cameras[cameras[image].name] for image in solution.poses.images},
        solution.by_image().rms,
    )
