"""Bundle Adjustment in the Large: reading its files, and its camera as a formula."""

import functools
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import WORLD_TO_LOCAL, Point2, Point3, Rotation, Vector
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares


@dataclass(frozen=True)
class Problem:
    """Cameras (n, 9: rotation vector, translation, f, k1, k2), points (m, 3), and image coordinates."""

    cameras: np.ndarray
    points: np.ndarray
    camera_of: np.ndarray
    point_of: np.ndarray
    images: np.ndarray


class BalCamera(Formula):
    """A pixel of a camera that looks along -z, with two radial terms."""

    def residual(
        self,
        rotation: Annotated[Rotation, "W", "M", WORLD_TO_LOCAL],
        translation: Annotated[Point3, "T"],
        interior: Annotated[Vector, "f", "k1", "k2"],
        point: Annotated[Point3, "X"],
        *,
        image: Annotated[Point2, "Im"],
    ) -> Point2:
        """Projected minus observed (pixels)."""
        seen = rotation.inverse() @ point + translation
        inverse = 1 / seen.z
        plane = Point2(-seen.x * inverse, -seen.y * inverse)
        square = plane.dot(plane)
        focal, k1, k2 = interior
        return (focal * (1 + square * (k1 + k2 * square))) * plane - image


@functools.cache
def camera_kernel():
    """The kernel of the camera, compiled once for all tests."""
    return compile_formula(BalCamera())


def read_problem(path):
    """A file of the collection."""
    numbers = np.array(path.read_text().split(), dtype=np.float64)
    n_cameras, n_points, n_observations = numbers[:3].astype(int)
    rows = numbers[3 : 3 + 4 * n_observations].reshape(-1, 4)
    rest = numbers[3 + 4 * n_observations :]
    return Problem(
        rest[: 9 * n_cameras].reshape(-1, 9),
        rest[9 * n_cameras :].reshape(n_points, 3),
        rows[:, 0].astype(int),
        rows[:, 1].astype(int),
        rows[:, 2:],
    )


def bundle(problem, eliminated=True):
    """The least-squares system of a problem, its points eliminated."""
    system = LeastSquares()
    cameras = problem.cameras
    names = [f"camera {k}" for k in range(len(cameras))]
    world_to_camera = exponential(cameras[:, :3])
    rotations = system.add_rotations(names, world_to_camera.transpose(0, 2, 1))
    translations = system.add_points([f"{name} T" for name in names], cameras[:, 3:6])
    interiors = system.add_vectors(names, cameras[:, 6:], ["f", "k1", "k2"])
    points = system.add_points([f"P{k}" for k in range(len(problem.points))], problem.points)
    camera, point = problem.camera_of, problem.point_of
    blocks = {
        "rotation": rotations[camera],
        "translation": translations[camera],
        "interior": interiors[camera],
        "point": points[point],
    }
    system.add(camera_kernel(), blocks, problem.images, 1.0)
    if eliminated:
        system.eliminate(points)
    return system
