"""Colinearity: images that a person can follow, the small rotation, singular places, any camera on demand."""

import math

import numpy as np
import pytest

from obseq.codegen import compile_formula
from obseq.formulas import find
from obseq.formulas.colinearity import (
    Colinearity,
    ColinearityOnBundle,
    ColinearityOnDirection,
    LineColinearity,
)
from obseq.formulas.distortion import Degree
from obseq.formulas.projections import PROJECTIONS, FE_EquiDist, Stenope
from obseq.kernels import Calculator, calculator

PLAIN = Colinearity(Stenope(), Degree(0, 0, 0))
IDENTITY = np.eye(3).ravel()
HALF_TURN = np.diag([-1.0, 1.0, -1.0])
"""A camera that looks along -z of the world, its y along y: its x is -x."""
CENTRE = (10.0, 20.0, 30.0)
INTERNAL = (1000.0, 500.0, 400.0)
STRAIGHT = (0.0, 0.0, 0.0)


def residual(formula, point, small=STRAIGHT, distortion=(), image=(0.0, 0.0), rotation=IDENTITY):
    """Of the camera at CENTRE whose world to camera matrix is given."""
    return formula.evaluate((*point, *CENTRE, *small, *INTERNAL, *distortion), (*image, *rotation))


def test_pinhole():
    # 3 m right, 4 m down, 10 m ahead: (0.3, 0.4), so 500 + 300 and 400 + 400 pixels.
    assert residual(PLAIN, (13, 24, 40)) == pytest.approx((800, 800), rel=1e-15)
    assert residual(PLAIN, (13, 24, 40), image=(790, 820)) == pytest.approx((10, -20), rel=1e-13)


def test_the_context_is_the_matrix_from_world_to_camera():
    # x of the camera is y of the world, y is z, z is x: the point is at (3, 4, 10) in the camera.
    cyclic = (0, 1, 0, 0, 0, 1, 1, 0, 0)
    assert residual(PLAIN, (20, 23, 34), rotation=cyclic) == pytest.approx((800, 800), rel=1e-15)
    assert residual(PLAIN, (7, 24, 20), rotation=HALF_TURN.ravel()) == pytest.approx((800, 800), rel=1e-15)


def test_small_rotation_turns_the_points_of_the_camera_frame():
    # (3, 4, 10) + (0, 0, 0.01) ^ (3, 4, 10) = (2.96, 4.03, 10).
    assert residual(PLAIN, (13, 24, 40), (0, 0, 0.01)) == pytest.approx((796, 803), rel=1e-15)
    # (3, 4, 10) + (0.01, 0, 0) ^ (3, 4, 10) = (3, 3.9, 10.04).
    x, y = residual(PLAIN, (13, 24, 40), (0.01, 0, 0))
    assert (x, y) == pytest.approx((500 + 3000 / 10.04, 400 + 3900 / 10.04), rel=1e-15)


def test_distortion_comes_before_the_focal_length():
    # Squared radius 0.25, K1 = 0.1: (0.3075, 0.41); then b1 = 0.1 adds 0.03 to x.
    formula = Colinearity(Stenope(), Degree(3, 1, 1))
    parameters = (0.1, 0, 0, 0, 0, 0.1, 0)
    assert residual(formula, (13, 24, 40), distortion=parameters) == pytest.approx((837.5, 810), rel=1e-15)


def test_fish_eye_distance_is_the_angle():
    # 45 degrees from the axis, to the right.
    formula = Colinearity(FE_EquiDist(), Degree(0, 0, 0))
    assert residual(formula, (15, 20, 35)) == pytest.approx((500 + 250 * math.pi, 400), rel=1e-15)


@pytest.mark.parametrize("degree", [Degree(3, 1, 1), Degree(2, 0, 0), Degree(5, 2, 2)], ids=lambda d: d.name)
def test_derivative_by_the_focal_length_is_the_distorted_point(degree):
    """MMVII's engine adds a spurious term to it in fourteen formulas."""
    formula = Colinearity(Stenope(), degree)
    calc = calculator(formula.name)
    distortion = 0.1 * np.cos(np.arange(len(degree.parameters)))
    unknowns = np.array([[13.0, 24.0, 40.0, *CENTRE, *STRAIGHT, *INTERNAL, *distortion]])
    _, jacobian = calc.values_and_jacobian(unknowns, [[0.0, 0.0, *IDENTITY]])
    distorted = calculator(f"EqDist_Dist_{degree.name}").values([[0.3, 0.4]], [distortion])
    np.testing.assert_allclose(jacobian[0, :, calc.unknowns.index("F_")], distorted[0], rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROJECTIONS)
def test_point_on_the_axis_has_the_derivatives_of_mathematics(exact, name):
    formula = Colinearity(PROJECTIONS[name], Degree(3, 1, 1))
    distortion = (0.1, -0.05, 0.02, 0.01, -0.02, 0.03, -0.01)
    unknowns = (10.0, 20.0, 35.0, *CENTRE, *STRAIGHT, *INTERNAL, *distortion)
    observations = (0.0, 0.0, *IDENTITY)
    kernel = calculator(formula.name) if name in ("Stenope", "FE_EquiDist") else compiled(formula)
    values, jacobian = kernel.values_and_jacobian([unknowns], [observations])
    expected, slopes = exact(formula, unknowns, observations)
    np.testing.assert_allclose(values[0], expected, rtol=1e-15)
    np.testing.assert_allclose(jacobian[0], slopes, rtol=1e-14, atol=1e-12)


def compiled(formula):
    return Calculator(compile_formula(formula))


@pytest.mark.parametrize("angle", [0.5, 1.6, 2.5, 3.14159])
def test_fish_eye_sees_behind(exact, angle):
    formula = Colinearity(FE_EquiDist(), Degree(3, 1, 1))
    point = np.array(CENTRE) + 5 * np.array([0.6 * math.sin(angle), 0.8 * math.sin(angle), math.cos(angle)])
    unknowns = (*point, *CENTRE, *STRAIGHT, *INTERNAL, 1e-3, 0, 0, 1e-4, 0, 1e-3, 0)
    observations = (0.0, 0.0, *IDENTITY)
    values, jacobian = calculator(formula.name).values_and_jacobian([unknowns], [observations])
    expected, slopes = exact(formula, unknowns, observations)
    np.testing.assert_allclose(values[0], expected, rtol=1e-14)
    error = np.abs(jacobian[0] - slopes) / np.abs(slopes).max(axis=1, keepdims=True)
    assert error.max() < 1e-13


def test_a_singular_point_spoils_its_row_only():
    calc = calculator(PLAIN.name)
    points = np.array([[13.0, 24.0, 40.0], [13.0, 24.0, 30.0], [14.0, 24.0, 40.0]])
    unknowns = np.array([[*point, *CENTRE, *STRAIGHT, *INTERNAL] for point in points])
    values = calc.values(unknowns, np.tile([0.0, 0.0, *IDENTITY], (3, 1)))
    assert np.isfinite(values).all(axis=1).tolist() == [True, False, True]


def line_residual(formula, ends, abscissa, normal, shift=(0, 0, 0, 0)):
    """Distance to the origin of the image; the line has the normals x and y of the world."""
    observations = (0, 0, *normal, *ends[0], *ends[1], 1, 0, 0, 0, 1, 0, abscissa, *IDENTITY)
    (value,) = formula.evaluate((*shift, *CENTRE, *STRAIGHT, *INTERNAL), observations)
    return value


def test_point_of_a_line():
    formula = LineColinearity(Stenope(), Degree(0, 0, 0))
    ends = ((12, 24, 40), (16, 24, 40))
    # A quarter of the way: (13, 24, 40), image (800, 800).
    assert line_residual(formula, ends, 0.25, (1, 0)) == pytest.approx(800, rel=1e-15)
    assert line_residual(formula, ends, 0.25, (0.6, -0.8)) == pytest.approx(-160, rel=1e-14)
    # The first end moved by (1, 2), three quarters of it: (13.75, 25.5, 40), image (875, 950).
    assert line_residual(formula, ends, 0.25, (1, 0), (1, 2, 0, 0)) == pytest.approx(875, rel=1e-15)
    assert line_residual(formula, ends, 0.25, (0, 1), (1, 2, 0, 0)) == pytest.approx(950, rel=1e-15)
    # The second end moved by (4, -4), a quarter of it: (14, 23, 40), image (900, 700).
    assert line_residual(formula, ends, 0.25, (0, 1), (0, 0, 4, -4)) == pytest.approx(700, rel=1e-15)


def test_line_colinearity_is_colinearity_along_the_normal():
    degree, random = Degree(5, 2, 2), np.random.default_rng(4)
    common = (*random.normal(size=3), *random.normal(size=3) / 9, 900.0, 10.0, 20.0)
    common = (*common, *random.normal(size=len(degree.parameters)) / 20)
    matrix, first, last = np.linalg.qr(random.normal(size=(3, 3)))[0], *random.normal(size=(2, 3))
    across, normal = np.array([0.1, 0.2, 0.3, 0.4]), np.array([0.6, -0.8])
    axes = random.normal(size=(2, 3))
    point = 0.7 * (first + across[:2] @ axes) + 0.3 * (last + across[2:] @ axes)
    pixel = Colinearity(Stenope(), degree).evaluate((*point, *common), (3.0, 4.0, *matrix.ravel()))
    observations = (3.0, 4.0, *normal, *first, *last, *axes.ravel(), 0.3, *matrix.ravel())
    (value,) = LineColinearity(Stenope(), degree).evaluate((*across, *common), observations)
    assert value == pytest.approx(normal @ pixel, rel=1e-12)


def test_dimensionless_pinhole():
    values = ColinearityOnDirection().evaluate((13, 24, 40, *CENTRE, *STRAIGHT), (0.1, 0.1, *IDENTITY))
    assert values == pytest.approx((0.2, 0.3), rel=1e-15)


def test_colinearity_on_a_ray():
    # The ray is z; the point at (3, 4, 12), 13 m away, is seen at 3/13 and 4/13 from it. u is of length 2.
    u, v = (2, 0, 0), (0, 1, 0)
    values = ColinearityOnBundle().evaluate((13, 24, 42, *CENTRE, *STRAIGHT), (*u, *v, 1000, *IDENTITY))
    assert values == pytest.approx((3000 / 13, 4000 / 13), rel=1e-15)
    on_ray = ColinearityOnBundle().evaluate((10, 20, 42, *CENTRE, *STRAIGHT), (*u, *v, 1000, *IDENTITY))
    assert on_ray == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "EqColinearityCamPPC_FE_EquiSolid_Dist_Rad4_Dec2_XY3",
        "EqColinearityCamPPC_StereroGraphik_Dist_Rad1_Dec0_XY2_D1aXbX",
        "EqLineProjCamPPC_EquiRect_Dist_Rad2_Dec1_XY1",
    ],
)
def test_cameras_that_mmvii_does_not_generate(exact, name):
    formula, random = find(name), np.random.default_rng(6)
    assert formula is not None and formula.name == name
    calc, n_distortion = compiled(formula), len(formula.degree.parameters)
    u = random.uniform(0.5, 1.0, len(formula.unknowns))
    u[-n_distortion:] *= 0.1
    o = random.uniform(-1.0, 1.0, len(formula.observations))
    values, jacobian = calc.values_and_jacobian([u], [o])
    expected, slopes = exact(formula, u, o)
    np.testing.assert_allclose(values[0], expected, rtol=1e-11)
    error = np.abs(jacobian[0] - slopes) / np.abs(slopes).max(axis=1, keepdims=True)
    assert error.max() < 1e-12


@pytest.mark.parametrize(
    "name",
    [
        "EqColinearityCamPPC_Nothing_Dist_Rad3_Dec1_XY1",
        "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1",
        "EqLine",
    ],
)
def test_other_names_have_none(name):
    assert find(name) is None
