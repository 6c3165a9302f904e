"""Clinometers, on inclinations that a person can follow."""

import math

import pytest

from obseq.errors import FormulaError
from obseq.formulas import find
from obseq.formulas.clinometers import ClinoBloc, ClinoInBlock, ClinoNeedle, ClinoRot

IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
QUARTER = (0, -1, 0, 1, 0, 0, 0, 0, 1)
AXIS_X = (1, 0, 0, 0, 1, 0, 0, 0, 1)
"""Unit vector x, with the tangents y and z."""
NEUTRAL = (0, 1, 0, 0)


def in_block(sine_of_axis: float, angle: float, correction: tuple[float, ...] = NEUTRAL) -> float:
    """Residual for an axis at a given sine above the horizon, the vertical being z."""
    cosine = math.sqrt(1 - sine_of_axis**2)
    axis = (cosine, 0, sine_of_axis, 0, 1, 0, -sine_of_axis, 0, cosine)
    vertical = (0, 0, 1, 1, 0, 0, 0, 1, 0)
    unknowns = (7, 8, 9, 0, 0, 0, 0, 0, 0, 0, *correction)
    (found,) = ClinoInBlock().evaluate(unknowns, (*IDENTITY, *axis, *vertical, angle))
    return found


def test_the_reading_of_a_perfect_clinometer_is_the_inclination() -> None:
    assert in_block(0.6, math.asin(0.6)) == pytest.approx(0, abs=1e-15)
    assert in_block(0.6, math.asin(0.5)) == pytest.approx(0.1, abs=1e-15)


def test_the_correction_is_a_polynomial_of_the_sine() -> None:
    # 0.01 + 1.02 s + 0.5 s^2 - s^3 at s = 0.5: 0.01 + 0.51 + 0.125 - 0.125 = 0.52.
    assert in_block(0.6, math.asin(0.5), (0.01, 1.02, 0.5, -1)) == pytest.approx(0.08, abs=1e-15)


def test_a_block_turned_by_a_quarter_carries_its_axis() -> None:
    # The axis is x of the block, which is y of the world; the "vertical" is y: the sine is 1.
    vertical = (0, 1, 0, 1, 0, 0, 0, 0, 1)
    unknowns = (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, *NEUTRAL)
    assert ClinoInBlock().evaluate(unknowns, (*QUARTER, *AXIS_X, *vertical, 0.0)) == pytest.approx((1,))


def test_the_angle_of_the_vertical_is_counted_from_x_towards_y() -> None:
    # Clinometer = camera = world; the vertical (3, 4, 12) projects on (3, 4): cosine 0.6, sine 0.8.
    unknowns = (0, 0, 0, 5, 6, 7, 0, 0, 0)
    found = ClinoBloc().evaluate(unknowns, (*IDENTITY, 3, 4, 12, *IDENTITY, math.pi / 2))
    assert found == pytest.approx((0.6, -0.2), abs=1e-15)


def test_the_boresight_applies_after_the_camera() -> None:
    # Camera to world is a quarter turn: the world's y is x in the camera; the boresight turns it to y again.
    unknowns = (0,) * 9
    found = ClinoBloc().evaluate(unknowns, (*QUARTER, 0, 1, 0, *QUARTER, math.pi / 2))
    assert found == pytest.approx((0, 0), abs=1e-15)


def test_a_needle_shows_the_angle_of_the_vertical() -> None:
    # The vertical (3, 4, 12) projects on (3, 4), and from a half turn on the difference is wrapped.
    for angle in (0.0, math.pi):
        (found,) = ClinoNeedle().evaluate((0,) * 6, (*IDENTITY, *IDENTITY, 3, 4, 12, angle))
        assert found == pytest.approx(math.atan2(4, 3) - angle, abs=1e-15)
    (found,) = ClinoNeedle().evaluate((0,) * 6, (*IDENTITY, *IDENTITY, -1, -0.1, 0, math.pi))
    assert found == pytest.approx(math.atan(0.1), abs=1e-15)
    # Camera to world is a quarter turn, the boresight turns back: y is y.
    (found,) = ClinoNeedle().evaluate((0,) * 6, (*QUARTER, *QUARTER, 0, 1, 0, 0.0))
    assert found == pytest.approx(math.pi / 2, abs=1e-15)


def test_relative_orientation_of_two_clinometers() -> None:
    # B2 B1^T with B1 a quarter and B2 none is the opposite quarter turn.
    opposite = (0, 1, 0, -1, 0, 0, 0, 0, 1)
    found = ClinoRot().evaluate((0,) * 6, (*QUARTER, *IDENTITY, *opposite))
    assert found == pytest.approx((0,) * 9, abs=1e-15)
    # B2 = I - [w]x with w_z = 0.01 has +0.01 at row 0, column 1.
    found = ClinoRot().evaluate((0, 0, 0, 0, 0, 0.01), (*IDENTITY, *IDENTITY, *IDENTITY))
    assert found == pytest.approx((0, 0.01, 0, -0.01, 0, 0, 0, 0, 0), abs=1e-15)


def test_degrees_of_the_correction_are_in_the_name() -> None:
    member = find("Clino_1_2")
    assert member == ClinoInBlock(1, 2)
    assert member.unknowns[-2:] == ("DCorrAng_1", "DCorrAng_2")
    with pytest.raises(FormulaError, match="first must be at most last, 1, not 2"):
        find("Clino_2_1")
