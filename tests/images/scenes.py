"""Synthetic blocks: cameras around a scene, measures with noise, the truth known."""

import numpy as np

from obseq.geometry import RigidMotion, absorb
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses

CAMERA = Camera("c", 2000, 1500, 1800.0, degree=(3, 1, 1), distortion={"K1": -0.08, "K2": 0.02, "p1": 1e-3})


def looking_at(centres: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Rotations of cameras at centres (n, 3) that look at a point, their lines going down."""
    z = target - centres
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def ring(n_images: int = 8, n_points: int = 30, seed: int = 0, origin=(0.0, 0.0, 0.0)):
    """Poses on a ring of 10 m, points in a box of 4 m, around an origin."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, n_images, endpoint=False)
    centres = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), 3 + rng.uniform(-1, 1, n_images)])
    points = rng.uniform(-2.0, 2.0, (n_points, 3))
    rotations = looking_at(centres, np.zeros(3))
    images = [f"i{k}" for k in range(n_images)]
    return Poses.of(images, centres + origin, rotations, cameras="c"), points + origin


def measured(poses: Poses, points: np.ndarray, names, noise: float, seed: int = 1, camera: Camera = CAMERA):
    """All points in all images, where they are seen, with noise (pixels)."""
    rng = np.random.default_rng(seed)
    image, point = np.divmod(np.arange(len(poses) * len(points)), len(points))
    local = RigidMotion(poses.centres[image], poses.rotations[image]).to_local(points[point])
    seen = camera.sees(local)
    xy = camera.project(local) + rng.normal(0.0, noise, (len(image), 2))
    return ImagePoints.packed(poses.images, names, image[seen], point[seen], xy[seen], noise or 1.0)


def moved(poses: Poses, shift: float, turn: float, seed: int = 2) -> Poses:
    """Poses that are off by about a shift and a turn (radians)."""
    rng = np.random.default_rng(seed)
    return Poses(
        poses.images,
        poses.centres + rng.normal(0.0, shift, (len(poses), 3)),
        absorb(poses.rotations, rng.normal(0.0, turn, (len(poses), 3))),
        poses.cameras,
    )


def block(noise: float = 0.5, n_control: int = 6, sigma: float = 0.002, seed: int = 1, **shape):
    """A ring as a block; its first points are control points, measured with their sigma."""
    poses, points = ring(**shape)
    names = [f"P{k}" for k in range(len(points))]
    given = points[:n_control] + np.random.default_rng(seed + 100).normal(0.0, sigma, (n_control, 3))
    made = BundleAdjustment()
    made.add_cameras(CAMERA)
    made.add_poses(moved(poses, 0.05, 0.005))
    if n_control:
        made.add_control_points(ControlPoints.of(names[:n_control], given, sigma))
    made.add_measures(measured(poses, points, names, noise, seed))
    return made, poses, dict(zip(names, points, strict=True))
