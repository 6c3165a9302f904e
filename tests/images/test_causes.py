"""Causes that all measures share: axes of images, another unit of the focal length; or none."""

from dataclasses import replace

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ImagePoints
from obseq.images.adjustment import causes, trials
from obseq.images.adjustment.causes import common_cause
from obseq.images.initial import growth


@pytest.fixture(autouse=True)
def _short_trials(monkeypatch):
    """Images that can be placed are, from the first pairs; the others are the time of these tests."""
    monkeypatch.setattr(growth, "PAIRS_TRIED", 2)
    monkeypatch.setattr(trials, "MOST", 25)


def _cause(block):
    return common_cause(block, block.solve(), block.poses)


def _upwards(block):
    (part,) = block.sets
    _measured(block, np.column_stack([part.measures.xy[:, 0], scenes.CAMERA.height - part.measures.xy[:, 1]]))


def _exchanged(block):
    _measured(block, block.sets[0].measures.xy[:, ::-1].copy())


def _measured(block, xy):
    (part,) = block.sets
    block.sets = [replace(part, measures=replace(part.measures, xy=xy))]


def _block(**shape):
    block, _, _ = scenes.block(**shape)
    block.freeze_parameters()
    return block


def test_lines_that_were_counted_upwards_are_named():
    block = _block()
    _upwards(block)
    before = block.sets, block.poses
    cause = _cause(block)
    assert cause.startswith("the lines of all images were counted upwards")
    assert (block.sets, block.poses) == before


@pytest.mark.parametrize("n_control", [3, 12])
def test_exchanged_image_coordinates_are_named(n_control):
    """With three control points the block does not converge; with twelve, b1 = -2 makes mirror images fit."""
    block, _, _ = scenes.block(n_control=n_control)
    _exchanged(block)
    assert _cause(block).startswith("x and y of all image points are exchanged")


@pytest.mark.parametrize(
    ("change", "said"),
    [(_upwards, "the lines of all images were"), (_exchanged, "x and y of all image points")],
)
def test_what_keeps_images_from_being_placed_is_named(change, said):
    block, _, _ = scenes.block()
    change(block)
    block.poses = block.poses.select([])
    with pytest.raises(
        InputError,
        match=f"cannot be placed.*\nLikely cause: {said}[^\n]*: so changed, all images can be placed",
    ):
        block.initialise()


def test_a_focal_length_that_keeps_images_from_being_placed_is_named_before_single_ones():
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=8)
    block.freeze_parameters("K.|p.|b.")
    block.cameras["c"] = replace(scenes.CAMERA, focal=3 * scenes.CAMERA.focal)
    block.poses = block.poses.select([])
    said = r"Likely cause: a focal length is wrong, or its unit \(camera c: 5400 px given, 180"
    with pytest.raises(InputError, match=said):
        block.initialise()


@pytest.mark.parametrize("frozen", ["", "PP.|"])
def test_image_points_measured_in_smaller_images_are_told_so(frozen):
    """A principal point that is free makes the block fit, far off the middle."""
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=8)
    block.freeze_parameters(f"{frozen}K.|p.|b.")
    _measured(block, block.sets[0].measures.xy / 2)
    cause = _cause(block)
    assert cause.startswith(
        "all image points were measured in images of another size than that of the camera"
    )
    assert "(x, y -> 2 x, 2 y): so changed, " in cause


def test_a_held_focal_length_of_a_free_block_is_named_where_freeing_it_makes_the_block_accepted():
    block = _block(n_images=5, n_points=16, n_control=0)
    options = {"datum": "centres"}
    assert common_cause(block, block.solve(**options), block.poses, **options) == ""
    block.cameras["c"] = replace(scenes.CAMERA, focal=1860.0)
    cause = common_cause(block, block.solve(**options), block.poses, **options)
    assert cause.startswith("a focal length is wrong, or its unit (camera c: 1860 px given, 180")


def test_images_that_no_convention_places_get_no_hint():
    block, _, _ = scenes.block(n_images=3, n_points=10)
    rng = np.random.default_rng(3)
    _measured(block, rng.uniform(0.0, 1500.0, block.sets[0].measures.xy.shape))
    block.poses = block.poses.select([])
    with pytest.raises(InputError) as refused:
        block.initialise()
    assert "so changed" not in str(refused.value)


def test_measures_that_are_in_their_images_when_exchanged_are_told_so():
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_poses(["a"], [[0.0, 0.0, 9.0]], [[0.0, 0.0, 0.0]], form="opk")
    names, xy = ["1", "2", "3"], [[100.0, 1900.0], [700.0, 800.0], [50.0, 1700.0]]
    with pytest.raises(InputError, match=r"2 measures are\); with x and y exchanged all are inside"):
        block.add_measures(ImagePoints.of(["a"] * 3, names, xy))
    with pytest.raises(InputError, match="counted from the upper left corner here"):
        block.add_measures(ImagePoints.of(["a"] * 3, names, [*xy[:2], [1900.0, 1700.0]]))
    many, millimetres = [str(k) for k in range(12)], np.linspace([1.0, 2.0], [24.0, 17.0], 12)
    with pytest.raises(InputError, match="within 24 by 17 of the corner of images of 2000 by 1500 pixels"):
        block.add_measures(ImagePoints.of(["a"] * 12, many, millimetres))


def test_a_focal_length_of_another_unit_is_named_with_the_one_that_fits():
    block = _block()
    block.cameras["c"] = replace(scenes.CAMERA, focal=3 * scenes.CAMERA.focal)
    cause = _cause(block)
    assert cause.startswith("a focal length is wrong, or its unit (camera c: 5400 px given, ")
    assert float(cause.partition("given, ")[2].split()[0]) == pytest.approx(1800.0, abs=10.0)


def test_a_good_block_has_no_cause_and_a_few_gross_errors_are_named_without_a_search(monkeypatch):
    block = _block()
    assert _cause(block) == ""
    monkeypatch.setattr(causes, "exchanged_axes", None)  # what takes time is not tried
    (part,) = block.sets
    part.measures.xy[7] += [200.0, -120.0]
    said = (
        "a gross error: image i0, point P7, off by (+200, -119) px. Without it, sigma0 falls from 21 to 0.9"
    )
    assert _cause(block).startswith(said)
    block.control.coordinates[2] += [0.5, 0.4, -0.3]
    assert _cause(block).startswith("2 gross errors: control point P2 (by +0.51")
    part.measures.xy[7] -= [200.0, -120.0]
    assert _cause(block).startswith("control points that the others and the images contradict: P2 (by +0.51")


def test_measures_that_rays_do_not_tell_apart_are_all_named():
    block = _block()
    (part,) = block.sets
    measures = part.measures
    few = (measures.point == 20) & (measures.image > 1) | (measures.point == 3) & (measures.image > 0)
    block.sets = [replace(part, measures=measures.rows(~few))]
    xy = block.sets[0].measures.xy
    xy[20] += [0.0, 150.0]
    assert "one of the 2 measures of point P20 (images i0, i1)" in _cause(block)
    xy[20] -= [0.0, 150.0]
    xy[3] += [0.0, 150.0]
    assert (
        "a gross error: the coordinates of control point P3, or its measure in image i0, the only one."
        in _cause(block)
    )


def _steps(block):
    """How often it is told what is being tried, for each of the trials."""
    said = []
    assert common_cause(block, block.solve(), block.poses, said.append) == ""
    assert all(line.startswith("the block does not fit: trying ") for line in said)
    tried = ("lines counted upwards", "x and y exchanged", "another focal")
    return [sum(f"trying {what}" in line for line in said) for what in tried]


def test_what_is_tried_is_told_and_a_hopeless_trial_is_given_up(monkeypatch):
    block = _block(n_images=4, n_points=12)
    (part,) = block.sets
    part.measures.xy[3::9] += 300.0
    for other in ("misplaced", "odd_image", "odd_control"):  # whose steps are not counted here
        monkeypatch.setattr(causes, other, lambda *_: "")
    long = _steps(block)
    monkeypatch.setattr(trials, "FEW", 1)
    monkeypatch.setattr(trials, "TIMES", 0)
    short = _steps(block)
    assert all(1 < few < many for few, many in zip(short, long, strict=True))
