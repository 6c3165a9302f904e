"""Poses that are given and are not those of the measures, and axes of control points: what is said."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from accused import codes, diagnosis
from accused import said as told

from obseq.errors import InputError
from obseq.images import Poses
from obseq.images.causes.pose_rewritings import compared
from obseq.images.initial import growth


@pytest.fixture(autouse=True)
def _short_trials(monkeypatch):
    """What is right fits after a few iterations; the trials of what is wrong are the time of these tests."""
    monkeypatch.setattr(growth, "PAIRS_TRIED", 2)


def _block(n_control=8, origin=(0.0, 0.0, 0.0)):
    block, _, _ = scenes.block(n_images=6, n_points=16, n_control=n_control, origin=origin)
    block.freeze_parameters("K.|p.|b.")
    return block


def _exchange_axes(block):
    block.control = replace(block.control, coordinates=block.control.coordinates[:, [1, 0, 2]].copy())


def _turn(block, turn):
    block.poses = replace(block.poses, rotations=block.poses.rotations @ turn)


def _exchange_poses(block, first, second):
    rows = np.arange(len(block.poses))
    rows[[first, second]] = second, first
    given = block.poses
    block.poses = Poses(given.images, given.centres[rows], given.rotations[rows], given.cameras)


def test_exchanged_axes_of_control_points_are_told_from_images_by_the_poses_that_are_given():
    block = _block()
    _exchange_axes(block)
    cause = told(block)
    assert cause.startswith(
        "x and y of the control points are exchanged (easting comes first here): so changed,"
    )


@pytest.mark.parametrize(
    ("origin", "first"),
    [((0.0, 0.0, 0.0), "the lines of all"), ((650000.0, 6860000.0, 0.0), "x and y of the control")],
)
def test_without_poses_both_are_named_and_what_coordinates_look_like_comes_first(origin, first):
    block = _block(origin=origin)
    _exchange_axes(block)
    block.poses = block.poses.select([])
    cause = told(block)
    assert cause.startswith(first)
    assert "the lines of all images were counted upwards" in cause
    assert "x and y of the control points are exchanged" in cause and "x and y of all image" not in cause


def test_heights_that_count_downwards_are_told_by_the_poses_that_are_given():
    block = _block()
    block.control = replace(block.control, coordinates=block.control.coordinates * [1.0, 1.0, -1.0])
    assert told(block).startswith("the heights of the control points count downwards (z goes up here): so")


def test_heights_at_the_place_of_a_coordinate_are_told_by_the_poses_that_are_given():
    block = _block()
    block.control = replace(block.control, coordinates=block.control.coordinates[:, [0, 2, 1]].copy())
    assert "y and z of the control points are exchanged (z is the height here): so changed," in told(block)


def test_principal_points_of_images_that_have_been_turned_are_named():
    block = _block()
    (part,) = block.sets
    xy = np.column_stack([scenes.CAMERA.height - part.measures.xy[:, 1], part.measures.xy[:, 0]])
    block.cameras["c"] = replace(scenes.CAMERA, width=scenes.CAMERA.height, height=scenes.CAMERA.width)
    block.sets = [replace(part, measures=replace(part.measures, xy=xy))]
    block.freeze_parameters("PP.|K.|p.|b.")
    assert "principal points were given for images that have been turned by 90 degrees since" in told(block)


def test_exchanged_axes_that_put_points_behind_the_cameras_are_said_with_that():
    block = _block(origin=(1000.0, 0.0, 0.0))
    _exchange_axes(block)
    with pytest.raises(
        InputError, match=r"behind the camera [^\n]*\nLikely cause: x and y of the control points are"
    ):
        diagnosis(block)


def test_a_control_point_that_is_far_off_is_named_with_by_how_much():
    block = _block()
    block.control.coordinates[5] += [9.0, -7.0, 4.0]
    (one,) = diagnosis(block).accused
    assert one.what == "control point P5"
    assert one.size == pytest.approx([9.0, -7.0, 4.0], abs=0.05)


@pytest.mark.parametrize("is_placed", [True, False])
def test_exchanged_control_points_are_named_with_each_other(is_placed):
    block = _block()
    block.control.coordinates[[1, 4]] = block.control.coordinates[[4, 1]]
    if not is_placed:
        block.poses = block.poses.select([])
    found = diagnosis(block)
    assert {one.what for one in found.accused} == {"control point P1", "control point P4"}
    assert {slip.text for one in found.accused for slip in one.slips} == {
        "exchanged with P1",
        "exchanged with P4",
    }


def test_images_whose_names_are_exchanged_are_named_though_the_block_fits():
    block = _block()
    _exchange_poses(block, 1, 2)
    cause = told(block)
    assert cause.startswith(
        "images i1 and i2 look exchanged: i1 is where i2 was given, i2 is where i1 was given"
    )


@pytest.mark.parametrize(
    ("turn", "said"),
    [
        (np.diag([1.0, -1.0, -1.0]), "by 180 degrees about x: cameras look along +z here"),
        (np.diag([-1.0, -1.0, 1.0]), "by 180 degrees about the viewing axis"),
    ],
)
def test_a_turn_that_all_observed_rotations_share_is_named(turn, said):
    block = _block()
    _turn(block, turn)
    block.observe_poses(block.poses, 0.05, 0.02)
    assert said in told(block)


@pytest.mark.parametrize("pull", [1.0, 40.0])
def test_two_observed_poses_that_are_wrong_are_named_together(pull):
    """Whether the block is bad, or has no more than gross errors."""
    block, far = _block(), np.zeros((6, 3))
    far[[1, 4]] = [[3.0, 0.0, 0.0], [0.0, -3.0, 0.0]]
    wrong = replace(block.poses, centres=block.poses.centres + far)
    block.observe_poses(wrong, 0.1 / pull, 0.01)
    named = {"observed poses of i1 centre.x", "observed poses of i4 centre.y"}
    assert {what for _, what in list(codes(block))[:2]} == named


def _observed(change):
    """A ring without poses, whose centres are observed, and written in another way."""
    block, true, _ = scenes.block(n_images=5, n_points=15, n_control=9, seed=7)
    block.freeze_parameters("K.|p.|b.")
    block.poses = block.poses.select([])
    turns = np.broadcast_to(np.eye(3), (len(true), 3, 3))
    block.observe_poses(Poses.of(true.images, change(true.centres.copy()), turns), 0.02)
    return block


def _digit(centres):
    centres[3, 1] += 30.0
    return centres


def test_one_wrong_coordinate_of_an_observed_centre_is_named_and_no_rotation_that_nobody_gave():
    block = _observed(_digit)
    (one,) = diagnosis(block).accused
    assert (one.code, one.what) == ("I180", "observed poses of i3 centre.y")
    assert one.size == pytest.approx([30.0], abs=0.1)
    block.initialise()
    assert not block.solve().left_out


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda centres: centres[:, [1, 0, 2]], "x and y of the given centres are exchanged"),
        (lambda centres: centres * [1.0, 1.0, -1.0], "the heights of the given centres count downwards"),
        (lambda centres: 1000.0 * centres, "the control points are 0.001 times as large as the given poses"),
        (lambda centres: centres[[0, 2, 1, 3, 4]], "images i1 and i2 look exchanged"),
    ],
)
def test_observed_centres_that_were_written_in_another_way_are_put_right_and_fit(change, said):
    assert told(_observed(change)).startswith(said)


def test_a_change_of_the_poses_explains_nothing_by_leaving_observed_ones_out():
    """Three centres are off, each by its own: no way of writing them puts them right."""
    rng = np.random.default_rng(11)
    found = _observed(lambda centres: centres + rng.normal(0.0, 40.0, centres.shape))
    assert not any(code == "I140" for code, _ in codes(found))


def test_given_poses_of_another_scale_by_chance_are_not_said_to_be_in_feet():
    found = scenes.ring(12)[0]
    centres = found.centres.copy()
    centres[0] *= 9.0
    assert "feet" not in compared(found, replace(found, centres=centres), False).said
    assert "in feet" in compared(found, replace(found, centres=found.centres / 0.3048), False).said


def test_good_poses_and_rough_ones_are_not_accused():
    block = _block()
    assert told(block) == ""
    rough, _, _ = scenes.block(n_images=6, n_points=16, n_control=8)
    rough.poses = scenes.moved(rough.poses, 0.5, 0.05)
    assert told(rough) == ""
