"""Plane geometry, on triangles that a person can follow."""

import math

import pytest

from obseq.formulas import find
from obseq.formulas.plane import (
    Dist2DCons,
    PropCovNwCD,
    RatioDist2DCons,
    SetPointNwCDFixed,
    SetPointNwCDUnknown,
    SumSquare,
)


def test_sum_of_squares_is_observed_minus_computed() -> None:
    # 200 - (1 + 4 + 9 + ... + 64) = 200 - 204
    assert SumSquare(8).evaluate(range(1, 9), (200,)) == (-4,)


def test_a_3_4_5_triangle_observed_as_4_is_a_quarter_too_long() -> None:
    assert Dist2DCons().evaluate((1, 2, 4, 6), (4,)) == pytest.approx((0.25,))


def test_ratios_of_a_triangle() -> None:
    # Sides 5, 6, 5 observed as 5, 6, 4: ratios 1, 1, 1.25.
    found = RatioDist2DCons().evaluate((0, 0, 3, 4, 6, 0), (5, 6, 4))
    assert found == pytest.approx((0, -0.25, -0.25), abs=1e-15)


def test_ratios_do_not_depend_on_the_scale() -> None:
    observations = (5, 6, 4)
    one = RatioDist2DCons().evaluate((0, 0, 3, 4, 6, 0), observations)
    assert RatioDist2DCons().evaluate((0, 0, 3, 4, 6, 0), [7 * d for d in observations]) == pytest.approx(
        tuple(r / 7 for r in one), abs=1e-15
    )


def test_a_group_is_turned_from_x_to_y_then_translated() -> None:
    # A quarter turn takes (2, 1) to (-1, 2), then (10, 20) is added: (9, 22).
    motion = (10, 20, math.pi / 2)
    assert SetPointNwCDUnknown(1).evaluate((*motion, 2, 1), (9, 21)) == pytest.approx((0, 1), abs=1e-14)
    assert SetPointNwCDFixed(1).evaluate((2, 1), (*motion, 9, 21)) == pytest.approx((0, 1), abs=1e-14)


def test_a_linear_form_is_of_the_moved_points() -> None:
    # The points (2, 1) and (0, 3) move to (9, 22) and (7, 20): 9 + 2 * 22 + 3 * 7 - 20 - 50 = 4.
    unknowns = (10, 20, math.pi / 2, 2, 1, 0, 3)
    assert PropCovNwCD(2).evaluate(unknowns, (1, 2, 3, -1, 50)) == pytest.approx((4,), abs=1e-13)


@pytest.mark.parametrize(
    "formula", [SumSquare(3), PropCovNwCD(5), SetPointNwCDUnknown(12), SetPointNwCDFixed(1)]
)
def test_any_number_of_points_has_a_name(formula: SumSquare) -> None:
    assert find(formula.name) == formula


def test_names_that_mean_nothing() -> None:
    assert find("SetPointNwCD_RotUK") is None
