"""Set-ups that are not plumb, in networks where nothing else says how they stand."""

import math

import numpy as np
import pytest
from sketch import GON, A, B, C, P, Q, Sketch

from obseq.geometry import rotation_z
from obseq.survey.initial.tilted_frames import uprights

FIRST = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
SECOND = FIRST @ rotation_z(1.0) @ FIRST
R, S = (-40.0, 20.0, 8.0), (70.0, -30.0, 40.0)
POINTS = {"A": A, "B": B, "C": C, "P": P, "Q": Q, "R": R, "S": S}


def two_instruments(folder):
    """Two tilted instruments that share four points; both see what the other does not."""
    sketch = Sketch(folder, **POINTS).write("#BASC").dxyz("A", "B", "C", "P", "Q", rotation=FIRST)
    return sketch.write("#BASC").dxyz("R", "B", "C", "P", "S", rotation=SECOND)


def azimuth(sketch, a, b):
    east, north, _ = sketch.truth[b] - sketch.truth[a]
    return sketch.write(f"8 {a} {b} {math.atan2(east, north) * GON!r} 0.001")


def test_heights_and_an_azimuth_place_what_hangs_on_one_known_point(tmp_path):
    sketch = azimuth(two_instruments(tmp_path).write("#FIX").dh("A", "B", "C", "P", "Q"), "B", "P")
    solution = sketch.solve("A")
    solution.assert_true("local frame of station A tied to A", "local frame of station R tied to A")
    np.testing.assert_allclose(solution.values.rotations[:2], [FIRST, SECOND], atol=1e-9)


def test_two_known_points_turn_it(tmp_path):
    two_instruments(tmp_path).write("#FIX").dh("A", "B", "C", "P").solve("A", "S").assert_true()


def test_three_heights_leave_a_mirror_image_that_nothing_contradicts(tmp_path):
    sketch = azimuth(two_instruments(tmp_path).write("#FIX").dh("A", "B", "C"), "B", "P")
    reason = sketch.solve("A").reason("P")
    assert "cannot be used: the orientation of the station is unknown" in reason


def test_an_approximate_point_tells_it_from_its_mirror_image(tmp_path):
    sketch = two_instruments(tmp_path).write("#FIX").dh("A", "B", "C")
    values = sketch.solve("A", "S", hints={"P": np.add(P, (3.0, -2.0, 0.0))}).values
    assert values.unplaced == ()
    row = sketch.solve("A", "S", hints={"P": P}).names.index("Q")
    assert np.linalg.norm(values.coordinates[row] - Q) < 10.0  # the image is 40 m away


def test_points_on_a_line_say_nothing_of_the_vertical():
    places = np.outer([0.0, 1.0, 3.0], [1.0, 2.0, 2.0])
    assert uprights(places, places[:, 2]) == []
    assert uprights(places[:2], places[:2, 2]) == []


def test_both_ways_keep_the_heights_and_are_rotations():
    places = np.array([A, B, C]) @ FIRST
    heights = np.array([A, B, C])[:, 2]
    found = uprights(places, heights)
    assert len(found) == 2
    for turn in found:
        np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) == pytest.approx(1.0)
        np.testing.assert_allclose(np.ptp((places @ turn.T)[:, 2] - heights), 0.0, atol=1e-9)
