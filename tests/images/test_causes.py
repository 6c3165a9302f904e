"""Mistakes that all measures share: axes of images, a focal length; single ones; or none."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from accused import codes, diagnosis, said

from obseq.errors import InputError, ObseqError
from obseq.images import BundleAdjustment, ControlPoints, ImagePoints
from obseq.images.causes.axes import with_exchanged_axes
from obseq.images.causes.shared import SharedCause, Told
from obseq.images.diagnosing import trials
from obseq.images.diagnosing.trials import Tries, due_for_missing
from obseq.images.initial import growth


@pytest.fixture(autouse=True)
def _short_trials(monkeypatch):
    """Images that can be placed are, from the first pairs; the others are the time of these tests."""
    monkeypatch.setattr(growth, "PAIRS_TRIED", 2)


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
    cause = said(block)
    assert cause.startswith("the lines of all images were counted upwards")
    assert (block.sets, block.poses) == before


@pytest.mark.parametrize("n_control", [3, 12])
def test_exchanged_image_coordinates_are_named(n_control):
    """With three control points the block does not converge; with twelve, b1 = -2 makes mirror images fit."""
    block, _, _ = scenes.block(n_control=n_control)
    _exchanged(block)
    assert said(block).startswith("x and y of all image points are exchanged")


@pytest.mark.parametrize(
    ("change", "cause"),
    [(_upwards, "the lines of all images were"), (_exchanged, "x and y of all image points")],
)
def test_axes_without_poses_are_named_whether_images_can_be_placed_or_not(change, cause):
    block, _, _ = scenes.block()
    change(block)
    block.poses = block.poses.select([])
    assert cause in said(block)


def test_a_focal_length_that_keeps_images_from_being_placed_is_named_before_single_ones():
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=8)
    block.freeze_parameters("K.|p.|b.")
    block.cameras["c"] = replace(scenes.CAMERA, focal=3 * scenes.CAMERA.focal)
    block.poses = block.poses.select([])
    cause = r"Likely cause: a focal length is wrong, or its unit \(camera c: 5400 px given, 180"
    with pytest.raises(InputError, match=cause):
        block.initialise()


@pytest.mark.parametrize("frozen", ["", "PP.|"])
def test_image_points_measured_in_smaller_images_are_told_so(frozen):
    """A principal point that is free makes the block fit, far off the middle."""
    block, _, _ = scenes.block(n_images=5, n_points=16, n_control=8)
    block.freeze_parameters(f"{frozen}K.|p.|b.")
    _measured(block, block.sets[0].measures.xy / 2)
    cause = said(block)
    assert cause.startswith(
        "all image points were measured in images of another size than that of the camera"
    )
    assert "(x, y -> 2 x, 2 y): so changed, " in cause


def test_a_held_focal_length_of_a_free_block_is_named():
    block = _block(n_images=5, n_points=16, n_control=0)
    options = {"datum": "centres"}
    assert diagnosis(block, **options).is_quiet
    block.cameras["c"] = replace(scenes.CAMERA, focal=1860.0)
    found = diagnosis(block, **options)
    (one,) = found.accused
    assert (one.code, one.what) == ("I130", "F of camera c")
    assert one.size[0] == pytest.approx(60.0, abs=10.0)


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
    cause = said(block)
    assert cause.startswith("a focal length is wrong, or its unit (camera c: 5400 px given, ")
    assert float(cause.partition("given, ")[2].split()[0]) == pytest.approx(1800.0, abs=10.0)


def test_a_good_block_has_no_cause_and_single_errors_are_named_with_their_sizes():
    block = _block()
    assert diagnosis(block).is_quiet
    (part,) = block.sets
    part.measures.xy[7] += [200.0, -120.0]
    (one,) = diagnosis(block).accused
    assert (one.code, one.what) == ("I100", "image i0, point P7")
    assert one.size == pytest.approx([200.0, -120.0], abs=2.0)
    block.control.coordinates[2] += [0.5, 0.4, -0.3]
    assert set(codes(block)) == {("I100", "image i0, point P7"), ("I111", "control point P2")}
    part.measures.xy[7] -= [200.0, -120.0]
    (one,) = diagnosis(block).accused
    assert one.what == "control point P2"
    assert one.size == pytest.approx([0.5, 0.4, -0.3], abs=0.02)


def test_measures_that_rays_do_not_tell_apart_are_all_named():
    block = _block()
    (part,) = block.sets
    measures = part.measures
    few = (measures.point == 20) & (measures.image > 1) | (measures.point == 3) & (measures.image > 0)
    block.sets = [replace(part, measures=measures.rows(~few))]
    xy = block.sets[0].measures.xy
    xy[20] += [0.0, 150.0]
    (one,) = diagnosis(block).accused
    assert {one.what, *(other.what for other in one.others)} == {
        "image i0, point P20",
        "image i1, point P20",
    }
    xy[20] -= [0.0, 150.0]
    xy[3] += [0.0, 150.0]
    (one,) = diagnosis(block).accused
    assert {"image i0, point P3", "control point P3"} <= {one.what, *(other.what for other in one.others)}


@pytest.mark.parametrize(("is_sure", "is_accepted", "asked"), [(1, 1, 1), (0, 1, 2), (1, 0, 2)])
def test_nothing_else_is_tried_where_a_sure_cause_explains_all(monkeypatch, is_sure, is_accepted, asked):
    tried = []

    def cause(name):
        def changed(subject):
            tried.append(name)
            yield name

        return SharedCause(name, "", "", "", "", 0.0, changed, is_sure=bool(is_sure))

    solution = SimpleNamespace(result=SimpleNamespace(redundancy=10), poses=None)

    def fit(tries, cause, trial):
        yield SimpleNamespace(
            cause=cause, told=Told(trial), left=10.0, solution=solution, is_accepted=bool(is_accepted)
        )

    monkeypatch.setattr(Tries, "_fit", fit)
    monkeypatch.setattr(trials, "principal_shift", lambda found: 0.0)
    monkeypatch.setattr(trials, "moved", lambda found, given: 0.0)
    tries = Tries(SimpleNamespace(solution=None, given=None), str, {})
    found = tries.best([cause("first"), cause("second")])
    assert tried == ["first", "second"][:asked] and len(found) == asked


@pytest.mark.parametrize("off", [-14.0, 35.0, 2500.0])
@pytest.mark.parametrize("is_free", [True, False])
def test_a_control_coordinate_that_is_far_off_is_named_however_far(off, is_free):
    """Also where the point lies behind cameras then, or iterations lead to no camera that is possible."""
    block, _, _ = scenes.block(n_images=5, n_points=18, n_control=9, seed=4)
    block.freeze_parameters("K.|p.|b." if is_free else ".*")
    block.poses = block.poses.select([])
    block.control.coordinates[6, 1] += off
    try:
        (one,) = diagnosis(block).accused
    except InputError as error:
        assert "Likely cause: y of control point P6 is off by" in str(error)
    else:
        assert one.what == "y of control point P6" and one.size == pytest.approx([off], abs=0.05)


def test_image_points_that_an_explanation_leaves_out_are_paid_for_as_errors():
    block = _block(n_images=4, n_points=12)
    whole = block.solve()
    assert due_for_missing(whole) == 0.0
    (part,) = block.sets
    few = part.measures.point >= 10
    less = block.solve()
    object.__setattr__(less, "block", block)
    residuals = less.residuals
    kept = ~few[residuals.row]
    object.__setattr__(less, "residuals", replace(residuals, point=residuals.point[kept]))
    assert due_for_missing(less) / np.count_nonzero(few) > 10.0


@pytest.mark.parametrize("sign", ["x", "lines"])
def test_the_one_point_off_the_plane_of_the_others_is_not_accused_alone_where_a_mirror_image_fits(sign):
    """Control on a plane but for P3, whose sign explains all: nothing tells that from mirrored axes."""
    rng = np.random.default_rng(23)
    points = np.column_stack([rng.uniform(-2.0, 2.0, (14, 2)), np.zeros(14)])
    points[[3, 9, 11], 2] = 0.6, -0.5, 0.7
    names, true = [f"P{k}" for k in range(14)], scenes.ring(5)[0]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.freeze_parameters()
    block.add_images(dict.fromkeys(true.images, "c"), "c")
    block.add_control_points(ControlPoints.of(names[:7], points[:7], 0.002))
    block.add_measures(scenes.measured(true, points, names, 0.3, seed=24))
    if sign == "lines":
        _upwards(block)
    else:
        block.control = with_exchanged_axes(block.control)
    (one,) = diagnosis(block).accused
    told = [one.what, *(other.what for other in one.others)]
    assert any(what.startswith("the lines of all images were counted upwards") for what in told)
    assert any("x and y of the control points are exchanged" in what for what in told)
    assert any("their heights count downwards" in what for what in told)
    assert "z of control point P3" in told


def test_two_measures_outside_are_told_from_exchanged_axes_by_how_likely_all_others_fit_exchanged():
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.add_poses(["a"], [[0.0, 0.0, 9.0]], [[0.0, 0.0, 0.0]], form="opk")
    rng, names = np.random.default_rng(5), [str(k) for k in range(60)]
    xy = rng.uniform([0.0, 0.0], [1490.0, 1490.0], (60, 2))
    xy[:2, 1] = 1600.0, 1700.0
    with pytest.raises(InputError, match=r"2 measures are\); with x and y exchanged all are inside"):
        block.add_measures(ImagePoints.of(["a"] * 60, names, xy))
    xy[5] = 1900.0, 300.0
    with pytest.raises(InputError, match="correct them, or delete their lines"):
        block.add_measures(ImagePoints.of(["a"] * 60, names, xy))


@pytest.mark.parametrize("is_placed", [True, False])
def test_a_sigma_that_hides_all_others_is_named(is_placed):
    block = _block(n_images=4, n_points=12)
    if not is_placed:
        block.poses = block.poses.select([])
    (part,) = block.sets
    part.measures.sigmas[5] = 1e-13
    with pytest.raises(ObseqError, match="image i0, point P5: a sigma of 1e-13 pixels hides what the others"):
        block.initialise()
        block.solve()
