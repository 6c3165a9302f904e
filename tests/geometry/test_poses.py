"""Poses: the direction of each motion, composition, batches."""

import numpy as np
import pytest

from obseq.geometry import RigidMotion, exponential, rotation_z


def random_pose(seed: int, count: int | None = None) -> RigidMotion:
    generator = np.random.default_rng(seed)
    shape = (3,) if count is None else (count, 3)
    return RigidMotion(
        generator.uniform(-100.0, 100.0, shape), exponential(generator.uniform(-2.0, 2.0, shape))
    )


def test_a_station_turned_by_a_quarter() -> None:
    # at (10, 20, 0), local x axis along world y: one metre ahead in x is (10, 21, 0)
    station = RigidMotion(np.array([10.0, 20.0, 0.0]), rotation_z(np.pi / 2))
    assert station.to_world([1.0, 0.0, 0.0]) == pytest.approx([10.0, 21.0, 0.0])
    assert station.to_local([10.0, 21.0, 0.0]) == pytest.approx([1.0, 0.0, 0.0])


def test_inverse_undoes() -> None:
    pose, points = random_pose(1), np.random.default_rng(9).uniform(-50.0, 50.0, (20, 3))
    assert pose.inverse().to_world(points) == pytest.approx(pose.to_local(points), abs=1e-12)
    assert (pose @ pose.inverse()).centre == pytest.approx(np.zeros(3), abs=1e-12)
    assert (pose.inverse() @ pose).rotation == pytest.approx(np.eye(3), abs=1e-14)


def test_composition_applies_the_right_one_first() -> None:
    first, second = random_pose(2), random_pose(3)
    point = np.array([1.0, -2.0, 3.0])
    assert (second @ first).to_world(point) == pytest.approx(
        second.to_world(first.to_world(point)), abs=1e-11
    )
    assert (first @ second).to_world(point) != pytest.approx((second @ first).to_world(point), abs=1.0)


def test_relative_pose_is_seen_from_the_reference() -> None:
    pose, reference = random_pose(4), random_pose(5)
    relative = pose.relative_to(reference)
    assert relative.centre == pytest.approx(reference.to_local(pose.centre), abs=1e-11)
    assert (reference @ relative).rotation == pytest.approx(pose.rotation, abs=1e-14)


def test_batches_equal_single_poses() -> None:
    poses, points = random_pose(6, 30), np.random.default_rng(7).uniform(-5.0, 5.0, (30, 3))
    one_by_one = [
        RigidMotion(c, r).to_local(p) for c, r, p in zip(poses.centre, poses.rotation, points, strict=True)
    ]
    assert poses.to_local(points) == pytest.approx(np.array(one_by_one), abs=1e-12)
    assert poses.inverse().to_local(poses.to_local(points)) == pytest.approx(points, abs=1e-11)
    assert poses.relative_to(random_pose(8)).rotation.shape == (30, 3, 3)
