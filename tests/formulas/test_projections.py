"""Projections: points that a person can follow, inverses, and the places where others give no number."""

import math

import numpy as np
import pytest

from obseq.formulas import find
from obseq.formulas.projections import PROJECTIONS, Direct, Inverse
from obseq.kernels import calculator

RADIAL = [name for name in PROJECTIONS if name != "EquiRect"]
FISH_EYES = ["FE_EquiDist", "StereroGraphik", "FE_EquiSolid"]
NOTHING = np.zeros((1, 0))

DISTANCES = {
    "Stenope": math.tan,
    "FE_EquiDist": lambda t: t,
    "StereroGraphik": lambda t: 2 * math.tan(t / 2),
    "OrthoGraphik": math.sin,
    "FE_EquiSolid": lambda t: 2 * math.sin(t / 2),
}
"""Distance to the centre of the image, from the angle to the axis."""


def direct(name, point):
    return np.array(Direct(PROJECTIONS[name]).evaluate(point, []), dtype=float)


def inverse(name, image):
    return np.array(Inverse(PROJECTIONS[name]).evaluate(image, []), dtype=float)


@pytest.mark.parametrize("name", RADIAL)
@pytest.mark.parametrize("angle", [0.01, 1.0, 1.5])
def test_distance_to_the_centre_depends_on_the_angle_to_the_axis(name, angle):
    # A point 7 m away at that angle, in the direction (3, 4)/5 of the image.
    r, z = 7 * math.sin(angle), 7 * math.cos(angle)
    expected = DISTANCES[name](angle) * np.array([0.6, 0.8])
    np.testing.assert_allclose(direct(name, (0.6 * r, 0.8 * r, z)), expected, rtol=2e-15)


def test_equirectangular_is_longitude_and_latitude():
    # 30 degrees to the right, 45 degrees along Y.
    point = (math.sin(math.pi / 6), 1.0, math.cos(math.pi / 6))
    np.testing.assert_allclose(direct("EquiRect", point), [math.pi / 6, math.pi / 4], rtol=2e-15)
    back = inverse("EquiRect", (math.pi / 6, math.pi / 4))
    np.testing.assert_allclose(back, np.array(point) / math.sqrt(2), rtol=2e-15)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_inverse_of_an_image_is_the_direction(name):
    for point in np.random.default_rng(2).normal(size=(50, 3)):
        if name in ("Stenope", "OrthoGraphik"):
            point[2] = abs(point[2]) + 0.1
        image = direct(name, point)
        back = inverse(name, image)
        np.testing.assert_allclose(back / np.linalg.norm(back), point / np.linalg.norm(point), atol=2e-14)
        np.testing.assert_allclose(direct(name, 3.0 * back), image, rtol=1e-12, atol=1e-14)
        if name != "Stenope":
            assert np.linalg.norm(back) == pytest.approx(1.0, rel=1e-15, abs=4e-16)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_the_axis_goes_to_the_centre_with_exact_derivatives(name):
    calc = calculator(f"Dir_{name}")
    values, jacobian = calc.values_and_jacobian([[0.0, 0.0, 4.0]], NOTHING)
    np.testing.assert_array_equal(values, [[0.0, 0.0]])
    np.testing.assert_allclose(jacobian, [[[0.25, 0.0, 0.0], [0.0, 0.25, 0.0]]], atol=1e-16)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_the_centre_goes_to_the_axis_with_exact_derivatives(name):
    values, jacobian = calculator(f"Inv_{name}").values_and_jacobian([[0.0, 0.0]], NOTHING)
    np.testing.assert_array_equal(values, [[0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(jacobian, [[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]])


def _check(exact, formula, points, tolerance):
    calc = calculator(formula.name)
    values, jacobian = calc.values_and_jacobian(points, np.zeros((len(points), 0)))
    for k, point in enumerate(points):
        expected, slopes = exact(formula, point, [])
        np.testing.assert_allclose(values[k], expected, rtol=tolerance, atol=1e-300, err_msg=str(point))
        error = np.abs(jacobian[k] - slopes) / np.abs(slopes).max(axis=1, keepdims=True)
        assert error.max() <= tolerance, (formula.name, point)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_values_and_derivatives_near_the_axis(exact, name):
    points = np.array([[r, 0.7 * r, z] for r in (1e-12, 1e-8, 1e-4, 1e-2, 0.3) for z in (1.0, 5.0)])
    _check(exact, Direct(PROJECTIONS[name]), points, 4e-15)


@pytest.mark.parametrize("name", PROJECTIONS)
def test_derivatives_of_the_inverse_near_the_centre(exact, name):
    images = np.array([[r, -0.7 * r] for r in (1e-12, 1e-8, 1e-4, 1e-2, 0.3)])
    calc = calculator(f"Inv_{name}")
    _, jacobian = calc.values_and_jacobian(images, np.zeros((len(images), 0)))
    for k, image in enumerate(images):
        _, slopes = exact(Inverse(PROJECTIONS[name]), image, [])
        np.testing.assert_allclose(jacobian[k], slopes, rtol=1e-14, atol=4e-16)


@pytest.mark.parametrize("name", FISH_EYES)
def test_backward_cone_is_exact(exact, name):
    """MMVII takes -(X, Y)/|Z| for the equidistant fish-eye there."""
    points = np.array([[r, 0.7 * r, -1.0] for r in (1e-9, 1e-6, 1e-4, 1e-3, 0.1, 3.0)])
    _check(exact, Direct(PROJECTIONS[name]), points, 2e-14)


@pytest.mark.parametrize("name", FISH_EYES)
def test_only_the_pole_itself_is_not_finite(name):
    points = [[1e-9, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 1e-9, -1.0]]
    values, jacobian = calculator(f"Dir_{name}").values_and_jacobian(points, np.zeros((3, 0)))
    assert np.isfinite(values).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(jacobian).all(axis=(1, 2)).tolist() == [True, False, True]


def test_limits_of_the_inverses():
    for name, limit in (("OrthoGraphik", 1.0), ("FE_EquiSolid", 2.0)):
        calc = calculator(f"Inv_{name}")
        values = calc.values([[limit, 0.0], [1.01 * limit, 0.0]], np.zeros((2, 0)))
        assert np.isfinite(values[0]).all()
        assert np.isnan(values[1]).any()
    # Rays at a right angle and backwards.
    np.testing.assert_allclose(inverse("OrthoGraphik", (0.6, 0.8)), [0.6, 0.8, 0.0], atol=2e-8)
    np.testing.assert_allclose(inverse("FE_EquiSolid", (1.2, 1.6)), [0.0, 0.0, -1.0], atol=1e-7)


def test_equirectangular_latitude_keeps_its_digits_near_the_pole(exact):
    _check(exact, Direct(PROJECTIONS["EquiRect"]), np.array([[1e-7, 1.0, 2e-7]]), 2e-15)


@pytest.mark.parametrize("name", ["Dir_", "Dir_Nothing", "Stenope", "Direct_Stenope", "Inv_FE"])
def test_other_names_have_none(name):
    assert find(name) is None
