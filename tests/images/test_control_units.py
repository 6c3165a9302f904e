"""Control points in another unit than the rest of a block, or than their own sigmas."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from accused import said

from obseq.errors import InputError
from obseq.images import Poses
from obseq.images.initial import growth


@pytest.fixture(autouse=True)
def _short_trials(monkeypatch):
    """Images that can be placed are, from the first pairs; the others are the time of these tests."""
    monkeypatch.setattr(growth, "PAIRS_TRIED", 2)


def _block(factor, noise=0.5):
    """A small ring whose control points, but not their sigmas, are in another unit."""
    block, _, _ = scenes.block(noise, n_images=4, n_points=16, n_control=8)
    block.freeze_parameters()
    block.control = replace(block.control, coordinates=block.control.coordinates * factor)
    return block


@pytest.mark.parametrize(
    ("factor", "times"),
    [(1000.0, "1000 times"), (1 / 0.3048, "3.28084 times"), (0.3048, "0.3048 times"), (0.001, "0.001 times")],
)
def test_control_points_in_another_unit_than_a_length_are_named_with_the_factor(factor, times):
    block = _block(factor)
    length = float(np.linalg.norm(block.control.coordinates[0] - block.control.coordinates[1])) / factor
    block.poses = block.poses.select([])
    block.add_length("P0", "P1", length, 0.002)
    assert said(block).startswith(f"the control points are {times} as large as the rest of the block says (")


def test_control_points_in_another_unit_than_observed_poses_are_named():
    block = _block(1 / 0.3048)
    block.observe_poses(block.poses, 0.05)
    cause = said(block)
    assert (
        cause.startswith("the control points are 3.28084 times") and "feet, and the rest in metres" in cause
    )


def test_points_behind_the_camera_of_another_unit_are_told_so():
    block = _block(1000.0)
    with pytest.raises(InputError, match=r"behind the camera .* control points are 1000 times .*millimetres"):
        block.solve()


def test_sigmas_of_control_points_in_another_unit_are_named():
    block = _block(1000.0, noise=0.1)
    block.poses = block.poses.select([])
    assert said(block).startswith("the sigmas of the control points are about 1000 times too small")


@pytest.mark.parametrize("factor", [1000.0, 20.0])
def test_sigmas_of_control_points_in_a_smaller_unit_are_told(factor):
    block = _block(1.0)
    block.control = block.control.scaled(factor)
    told = "about 1000 times as large as their residuals: in millimetres, with coordinates in metres?"
    assert (told in said(block)) == (factor == 1000.0)


@pytest.mark.parametrize("factor", [1.0, 1.1, 4.0])
def test_other_scales_are_no_units(factor):
    block = _block(factor)
    block.observe_poses(block.poses, 0.05)
    told = said(block)
    assert "times as large" not in told and "times too small" not in told


def test_control_points_in_another_unit_than_observed_centres_without_rotations_are_named():
    block, true, _ = scenes.block(n_images=5, n_points=15, n_control=9, seed=8)
    block.freeze_parameters()
    block.poses = block.poses.select([])
    block.control = replace(block.control, coordinates=1000.0 * block.control.coordinates)
    turns = np.broadcast_to(np.eye(3), (len(true), 3, 3))
    block.observe_poses(Poses.of(true.images, true.centres, turns), 0.02)
    assert "the control points are 1000 times as large as the given poses say" in said(block)
