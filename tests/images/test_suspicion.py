"""What is said of errors in blocks, with full weights and with robust ones."""

import numpy as np
import pytest
import scenes

from obseq.images import BundleAdjustment, Camera, ControlPoints, Poses, Weighting
from obseq.images.diagnosing.diagnosis import diagnosed
from obseq.images.output.page_findings import distrusted
from obseq.images.output.record import record_of


def _strip(n_control, k1=-0.08, height_error=0.0, weighting=None):
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
    block.add_measures(scenes.measured(poses, points, names, 0.5), weighting)
    solution = block.solve()
    return record_of(solution, diagnosis=diagnosed(solution, block.poses)), names[rows[1]]


@pytest.mark.parametrize("weighting", [None, Weighting(0.5, 1.0, None, 2.0)])
@pytest.mark.parametrize("n_control", [6, 8])
def test_more_control_points_name_the_wrong_one(n_control, weighting):
    record, wrong = _strip(n_control, height_error=0.1, weighting=weighting)
    (one,) = record.diagnosis.accused
    assert record.diagnosis.accused[0].text.startswith(f"z of control point {wrong} is off by +0.")
    assert [(known.name, known.coordinate) for known in one.points] == [(wrong, "z")]
    assert not record.is_complete


def test_nothing_is_said_of_a_good_block():
    record, _ = _strip(8)
    assert (record.diagnosis.accused, distrusted(record), record.is_complete) == ((), "", True)
    largest = [abs(item.w) for item in record.reliability.largest.largest]
    assert largest == sorted(largest, reverse=True) and largest[0] < 5.0
    assert 0.8 < record.reliability.largest.spread < 1.2
