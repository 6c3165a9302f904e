"""Synthetic flights: strips with a receiver beside the camera, a shutter that rolls, a grid of points."""

from dataclasses import dataclass

import numpy as np

from obseq.geometry import RigidMotion, absorb
from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses

CAMERA = Camera("c", 4000, 3000, 3000.0, degree=(3, 1, 1), distortion={"K1": -0.05, "K2": 0.02, "p1": 5e-4})
HEIGHT = 100.0
LEVER = np.array([0.08, -0.25, -0.4])
READOUT = 0.03
GPS = np.array([0.02, 0.02, 0.04])
GROUND = 0.01


@dataclass
class Flight:
    """A block with its truth."""

    block: BundleAdjustment
    poses: Poses
    velocities: np.ndarray
    names: list
    points: np.ndarray


def flight(
    strips: int = 4,
    length: int = 5,
    n_points: int = 120,
    n_control: int = 3,
    n_check: int = 12,
    seed: int = 0,
    noise: float = 0.5,
) -> Flight:
    """Strips there and back, 75 % along and 65 % across; the first values are rough."""
    rng = np.random.default_rng(seed)
    poses, velocities = _flown(strips, length, rng)
    low, high = poses.centres[:, :2].min(axis=0) - 20.0, poses.centres[:, :2].max(axis=0) + 20.0
    points = np.column_stack([rng.uniform(low, high, (n_points, 2)), rng.normal(0.0, 4.0, n_points)])
    names = [f"t{k}" for k in range(n_points)]
    image, point, xy = _images(poses, velocities, points)
    xy += rng.normal(0.0, noise, xy.shape)
    block = BundleAdjustment()
    block.add_cameras(Camera("c", 4000, 3000, 3010.0, degree=(3, 1, 1)))
    n = len(poses)
    rough = absorb(poses.rotations, rng.normal(0.0, 0.01, (n, 3)))
    block.add_poses(Poses(poses.images, poses.centres + rng.normal(0.0, 0.5, (n, 3)), rough, poses.cameras))
    antennas = poses.centres + poses.rotations @ LEVER + rng.normal(size=(n, 3)) * GPS
    block.observe_antenna(poses.images, antennas, np.tile(GPS, (n, 1)), lever_sigmas=np.inf)
    block.roll_shutter("c", poses.images, velocities)
    block.add_measures(ImagePoints.packed(poses.images, names, image, point, xy, noise))
    seen = rng.permutation(np.flatnonzero(np.bincount(point, minlength=n_points) >= 4))
    for rows, add in (
        (seen[:n_control], block.add_control_points),
        (seen[n_control : n_control + n_check], block.add_check_points),
    ):
        given = points[rows] + rng.normal(0.0, GROUND, (len(rows), 3))
        add(ControlPoints.of([names[k] for k in rows], given, GROUND))
    return Flight(block, poses, velocities, names, points)


def _flown(strips, length, rng):
    """Poses and velocities."""
    across, along = HEIGHT * 4000 / 3000 * 0.35, HEIGHT * 0.25
    rows = [
        (along * (k if strip % 2 == 0 else length - 1 - k), across * strip, 1 - 2 * (strip % 2))
        for strip in range(strips)
        for k in range(length)
    ]
    x, y, way = np.array(rows).T
    n = len(x)
    centres = np.column_stack([x, y, HEIGHT + rng.normal(0.0, 3.0, n)]) + rng.normal(0.0, 1.0, (n, 3))
    velocities = np.outer(way, [8.0, 0.0, 0.0]) + rng.normal(0.0, 0.3, (n, 3))
    kappa = np.where(way > 0.0, 0.0, np.pi) - np.pi / 2
    angles = np.column_stack([rng.normal(0.0, 0.03, (n, 2)), kappa + rng.normal(0.0, 0.03, n)])
    images = [f"i{k:03d}" for k in range(n)]
    return Poses.of(images, centres, angles, "opk", cameras="c"), velocities


def _images(poses, velocities, points):
    """Numbers of image and point, and pixels without noise: the line of a point says when it was exposed."""
    image, point = np.divmod(np.arange(len(poses) * len(points)), len(points))
    still = RigidMotion(poses.centres[image], poses.rotations[image]).to_local(points[point])
    near = CAMERA.sees(still, 100.0)
    image, point = image[near], point[near]
    later = np.zeros(len(image))
    for _ in range(6):
        centres = poses.centres[image] + later[:, None] * velocities[image]
        xy = CAMERA.project(RigidMotion(centres, poses.rotations[image]).to_local(points[point]))
        later = READOUT * (xy[:, 1] / CAMERA.height - 0.5)
    inside = CAMERA.contains(xy)
    return image[inside], point[inside], xy[inside]
