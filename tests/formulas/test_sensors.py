"""Corrected sensors and rational cameras, on numbers that a person can follow."""

import numpy as np
import pytest

from obseq.formulas import find
from obseq.formulas.sensors import CorrectedSensor, ImageCorrection, RationalCamera, cubic
from obseq.kernels import calculator


def test_coefficients_are_enumerated_by_powers_of_x():
    expected = "x_0_0 y_0_0 x_0_1 y_0_1 x_0_2 y_0_2 x_1_0 y_1_0 x_1_1 y_1_1 x_2_0 y_2_0"
    assert ImageCorrection(2).parameters == tuple(expected.split())
    assert [len(ImageCorrection(degree).parameters) for degree in range(5)] == [2, 6, 12, 20, 30]


def test_correction_is_added_to_the_identity():
    # Of degree 1 at (10, 20): x = 10 + 1 + 0.1 * 20 + 0.5 * 10, y = 20 + 2 + 0.2 * 20 + 0.3 * 10.
    assert ImageCorrection(1).evaluate((10, 20), (1, 2, 0.1, 0.2, 0.5, 0.3)) == pytest.approx((18, 29))
    assert ImageCorrection(0).evaluate((10, 20), (1, -2)) == (11, 18)


@pytest.mark.parametrize("degree", range(5))
def test_correction_is_the_sum_of_its_terms(degree):
    formula = ImageCorrection(degree)
    x, y = point = (0.7, -1.3)
    values = np.random.default_rng(degree).normal(size=len(formula.parameters))
    expected = np.array(point)
    for name, value in zip(formula.parameters, values, strict=True):
        on, i, j = name.split("_")
        expected["xy".index(on)] += value * x ** int(i) * y ** int(j)
    assert formula.evaluate(point, values) == pytest.approx(tuple(expected), rel=1e-13)


def test_corrected_sensor():
    # Moved by (1, 2, 3) m from P0: line 100 + 1 + 2 * 2 - 3 = 102, column 200 + 2 * 3 = 206; the correction
    # of degree 1 adds 1 + 0.1 * 206 to the line and 2 + 0.01 * 102 to the column.
    gradients = (1, 2, -1, 0, 0, 2)
    observations = (120, 200, 5, 6, 7, 100, 200, *gradients)
    residual = CorrectedSensor(1).evaluate((6, 8, 10, 1, 2, 0.1, 0, 0, 0.01), observations)
    assert residual == pytest.approx((102 + 21.6 - 120, 206 + 3.02 - 200), rel=1e-14)


def _rational(ground, numerator, denominator, offset_in=(0, 0, 0), scale_in=(1, 1, 1)):
    """Line of a rational camera whose outputs are neither moved nor scaled; its column is constant, 7."""
    column = ([7.0, *[0.0] * 19], [1.0, *[0.0] * 19])
    observations = (*offset_in, *scale_in, 0, 0, 0, 1, 1, 1, *numerator, *denominator, *column[0], *column[1])
    return RationalCamera().evaluate(ground, observations)


def test_monomials_of_a_cubic_are_in_the_order_of_rpc00b():
    # The first variable of the standard is y here, the second x: 1 y x z yx yz xz y2 x2 z2 xyz y3 yx2 yz2 ...
    x, y, z = 2.0, 3.0, 5.0
    expected = [1, 3, 2, 5, 6, 15, 10, 9, 4, 25, 30, 27, 12, 75, 18, 8, 50, 45, 20, 125]
    assert [cubic(tuple(np.eye(20)[k]), x, y, z) for k in range(20)] == expected


def test_rational_camera():
    one, height = [1.0, *[0.0] * 19], 30.0
    numerator = [0.0, 2.0, *[0.0] * 18]
    # Twice the longitude over 1, then over 1 + x = 1.5 with x = (101 - 100)/2, y = (43 - 37)/2.
    assert _rational((0.5, 3.0, height), numerator, one) == pytest.approx((6, 7, height))
    denominator = [1.0, 0.0, 1.0, *[0.0] * 17]
    found = _rational((101, 43.0, height), numerator, denominator, (100, 37, 0), (2, 2, 1))
    assert found == pytest.approx((4, 7, height))


def test_outputs_of_a_rational_camera_are_scaled_then_moved():
    one = [1.0, *[0.0] * 19]
    observations = (0, 0, 10, 1, 1, 5, 100, 200, 300, 2, 3, 4, *one, *one, *one, *one)
    # z is (30 - 10)/5.
    assert RationalCamera().evaluate((1, 2, 30), observations) == pytest.approx((102, 203, 316))


def test_rational_camera_is_not_finite_where_a_denominator_vanishes():
    zero, one = [0.0] * 20, [1.0, *[0.0] * 19]
    observations = [[0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1, *one, *d, *one, *one] for d in (zero, one)]
    values = calculator("RPC_Transfo").values([[1.0, 2.0, 3.0]] * 2, observations)
    assert np.isfinite(values).all(axis=1).tolist() == [False, True]


def test_any_degree_has_a_formula_and_other_names_none():
    assert find("Dist_Polyn2D_Degree_5_EqColin") == CorrectedSensor(5)
    for name in ("Dist_Polyn2D_Degree_05_EqColin", "Dist_Polyn2D_Degree_-1_EqDist", "Dist_Polyn2D_Degree_1"):
        assert find(name) is None
