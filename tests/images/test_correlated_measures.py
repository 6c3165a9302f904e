"""Image measures whose x and y are correlated."""

import numpy as np
import pytest
import scenes

from obseq.images import BundleAdjustment, Camera, ControlPoints, ImagePoints, Poses


def test_covariances_of_measures_turn_with_the_image():
    """Cameras turned about their axes see turned measures: what is correlated in one is not in the other."""
    poses, points = scenes.ring()
    names = [f"P{k}" for k in range(len(points))]
    camera = Camera("c", 4000, 4000, 1800.0, [2000.0, 2000.0], degree=(0, 0, 0))
    upright = scenes.measured(poses, points, names, 0.0, camera=camera)
    rng, turn = np.random.default_rng(5), np.array([[0.8, -0.6], [0.6, 0.8]])
    noise = rng.normal(0.0, [2.0, 0.5], (len(upright), 2))
    spread = turn @ np.diag([4.0, 0.25]) @ turn.T
    back = poses.rotations @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    solutions = []
    for rotations, axes, sigmas, covariance in (
        (poses.rotations, np.eye(2), [2.0, 0.5], 0.0),
        (back, turn, np.sqrt(np.diag(spread)), spread[0, 1]),
    ):
        xy = (upright.xy + noise - 2000.0) @ axes.T + 2000.0
        block = BundleAdjustment()
        block.add_cameras(camera)
        block.add_poses(Poses.of(poses.images, poses.centres, rotations, cameras="c"))
        block.add_control_points(ControlPoints.of(names[:6], points[:6], 0.002))
        block.add_measures(
            ImagePoints.packed(
                upright.image_names,
                names,
                upright.image,
                upright.point,
                xy,
                np.tile(sigmas, (len(xy), 1)),
                np.full(len(xy), covariance),
            )
        )
        solutions.append(block.solve())
    first, second = solutions
    assert second.sigma0 == pytest.approx(first.sigma0, rel=1e-9)
    np.testing.assert_allclose(second.coordinates, first.coordinates, atol=1e-8)
    np.testing.assert_allclose(second.point_covariances, first.point_covariances, rtol=1e-5, atol=1e-14)
