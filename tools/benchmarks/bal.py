"""Bundle Adjustment in the Large: its files, its camera as a formula, a synthetic problem of its kind."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import WORLD_TO_LOCAL, Point2, Point3, Rotation, Vector
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares

if TYPE_CHECKING:
    from pathlib import Path

    from obseq.kernels.loading import Kernel


@dataclass(frozen=True)
class Problem:
    """What a file holds.

    Attributes:
        cameras: (n, 9) rotation vector from the world to the camera, translation, f, k1, k2.
        points: (m, 3).
        camera_of: (k,) camera of each observation.
        point_of: (k,) point of each observation.
        images: (k, 2) pixels.
    """

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
        moved: Point2 = (focal * (1 + square * (k1 + k2 * square))) * plane - image
        return moved


@functools.cache
def camera_kernel() -> Kernel:
    """The kernel of the camera, compiled once for all problems."""
    return compile_formula(BalCamera())


def read_problem(path: Path) -> Problem:
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


def write_problem(problem: Problem, path: Path) -> None:
    """Writes a file of the collection."""
    counts = len(problem.cameras), len(problem.points), len(problem.images)
    rows = zip(problem.camera_of, problem.point_of, problem.images, strict=True)
    lines = [" ".join(map(str, counts)), *(f"{c} {p} {x:.17g} {y:.17g}" for c, p, (x, y) in rows)]
    numbers = np.concatenate([problem.cameras.ravel(), problem.points.ravel()])
    path.write_text("\n".join([*lines, *(f"{number:.17g}" for number in numbers)]) + "\n")


def synthetic_problem(n_cameras: int = 50, n_points: int = 10_000, n_observations: int = 40_000) -> Problem:
    """Cameras on an arc around a cloud of points, each point seen by neighbouring ones; start off by noise.

    Observations are listed by point, as those of the collection are; half a pixel of noise.
    """
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.0, 1.0, (n_points, 3))
    angle = np.linspace(-1.0, 1.0, n_cameras)
    turn = np.column_stack([np.zeros(n_cameras), angle, np.zeros(n_cameras)])
    turn += rng.normal(0.0, 0.02, turn.shape)
    translation = np.tile([0.0, 0.0, -5.0], (n_cameras, 1)) + rng.normal(0.0, 0.05, (n_cameras, 3))
    interior = np.tile([1000.0, -0.02, 0.005], (n_cameras, 1))
    rays = n_observations // n_points
    point_of = np.repeat(np.arange(n_points), rays)
    nearest = rng.integers(0, n_cameras, n_points)[:, None] + np.arange(-(rays // 2), rays - rays // 2) * 3
    camera_of = np.mod(nearest, n_cameras).ravel()
    order = np.lexsort((camera_of, point_of))
    point_of, camera_of = point_of[order], camera_of[order]
    cameras = np.column_stack([turn, translation, interior])
    images = projected(cameras[camera_of], points[point_of]) + rng.normal(0.0, 0.5, (len(point_of), 2))
    cameras[:, :6] += rng.normal(0.0, 0.002, (n_cameras, 6))
    start = points + rng.normal(0.0, 0.01, points.shape)
    return Problem(cameras, start, camera_of, point_of, images)


def projected(cameras: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 2) pixels of points (n, 3) in cameras (n, 9)."""
    seen = np.einsum("nij,nj->ni", exponential(cameras[:, :3]), points) + cameras[:, 3:6]
    plane = -seen[:, :2] / seen[:, 2:]
    square = np.sum(plane**2, axis=1, keepdims=True)
    focal, k1, k2 = cameras[:, 6:].T[:, :, None]
    return np.asarray(focal * (1 + square * (k1 + k2 * square)) * plane)


def bundle(problem: Problem, eliminated: bool = True, threads: int = 1) -> LeastSquares:
    """The least-squares system of a problem, its points eliminated."""
    system = LeastSquares(threads=threads)
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
