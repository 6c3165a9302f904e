"""What some measures share: an image of other axes or size, points that were exchanged; and verdicts."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from accused import codes, diagnosis

from obseq.errors import InputError
from obseq.images import BundleAdjustment, ControlPoints, ImagePoints, Poses
from obseq.images.initial import growth
from obseq.images.output.block_record import BundleRecord
from obseq.images.output.page_findings import distrusted
from obseq.images.output.record import record_of
from obseq.images.output.shares import RejectedShare

SIZE = np.array([scenes.CAMERA.width, scenes.CAMERA.height])


@pytest.fixture(autouse=True)
def _short_trials(monkeypatch):
    """What is right fits after a few iterations; the trials of what is wrong are the time of these tests."""
    monkeypatch.setattr(growth, "PAIRS_TRIED", 2)


def _block(**shape):
    block, _, _ = scenes.block(**{"n_images": 5, "n_points": 16, "n_control": 7, **shape})
    block.freeze_parameters("K.|p.|b.")
    return block


def _rows(block, image):
    measures = block.sets[0].measures
    return np.flatnonzero(measures.image == measures.image_names.index(image))


def _changed(block, image, change):
    (part,) = block.sets
    xy, rows = part.measures.xy.copy(), _rows(block, image)
    xy[rows] = change(xy[rows])
    block.sets = [replace(part, measures=replace(part.measures, xy=xy))]
    return len(rows)


def _upwards(xy):
    return np.column_stack([xy[:, 0], SIZE[1] - xy[:, 1]])


@pytest.mark.parametrize(
    ("change", "slip"),
    [(_upwards, "W140"), (lambda xy: xy / 2.0, "W143")],
)
def test_one_image_of_another_convention_is_named_with_it(change, slip):
    block = _block()
    _changed(block, "i3", change)
    before = block.sets, block.poses
    found = diagnosis(block)
    (one,) = found.accused
    assert (one.code, one.images, [told.code for told in one.slips]) == ("I120", ("i3",), [slip])
    assert found.status == "explained" and found.sigma0 < 1.5
    assert (block.sets, block.poses) == before


def test_an_image_that_contradicts_the_others_is_named_without_a_convention():
    block = _block()
    rng = np.random.default_rng(0)
    _changed(block, "i2", lambda xy: rng.permutation(xy))
    assert codes(block) == {("I120", "image i2"): set()}


def _refused(block):
    block.poses = block.poses.select([])
    with pytest.raises(InputError, match="cannot be placed") as refused:
        block.initialise()
    return str(refused.value).partition("\nLikely cause: ")[2]


def test_an_image_that_cannot_be_placed_is_told_the_convention_that_places_it():
    block = _block()
    _changed(block, "i2", _upwards)
    assert _refused(block).startswith("image i2: lines count upwards (y -> height - y)")


def test_two_images_that_cannot_be_placed_are_both_named():
    block = _block(n_images=6)
    rng = np.random.default_rng(4)
    for image in ("i1", "i4"):
        _changed(block, image, rng.permutation)
    told = _refused(block)
    assert "image i1: it contradicts the others" in told and "image i4: it contradicts the others" in told


def test_an_image_that_shares_no_points_contradicts_nothing():
    block = _block()
    block.add_images(["alone"], "c")
    measures = ImagePoints.of(
        ["alone"] * 4, ["a", "b", "c", "d"], [[100, 90], [900, 200], [300, 900], [1500, 800]]
    )
    block.add_measures(measures)
    assert _refused(block) == ""


def test_the_images_of_one_camera_are_named_together():
    block = _block(n_images=6)
    block.add_cameras(replace(scenes.CAMERA, name="d"))
    for image in ("i1", "i4"):
        block.camera_of[image] = "d"
        _changed(block, image, _upwards)
    block.poses = replace(block.poses, cameras=tuple(block.camera_of.values()))
    assert codes(block) == {("I121", "the images of camera d"): {"W140"}}


def test_two_images_of_another_convention_are_named():
    block = _block(n_images=6)
    for image in ("i1", "i4"):
        _changed(block, image, _upwards)
    assert codes(block) == {("I120", f"image {name}"): {"W140"} for name in ("i1", "i4")}


def test_an_image_of_another_camera_is_named():
    block = _block(n_images=6)
    block.add_cameras(replace(scenes.CAMERA, name="d", focal=1.3 * scenes.CAMERA.focal))
    for image in ("i1", "i4"):
        block.camera_of[image] = "d"
        _changed(block, image, lambda xy: SIZE / 2 + 1.3 * (xy - SIZE / 2))
    _changed(block, "i2", lambda xy: SIZE / 2 + 1.3 * (xy - SIZE / 2))
    block.poses = replace(block.poses, cameras=tuple(block.camera_of.values()))
    block.freeze_parameters()
    assert codes(block) == {("I120", "image i2"): {"W144"}}


@pytest.mark.parametrize("is_placed", [True, False])
def test_two_exchanged_measures_of_an_image_are_named(is_placed):
    block = _block()
    xy, rows = block.sets[0].measures.xy, _rows(block, "i1")[[2, 9]]
    xy[rows] = xy[rows[::-1]]
    if not is_placed:
        block.poses = block.poses.select([])
    labels = block.sets[0].measures.labels(rows)
    assert codes(block) == {("I100", label): {"W113"} for label in labels}


def _aerial():
    """Two strips of three vertical images over a grid of points, every seventh known; without poses."""
    x, y = (
        grid.ravel() for grid in np.meshgrid(np.arange(-70.0, 220.0, 36.0), np.arange(-60.0, 150.0, 36.0))
    )
    points = np.column_stack([x, y, 15.0 * np.sin(x / 40.0) * np.cos(y / 30.0)])
    east, north = (grid.ravel() for grid in np.meshgrid([0.0, 70.0, 140.0], [0.0, 80.0]))
    rng = np.random.default_rng(0)
    centres = np.column_stack([east, north, 200.0 + rng.normal(0.0, 3.0, 6)])
    images = [f"i{k}" for k in range(6)]
    poses = Poses.of(images, centres, np.radians(rng.normal(0.0, 2.0, (6, 3))), "opk", "c")
    names = [f"P{k}" for k in range(len(points))]
    block = BundleAdjustment()
    block.add_cameras(scenes.CAMERA)
    block.freeze_parameters("K.|p.|b.")
    block.add_images(images, "c")
    block.add_measures(scenes.measured(poses, points, names, 0.5))
    block.add_control_points(ControlPoints.of(names[::7], points[::7], 0.01))
    return block


def test_exchanged_points_that_lead_an_aerial_block_astray_are_named():
    """P5 is in two images only: where it should be is on a line, where it was measured is P24."""
    block = _aerial()
    (part,) = block.sets
    labels = part.measures.labels(np.arange(len(part.measures)))
    names = [f"image i2, point {name}" for name in ("P24", "P5")]
    rows = [labels.index(name) for name in names]
    part.measures.xy[rows] = part.measures.xy[rows[::-1]]
    found = codes(block)
    assert set(found) == {("I100", name) for name in names}
    assert found["I100", names[1]] == {"W112"}


def test_exchanged_control_points_that_keep_images_from_being_placed_are_named():
    block = _aerial()
    block.control.coordinates[[0, 3]] = block.control.coordinates[[3, 0]]
    with pytest.raises(InputError, match=r"Likely cause: control point P.* control point P"):
        block.initialise()


def test_all_control_points_that_are_wrong_are_named():
    block = _block(n_control=8)
    block.control.coordinates[[2, 5], [1, 2]] += [0.06, -0.06]
    assert set(codes(block)) == {
        ("I110", "y of control point P2"),
        ("I110", "z of control point P5"),
    }


def test_single_gross_errors_are_no_exchange_and_no_odd_image():
    rng = np.random.default_rng(0)
    block = _block()
    block.sets[0].measures.xy[rng.integers(len(block.sets[0].measures))] += rng.normal(0.0, 60.0, 2)
    assert codes(block) == {("I100", "image i4, point P4"): set()}
    block = _block()
    block.control.coordinates[2] += rng.normal(0.0, 0.3, 3)
    assert set(codes(block)) == {("I111", "control point P2")}


# Verdicts


def _record(block):
    return record_of(block.solve())


def test_a_block_of_which_most_is_rejected_is_no_success():
    block = _block()
    (part,) = block.sets
    block.sets = [replace(part, measures=replace(part.measures, sigmas=part.measures.sigmas / 9.0))]
    record = _record(block)
    assert record.converged and not record.is_complete
    (share,) = record.rejected_shares
    assert share.name == "the block" and share.rejected > share.tested / 2
    assert distrusted(record).startswith("the result is not to be trusted: half of")


def test_an_image_that_is_rejected_as_a_whole_is_named_though_no_measure_of_it_is_the_worst():
    """All its measures are seven times worse than those of the others, none is beyond the limit of all."""
    block = _block(n_images=8, n_points=30)
    noise = np.random.default_rng(1)
    _changed(block, "i5", lambda xy: xy + 3.5 * np.sign(noise.normal(size=xy.shape)))
    record = _record(block)
    assert record.converged and not record.is_complete
    assert [share.name for share in record.rejected_shares] == ["image i5"]
    assert distrusted(record).startswith("1 of 8 images is not to be trusted: half of")
    assert "image i5 (" in distrusted(record)


def test_what_is_rejected_is_told_in_scale(monkeypatch):
    record = _record(_block())

    def told(kind, count):
        shares = tuple(RejectedShare(kind, f"{kind} {k}", 4, 6) for k in range(count))
        monkeypatch.setattr(BundleRecord, "rejected_shares", property(lambda _: shares))
        assert not record.is_complete
        return distrusted(record)

    assert told("point", 4).startswith("4 of 16 points are not to be trusted: half of")
    assert "point 0 (4 of 6), point 1 (4 of 6)" in told("point", 4)
    assert told("point", 8).startswith("the result is not to be trusted")
    assert told("image", 2).startswith("2 of 5 images are not to be trusted")


def test_a_good_block_is_trusted():
    record = _record(_block())
    assert record.is_complete and not record.rejected_shares and not distrusted(record)
