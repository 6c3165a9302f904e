"""Relative orientation and the growth of a block from measures alone."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.geometry import RigidMotion, rotations_from
from obseq.images import (
    BundleAdjustment,
    Camera,
    ControlPoints,
    ImagePoints,
    Poses,
    relative_orientation,
    similarity,
)
from obseq.images.initial.relative import epipolar_angles, essential_matrices


def _rays(n: int = 40, planar: bool = False, seed: int = 0):
    rng = np.random.default_rng(seed)
    points = rng.uniform([-2, -2, 6], [2, 2, 10], (n, 3))
    if planar:
        points[:, 2] = 8.0 + 0.3 * points[:, 0]
    second = RigidMotion(np.array([0.8, 0.36, 0.48]), rotations_from([0.1, -0.2, 0.3], "wpk"))
    rays = [points, second.to_local(points)]
    return *(ray / np.linalg.norm(ray, axis=1, keepdims=True) for ray in rays), second


@pytest.mark.parametrize("planar", [False, True])
def test_five_points_give_the_true_orientation(planar):
    first, second, truth = _rays(planar=planar)
    found = relative_orientation(first, second, samples=50)
    np.testing.assert_allclose(found.pose.centre, truth.centre, atol=1e-6)
    np.testing.assert_allclose(found.pose.rotation, truth.rotation, atol=1e-6)
    assert found.is_used.all()


def test_essential_matrices_satisfy_their_equations():
    first, second, _ = _rays(5)
    matrices = essential_matrices(first[None], second[None])
    assert 1 <= len(matrices) <= 10
    for matrix in matrices / np.linalg.norm(matrices, axis=(1, 2), keepdims=True):
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", first, matrix, second), 0.0, atol=1e-9)
        assert np.linalg.det(matrix) == pytest.approx(0.0, abs=1e-7)
        singular = np.linalg.svd(matrix, compute_uv=False)
        assert singular[0] == pytest.approx(singular[1], rel=1e-5)


def test_rays_are_judged_by_the_larger_of_their_angles_to_the_epipolar_planes():
    """A ray that passes near the other camera has a plane that turns much when it moves a little."""
    first, _, pose = _rays(20)
    second = np.roll(first, 3, axis=0)
    first[0] = pose.centre + np.array([0.05, 0.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    base, other = pose.centre, second @ pose.rotation.T
    matrix = np.cross(base, pose.rotation.T).T
    planes = [np.cross(base, rays) for rays in (other, first)]
    planes = [plane / np.linalg.norm(plane, axis=1, keepdims=True) for plane in planes]
    expected = [np.abs(np.einsum("ni,ni->n", *pair)) for pair in ((first, planes[0]), (other, planes[1]))]
    assert (np.abs(expected[0] / expected[1] - 1.0) > 0.1).any()
    np.testing.assert_allclose(epipolar_angles(matrix[None], first, second)[0], np.maximum(*expected))


def test_wrong_pairs_are_found():
    first, second, truth = _rays(60)
    second[:15] = np.roll(second[:15], 4, axis=0)
    found = relative_orientation(first, second)
    assert not found.is_used[:15].any()
    np.testing.assert_allclose(found.pose.centre, truth.centre, atol=1e-5)


def test_too_few_common_points_and_no_parallax():
    first, second, _ = _rays(4)
    with pytest.raises(InputError, match="takes 5 common points, not 4"):
        relative_orientation(first, second)


def test_a_similarity_by_hand():
    # a square of side 1 becomes one of side 2, turned a quarter, moved by (10, 0, 0)
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    turned = np.array([[10.0, 0, 0], [10, 2, 0], [8, 2, 0], [8, 0, 0]])
    scale, motion = similarity(square, turned)
    assert scale == pytest.approx(2.0)
    np.testing.assert_allclose(motion.centre, [10.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(motion.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
    with pytest.raises(InputError, match="takes three known points; there are 2"):
        similarity(square[:2], turned[:2])
    with pytest.raises(InputError, match="on a line"):
        similarity(square[[0, 1, 1]], turned[[0, 1, 1]])


def _without_poses(n_control: int, noise: float = 0.5):
    poses, points = scenes.ring()
    names = [f"P{k}" for k in range(len(points))]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_images(poses.images, "c")
    if n_control:
        block.add_control_points(ControlPoints.of(names[:n_control], points[:n_control], 0.001))
    block.add_measures(scenes.measured(poses, points, names, noise))
    return block, poses


@pytest.mark.parametrize("n_control", [3, 6])
def test_a_block_starts_from_its_measures_and_three_control_points(n_control):
    block, poses = _without_poses(n_control)
    assert block.initialise() == poses.images
    found = block.poses.select(poses.images)
    np.testing.assert_allclose(found.centres, poses.centres, atol=0.1)
    solution = block.solve()
    assert 0.8 < solution.sigma0 < 1.2
    sigmas = np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2))
    assert (np.abs(solution.poses.centres - poses.centres) < 4.5 * sigmas).all()
    assert block.initialise() == ()


def test_a_block_without_control_points_stays_in_a_frame_of_its_own():
    block, poses = _without_poses(0)
    block.initialise()
    solution = block.solve(datum="centres")
    scale, motion = similarity(solution.poses.centres, poses.centres)
    moved = motion.centre + scale * solution.poses.centres @ motion.rotation.T
    np.testing.assert_allclose(moved, poses.centres, atol=0.02)


def test_an_image_that_cannot_be_placed_is_named():
    block, _poses = _without_poses(6)
    block.add_images(["alone"], "c")
    block.add_measures(ImagePoints.of(["alone"] * 2, ["P0", "P1"], [[10.0, 10.0], [50.0, 60.0]]))
    with pytest.raises(InputError, match="1 images cannot be placed; alone: it shares too few points"):
        block.initialise()
    assert len(block.poses) == 0


def test_the_last_images_of_a_block_with_unknown_distortion_are_placed():
    """Which misses by tens of pixels where a calibration begins without it."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.arange(8.0), np.arange(6.0), indexing="ij"), -1).reshape(-1, 2)
    points = np.column_stack([6.0 * grid + rng.uniform(-1, 1, (48, 2)), rng.uniform(0, 4, 48)])
    names = np.array([f"P{row:02d}" for row in range(48)])
    centres = [[6 + 9 * i, 6 + 9 * j, 42 + rng.uniform(-1, 1)] for i in range(4) for j in range(3)]
    angles = [[*rng.uniform(-6, 6, 2), rng.choice([0, 180]) + rng.uniform(-3, 3)] for _ in centres]
    images = [f"i{row}" for row in range(12)]
    poses = Poses.of(images, centres, np.radians(angles), "opk")
    true, begun = (
        Camera("c", 6000, 4000, focal=focal, distortion={"K1": k1})
        for focal, k1 in ((5900, -0.06), (5850, 0))
    )
    block = BundleAdjustment()
    block.add_cameras(begun)
    block.add_images(images, begun.name)
    known = [0, 5, 20, 24, 27, 42, 47]
    block.add_control_points(ControlPoints.of(names[known].tolist(), points[known], 0.01))
    seen = {image: true.sees(poses[image].to_local(points)) for image in images}
    rows = [(image, row) for image in images for row in np.flatnonzero(seen[image]).tolist()]
    places = [true.project(poses[image].to_local(points[row : row + 1]))[0] for image, row in rows]
    measured = ImagePoints.of([i for i, _ in rows], [str(names[row]) for _, row in rows], places, 0.4)
    block.add_measures(measured)
    assert len(block.initialise()) == 12
