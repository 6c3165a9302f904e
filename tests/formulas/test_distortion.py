"""Distortion: its parameters, its equation on numbers that a person can follow, its basis."""

import numpy as np
import pytest

from obseq.formulas import find
from obseq.formulas.distortion import (
    FRASER,
    NOT_FRASER,
    Degree,
    Distortion,
    DistortionBasis,
)

HIGH_DEGREE = Degree(3, 1, 5)
EVERYTHING = (*FRASER, *NOT_FRASER, Degree(1, 3, 4), Degree(0, 2, 3), Degree(4, 0, 6, fraser=False))
POINT = (0.3, 0.4)
"""Its squared radius is 0.25."""


def distorted(degree: Degree, point: tuple[float, float] = POINT, **parameters: float) -> tuple[float, ...]:
    """The image of a point, the parameters that are not given being 0."""
    assert set(parameters) <= set(degree.parameters)
    return Distortion(degree).evaluate(point, [parameters.get(name, 0.0) for name in degree.parameters])


def test_parameters_are_enumerated_by_powers_of_y_and_not_by_degree() -> None:
    # Appendix A of the description of MMVII's formulas.
    assert Degree(5, 2, 2).parameters == tuple("K1 K2 K3 K4 K5 p1 p2 p3 p4 b1 y_2_0 b2 x_0_2".split())
    assert HIGH_DEGREE.parameters == tuple(
        "K1 K2 K3 p1 p2 b1 y_2_0 y_3_0 x_4_0 y_4_0 y_5_0 b2 x_2_1 y_2_1 x_3_1 y_3_1 x_4_1 y_4_1 x_0_2 x_1_2 "
        "y_1_2 x_2_2 y_2_2 x_3_2 y_3_2 x_0_3 y_0_3 x_1_3 y_1_3 x_2_3 y_2_3 x_0_4 y_0_4 x_1_4 y_1_4 x_0_5 "
        "y_0_5".split()
    )
    assert Degree(3, 1, 1, fraser=False).parameters == tuple("K1 K2 K3 p1 p2 a b".split())


@pytest.mark.parametrize("degree", EVERYTHING, ids=lambda degree: degree.name)
def test_no_term_says_what_others_say(degree: Degree) -> None:
    """The maps of the parameters, a change of focal length and a rotation are linearly independent."""
    points = np.random.default_rng(3).uniform(-1, 1, (200, 2))
    basis = np.array([DistortionBasis(degree).evaluate(point, []) for point in points.tolist()])
    x, y = points.T
    columns = [*np.vstack(np.hsplit(basis, 2)).T, np.hstack((x, y)), np.hstack((-y, x))]
    if degree.fraser or degree.polynomial == 0:
        assert np.linalg.matrix_rank(np.array(columns)) == len(columns)
    else:  # b x alone is a rotation and a shear: with the rotation, still independent of the others
        assert np.linalg.matrix_rank(np.array(columns)) >= len(columns) - 1


def test_without_parameters_nothing_moves() -> None:
    assert distorted(Degree(0, 0, 0)) == POINT
    assert distorted(HIGH_DEGREE) == pytest.approx(POINT, abs=0)
    assert DistortionBasis(Degree(0, 0, 0)).evaluate(POINT, []) == ()


def test_radial_terms_move_along_the_radius() -> None:
    # s = 0.25: the factor is 1 + 0.1 s = 1.025, or 1 + 0.1 s^2 = 1.00625.
    assert distorted(Degree(3, 1, 1), K1=0.1) == pytest.approx((0.3075, 0.41), rel=1e-15)
    assert distorted(Degree(3, 1, 1), K2=0.1) == pytest.approx((0.301875, 0.4025), rel=1e-15)


def test_decentric_terms() -> None:
    # 3 x^2 + y^2 = 0.43, 2 x y = 0.24, x^2 + 3 y^2 = 0.57.
    assert distorted(Degree(3, 1, 1), p1=0.1) == pytest.approx((0.3 + 0.043, 0.4 + 0.024), rel=1e-15)
    assert distorted(Degree(3, 1, 1), p2=0.1) == pytest.approx((0.3 + 0.024, 0.4 + 0.057), rel=1e-15)
    # Second order: s (s + 4 x^2) = 0.25 * 0.61, 4 x y s = 0.12, s (s + 4 y^2) = 0.25 * 0.89.
    assert distorted(Degree(5, 2, 2), p3=0.1) == pytest.approx((0.3 + 0.01525, 0.4 + 0.012), rel=1e-15)
    assert distorted(Degree(5, 2, 2), p4=0.1) == pytest.approx((0.3 + 0.012, 0.4 + 0.02225), rel=1e-15)


def test_terms_of_degree_one() -> None:
    assert distorted(Degree(0, 0, 1), b1=0.1, b2=0.2) == pytest.approx((0.3 + 0.03 + 0.08, 0.4), rel=1e-15)
    # The other description: b multiplies x in the second component.
    other = Degree(0, 0, 1, fraser=False)
    assert distorted(other, a=0.1, b=0.2) == pytest.approx((0.3 + 0.03, 0.4 + 0.06), rel=1e-15)


def test_general_terms_are_powers() -> None:
    # x^2 y^3 = 0.09 * 0.064.
    assert distorted(HIGH_DEGREE, x_2_3=1.0) == pytest.approx((0.3 + 0.00576, 0.4), rel=1e-15)
    assert distorted(HIGH_DEGREE, y_2_3=1.0) == pytest.approx((0.3, 0.4 + 0.00576), rel=1e-15)


@pytest.mark.parametrize("degree", EVERYTHING, ids=lambda degree: degree.name)
def test_distorted_point_is_the_point_plus_parameters_times_basis(degree: Degree) -> None:
    random = np.random.default_rng(5)
    point, parameters = random.uniform(-1, 1, 2), random.uniform(-1, 1, len(degree.parameters))
    basis = np.reshape(DistortionBasis(degree).evaluate(point, []), (2, -1))
    expected = point + basis @ parameters
    assert Distortion(degree).evaluate(point, parameters) == pytest.approx(tuple(expected), rel=1e-13)


def test_decentric_terms_are_derivatives_of_radial_ones() -> None:
    """A_n, B_n, C_n are the derivatives of (x, y) s^n with respect to the centre."""
    step = 1e-6
    moved = [DistortionBasis(Degree(2, 2, 0)).evaluate((0.3 + h, 0.4), []) for h in (-step, step)]
    k1_x, k2_x, p1_x, _, p3_x, _, k1_y, k2_y, p1_y, _, p3_y, _ = np.arange(12)
    low, high = map(np.array, moved)
    slope, here = (high - low) / (2 * step), np.array(DistortionBasis(Degree(2, 2, 0)).evaluate(POINT, []))
    np.testing.assert_allclose(slope[[k1_x, k2_x, k1_y, k2_y]], here[[p1_x, p3_x, p1_y, p3_y]], rtol=1e-9)


@pytest.mark.parametrize("name", ["Rad4_Dec2_XY3", "Rad0_Dec3_XY0", "Rad12_Dec0_XY1_D1aXbX"])
def test_any_degree_has_a_formula(name: str) -> None:
    formula = find(f"EqDist_Dist_{name}")
    assert formula is not None and formula.name == f"EqDist_Dist_{name}"
    assert formula.outputs == ("x", "y")


@pytest.mark.parametrize(
    "name", ["EqDist_Dist_Rad03_Dec1_XY1", "EqDist_Dist_Rad3_Dec1", "EqDist_Rad3_Dec1_XY1"]
)
def test_other_names_have_none(name: str) -> None:
    assert find(name) is None
