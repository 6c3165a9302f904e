"""Resection from nothing: the panel's images, gross errors, and what cannot be resected."""

import json

import numpy as np
import panel
import pytest

from obseq.errors import InputError
from obseq.geometry import RigidMotion, rotations_from
from obseq.images import (
    Camera,
    ControlPoints,
    ImagePoints,
    Poses,
    ResectionOptions,
    check_distribution,
    poses_of_triplets,
    refine_poses,
    resect,
)
from obseq.images.initial.distribution import check_spread

CAMERA = Camera("c", 2000, 1500, 1800.0, degree=(2, 0, 0), distortion=[-0.08, 0.01])


def _scene(n: int = 12, noise: float = 0.0, seed: int = 1):
    rng = np.random.default_rng(seed)
    ground = rng.uniform([-3, -3, -1], [3, 3, 1], (n, 3)) + np.array([7e5, 6e6, 100.0])
    pose = RigidMotion(np.array([7e5 + 1.0, 6e6 - 2.0, 112.0]), rotations_from([0.1, -0.15, 2.0], "opk"))
    xy = CAMERA.project(pose.to_local(ground)) + rng.normal(0.0, noise, (n, 2))
    names = [f"P{k}" for k in range(n)]
    return ImagePoints.of(["i"] * n, names, xy), ControlPoints.of(names, ground), pose


@pytest.mark.slow
def test_the_panel_is_resected_from_nothing(shared_data):
    """39 images: 500 triplets each."""
    stored, cameras = panel.poses(shared_data, "Resec"), panel.cameras(shared_data, "Calib")
    of_image = {image: cameras[name] for image, name in zip(stored.images, stored.cameras, strict=True)}
    found = resect(panel.measures(shared_data), panel.control_points(shared_data), of_image)
    expected = stored.select(found.poses.images)
    np.testing.assert_allclose(found.poses.centres, expected.centres, atol=1e-7, rtol=0.0)
    np.testing.assert_allclose(found.poses.rotations, expected.rotations, atol=1e-11, rtol=0.0)
    assert found.is_used.all()
    norms = np.linalg.norm(found.residuals, axis=1)
    assert np.sqrt(np.mean(norms**2)) == pytest.approx(0.03551680984, rel=1e-9)


def test_the_panel_is_resected_from_the_values_in_its_files(shared_data):
    stored, cameras = panel.poses(shared_data, "Resec"), panel.cameras(shared_data, "Calib")
    measures, control = panel.measures(shared_data), panel.control_points(shared_data)
    ground = control.select(measures.point_names).coordinates[measures.point]
    of_image = [cameras[name] for name in stored.cameras]
    found, *_ = refine_poses(stored, measures, ground, of_image, np.ones(len(measures), dtype=bool))
    np.testing.assert_allclose(found.centres, stored.centres, atol=1e-8, rtol=0.0)
    np.testing.assert_allclose(found.rotations, stored.rotations, atol=1e-11, rtol=0.0)


def test_the_distribution_of_control_points_is_that_of_mmvii(shared_data):
    expected = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    found = check_distribution(panel.measures(shared_data), panel.control_points(shared_data))
    for image, numbers in expected["check_gcp_distribution"].items():
        row = found.images.index(image)
        assert found.counts[row] == numbers["n"]
        assert found.linearity[row] == pytest.approx(numbers["linearity"], rel=1e-12)
        assert found.planarity[row] == pytest.approx(numbers["planarity"], rel=1e-10)


def test_three_points_give_the_true_pose_among_others():
    measures, control, pose = _scene(3)
    found, owner = poses_of_triplets(CAMERA.directions(measures.xy)[None], control.coordinates[None])
    assert owner.tolist() == [0] * len(owner)
    assert np.linalg.norm(found.centre - pose.centre, axis=1).min() < 1e-4


def test_gross_errors_are_found_and_left_out():
    measures, control, pose = _scene(20, noise=0.3)
    xy = measures.xy.copy()
    xy[[2, 5, 11, 17]] += [[80.0, 0.0], [0.0, -60.0], [300.0, 200.0], [25.0, 25.0]]
    bad = ImagePoints.of(["i"] * 20, measures.point_names, xy, 0.3)
    found = resect(bad, control, CAMERA)
    assert np.flatnonzero(~found.is_used).tolist() == [2, 5, 11, 17]
    sigmas = np.sqrt(np.diagonal(found.covariances[0]))[:3]
    assert (np.abs(found.poses.centres[0] - pose.centre) < 4.0 * sigmas).all()
    assert 0.5 < found.sigma0[0] < 1.6


@pytest.mark.slow
def test_the_covariance_is_that_of_many_images_with_noise():
    """200 resections."""
    measures, control, pose = _scene(8)
    images, n = [f"i{k}" for k in range(200)], 200 * 8
    noise = np.random.default_rng(7).normal(0.0, 0.2, (n, 2))
    names = [*measures.point_names] * 200
    noisy = ImagePoints.of(np.repeat(images, 8).tolist(), names, np.tile(measures.xy, (200, 1)) + noise, 0.2)
    found = resect(noisy, control, CAMERA, ResectionOptions(triplets=20))
    scatter = np.std(found.poses.centres - pose.centre, axis=0)
    given = np.sqrt(np.diagonal(found.covariances, axis1=1, axis2=2)).mean(axis=0)[:3]
    np.testing.assert_allclose(scatter / given, 1.0, atol=0.15)


def test_poses_are_the_same_without_their_covariances():
    measures, control, _ = _scene(8, noise=0.3)
    found = resect(measures, control, CAMERA)
    plain = resect(measures, control, CAMERA, ResectionOptions(covariance=False))
    assert np.isfinite(found.covariances).all() and np.isnan(plain.covariances).all()
    np.testing.assert_array_equal(plain.poses.centres, found.poses.centres)
    np.testing.assert_array_equal(plain.residuals, found.residuals)


def test_too_few_points_and_points_on_a_line():
    measures, control, _ = _scene(5)
    with pytest.raises(InputError, match="image i: 3 of its points are control points"):
        resect(measures, control.select(control.names[:3]), CAMERA)
    line = np.linspace([0.0, 0, 0], [1.0, 2, 3], 5)
    with pytest.raises(InputError, match="image i: its 5 control points are on a line"):
        resect(measures, ControlPoints.of(control.names, line), CAMERA)


def test_wrong_names_and_wrong_cameras():
    measures, control, _ = _scene(12)
    shuffled = ControlPoints.of(control.names, np.roll(control.coordinates, 5, axis=0))
    with pytest.raises(
        InputError, match=r"image i: the best pose leaves a median residual of .* wrong point"
    ):
        resect(measures, shuffled, CAMERA)
    with pytest.raises(InputError, match="image i: it has no camera"):
        resect(measures, control, {"j": CAMERA})


def test_a_far_plane_seen_flat_is_ambiguous():
    # four points of a small plane, far away: the plane and its mirror image look alike within the noise
    ground = np.array([[-1.0, -1, 0], [1, -1, 0.0], [1, 1, 0], [-1, 1, 0]]) @ rotations_from(
        [0.5, 0.0, 0.0], "wpk"
    ).T + [0.0, 0.0, 5000.0]
    camera = Camera("c", 2000, 1500, 1800.0, degree=(0, 0, 0))
    names = list("ABCD")
    measures = ImagePoints.of(["i"] * 4, names, camera.project(ground))
    noisy = ImagePoints.of(
        ["i"] * 4, names, measures.xy + np.array([[0.3, 0], [0, 0.2], [-0.1, 0.1], [0, -0.3]])
    )
    with pytest.raises(InputError, match="two different poses fit its points alike"):
        resect(noisy, ControlPoints.of(names, ground), camera)


def test_a_pose_found_again_is_the_one_that_made_the_measures():
    measures, control, pose = _scene()
    found = resect(measures, control, CAMERA)
    assert isinstance(found.poses, Poses)
    np.testing.assert_allclose(found.poses.centres[0], pose.centre, atol=1e-7)
    np.testing.assert_allclose(found.poses.rotations[0], pose.rotation, atol=1e-8)


@pytest.mark.parametrize("change", [[0.0, 10_800_000.0, 0.0], [23_400_000.0, 0.0, 0.0]])
def test_one_control_point_far_from_all_is_named_where_the_others_look_like_one(change):
    """A digit too many, in national coordinates: all nine were said to be on a line."""
    x, y = np.meshgrid([0.0, 300.0, 600.0], [0.0, 200.0, 400.0])
    points = np.column_stack([2_600_000.0 + x.ravel(), 1_200_000.0 + y.ravel(), np.linspace(400.0, 420.0, 9)])
    points[4] += change
    told = r"^the block: control point T4 is \S+e\+0\d from the others, which are within"
    with pytest.raises(InputError, match=told):
        check_spread(points, "the block", [f"T{k}" for k in range(9)])
