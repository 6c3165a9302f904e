"""Distances and sub-frames on numbers that a person can follow."""

import pytest

from obseq.formulas.topography import Dist3D, Dist3DParam, TopoSubFrame


def test_distance_of_the_2_3_6_box_is_7():
    (value,) = Dist3D().evaluate((1, 1, 1, 3, 4, 7), [6.0])
    assert value == pytest.approx(1.0, abs=1e-15)


def test_unknown_distance_comes_first():
    (value,) = Dist3DParam().evaluate((6.0, 1, 1, 1, 3, 4, 7), [])
    assert value == pytest.approx(1.0, abs=1e-15)


def test_sub_frame_turns_the_vector():
    # R maps frame to sub-frame: (1, 2, 3) becomes (2, -1, 3); observed (2, -1, 2.5).
    matrix = (0, 1, 0, -1, 0, 0, 0, 0, 1)
    residual = TopoSubFrame().evaluate((0, 0, 0, 10, 10, 10, 11, 12, 13), (*matrix, 2, -1, 2.5))
    assert residual == pytest.approx((0, 0, 0.5), abs=1e-15)


def test_small_rotation_of_a_sub_frame_is_on_the_left():
    # r ^ (1, 0, 0) with r = (0, 0, 0.01) is (0, 0.01, 0).
    identity = (1, 0, 0, 0, 1, 0, 0, 0, 1)
    residual = TopoSubFrame().evaluate((0, 0, 0.01, 0, 0, 0, 1, 0, 0), (*identity, 1, 0, 0))
    assert residual == pytest.approx((0, 0.01, 0), abs=1e-15)
