import json
from pathlib import Path

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.images.epipolar import (
    Pinhole,
    epipolar_residuals,
    exponents,
    fit,
    fit_field,
    percentiles,
    robust_weights,
)

FILE = Path(__file__).resolve().parents[4] / "shared" / "data" / "epipolar" / "expected.json"


def cases():
    if not FILE.is_file():
        return []
    return [case for case in json.loads(FILE.read_text())["cases"] if case["kind"] == "epipolar_pair"]


def sensor(given):
    return Pinhole(
        np.array(given["center"]), np.array(given["rotation_rows"]), given["focal"], np.array(given["pp"])
    )


def pair(case):
    inputs = case["inputs"]
    points = np.array(inputs["tie_points_x1_y1_x2_y2"], dtype=float)
    return sensor(inputs["camera1"]), points[:, :2], sensor(inputs["camera2"]), points[:, 2:]


def test_the_data_are_there(shared_data):
    assert (shared_data / "epipolar").is_dir()
    assert len(cases()) == 8


@pytest.mark.parametrize("case", cases(), ids=lambda case: case["id"])
def test_residuals(case):
    expected, tolerances = case["expected"], case["tol"]
    first, p1, second, p2 = pair(case)
    found = epipolar_residuals(first, p1, second, p2)
    other = epipolar_residuals(second, p2, first, p1)
    for value, key in (
        (found.values, "ecart_image1"),
        (found.directions, "direction_image1"),
        (found.points, "pseudo_intersection"),
        (other.values, "ecart_image2_roles_swapped"),
    ):
        np.testing.assert_allclose(value, expected[key], rtol=0.0, atol=tolerances[key])


@pytest.mark.parametrize(
    "case", [c for c in cases() if "fits_intended" in c["expected"]], ids=lambda c: c["id"]
)
def test_field(case):
    expected, tolerances = case["expected"], case["tol"]
    first, p1, second, p2 = pair(case)
    values = epipolar_residuals(first, p1, second, p2).values
    fits = fit_field(p1, values)
    errors = [values, *(values - one.polynomial(p1) for one in fits)]
    for table, left in zip(expected["percentile_tables_intended"], errors, strict=False):
        np.testing.assert_allclose(
            percentiles(left), table["values_0_to_100_step_5"], rtol=0.0, atol=tolerances["percentiles"]
        )
    for one, wanted in zip(fits, expected["fits_intended"], strict=True):
        tolerance = {"rtol": 0.0, "atol": tolerances["fit"]}
        assert one.scale == pytest.approx(wanted["error_scale_75pc"], abs=1e-6)
        np.testing.assert_allclose(one.weights[:5], wanted["weights_first_5"], **tolerance)
        np.testing.assert_allclose(one.polynomial(p1)[:5], wanted["fit_values_first_5"], **tolerance)
        assert one.weights.sum() == pytest.approx(wanted["sum_weights"], abs=1e-4)
        assert one.cost == pytest.approx(wanted["weighted_sum_sq"], abs=1e-5)
        raw = dict(zip(exponents(one.polynomial.degree), one.polynomial.coefficients(), strict=True))
        for i, j, value in wanted.get("raw_coefficients_by_monomial_x_y", []):
            assert raw[i, j] == pytest.approx(value, abs=1e-9)


def normal_pair():
    turn = np.eye(3)
    principal = np.array([3000.0, 2000.0])
    return Pinhole(np.zeros(3), turn, 5000.0, principal), Pinhole(
        np.array([100.0, 0.0, 0.0]), turn, 5000.0, principal
    )


def test_the_closed_form_of_the_symmetric_normal_pair():
    first, second = normal_pair()
    a, delta = np.array([300.0, 20.0, 5.0]), np.array([2.0, -3.0, 40.0])
    p1 = np.column_stack([3000.0 + a, 2000.0 - delta / 2])
    p2 = np.column_stack([3000.0 - a, 2000.0 + delta / 2])
    q = a + delta**2 / (4 * a)
    expected = delta * q / np.sqrt((a + q) ** 2 + delta**2 / 4)
    np.testing.assert_allclose(epipolar_residuals(first, p1, second, p2).values, expected, atol=1e-9)


def test_the_sign_changes_with_the_side_of_the_second_camera():
    first, second = normal_pair()
    p1, p2 = np.array([[3200.0, 2000.0]]), np.array([[2900.0, 2003.0]])
    to_right = epipolar_residuals(first, p1, second, p2).values
    to_left = epipolar_residuals(second, p2, first, p1).values
    np.testing.assert_allclose([to_right[0], to_left[0]], [1.5, 1.5], atol=2e-3)


def test_where_there_is_no_point_there_is_no_residual():
    first, second = normal_pair()
    p1 = np.array([[3000.0, 2000.0], [2900.0, 2000.0]])
    p2 = np.array([[3000.0, 2000.0], [3100.0, 2000.0]])
    assert np.isnan(epipolar_residuals(first, p1, second, p2).values).all()


def test_arrays_that_do_not_match_are_refused():
    first, second = normal_pair()
    with pytest.raises(InputError, match="2 points in the first image, 1 in the second"):
        epipolar_residuals(first, np.ones((2, 2)), second, np.ones((1, 2)))
    with pytest.raises(InputError, match="second pixel of index 1 is not finite"):
        epipolar_residuals(first, np.ones((2, 2)), second, [[1.0, 1.0], [np.nan, 1.0]])


def test_a_rotation_that_is_none_is_refused():
    with pytest.raises(InputError, match="orthonormal"):
        Pinhole(np.zeros(3), np.diag([1.0, 1.0, 1.1]), 1000.0, np.zeros(2))


def test_monomials_are_in_the_order_of_the_seed():
    assert exponents(2) == [(0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0)]
    assert len(exponents(4)) == 15


def test_a_polynomial_is_recovered_in_large_pixels():
    pixels = np.random.default_rng(2).uniform(0, 6000, (300, 2))
    values = 2.0 - 3e-4 * pixels[:, 0] + 5e-8 * pixels[:, 0] * pixels[:, 1] + 1e-15 * pixels[:, 1] ** 4
    found = fit(pixels, values, np.ones(300), 4)
    raw = dict(zip(exponents(4), found.coefficients(), strict=True))
    np.testing.assert_allclose(found(pixels), values, atol=1e-11)
    assert raw[0, 4] == pytest.approx(1e-15, rel=1e-6)
    assert raw[1, 1] == pytest.approx(5e-8, rel=1e-6)


def test_weights_of_perfect_points_are_equal():
    weights, scale = robust_weights(np.zeros(10))
    assert scale == 0.0
    np.testing.assert_array_equal(weights, 1.0)


def test_percentiles_end_at_the_worst_point():
    values = percentiles(np.array([-5.0, 1.0, 2.0, 3.0]))
    assert (values[0], values[-1], len(values)) == (1.0, 5.0, 21)
    assert np.isnan(percentiles(np.zeros(0))).all()
