"""What is suspected to be a gross error, and when one of several only is."""

import numpy as np
import pytest
import scenes

from obseq.images import BundleAdjustment, Camera, ControlPoints, Poses
from obseq.images.output.record import record_of
from obseq.images.output.summary import suspected


def _strip(n_control, k1=-0.08, height_error=0.0):
    """Eight aerial images of 60 points, with a calibration that is held; some points are control points."""
    rng = np.random.default_rng(0)
    centres = [[x, y, 10.0] for x in (0.0, 2.5, 5.0, 7.5) for y in (0.0, 3.0)]
    poses = Poses.of([f"i{k}" for k in range(8)], centres, np.zeros((8, 3)), "opk", "c")
    points = np.column_stack([rng.uniform(-3, 10, 60), rng.uniform(-3, 6, 60), rng.uniform(0, 1, 60)])
    names = [f"P{k}" for k in range(60)]
    block = BundleAdjustment()
    distortion = {"K1": k1, "K2": 0.02, "p1": 1e-3}
    block.add_cameras(Camera("c", 2000, 1500, 1800.0, degree=(3, 1, 1), distortion=distortion))
    block.freeze_parameters()
    block.add_poses(poses)
    rows = np.argsort(points[:, 0])[np.linspace(0, 59, n_control).astype(int)]
    known = points[rows]
    known[1, 2] += height_error
    block.add_control_points(ControlPoints.of([names[row] for row in rows], known, 0.001))
    block.add_measures(scenes.measured(poses, points, names, 0.5))
    return record_of(block.solve()), names[rows[1]]


def test_three_control_points_do_not_tell_a_wrong_distortion_from_a_wrong_point():
    record, _ = _strip(3, k1=-0.05)
    assert record.suspicion.alike > 1
    said = suspected(record)
    assert said.startswith(f"one of {1 + record.suspicion.alike} observations is suspected")
    assert "whether they share a cause" in said
    assert len({item.name.split()[2] for item in record.suspicion.largest[:4]}) > 1  # of several points
    assert not record.is_complete


@pytest.mark.parametrize("n_control", [6, 8])
def test_more_control_points_name_the_wrong_one(n_control):
    record, wrong = _strip(n_control, height_error=0.1)
    assert record.suspicion.alike == 0
    assert suspected(record).startswith(f"a gross error is suspected: control point {wrong} z, off by +0.")


def test_nothing_is_like_the_largest_test_of_a_good_block():
    record, _ = _strip(8)
    assert (record.suspects, record.suspicion.alike, suspected(record)) == ((), 0, "")
