"""Elementary bundle adjustment: points on rays, two rays without a point."""

import math

import numpy as np
import pytest

from obseq.formulas.bundles import (
    BundleAngles,
    BundleDistance,
    Coplanarity,
    PointOnFirstBundle,
    PointOnOtherBundle,
    PointOnSecondBundle,
)
from obseq.kernels import calculator

IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
QUARTER_ABOUT_Z = (0, -1, 0, 1, 0, 0, 0, 0, 1)
"""Camera to frame: x of the camera is y of the frame."""
STRAIGHT = (0, 0, 0)
ALONG_X = (1, 0, 0, 0, 1, 0, 0, 0, 1)
"""A unit base along x, with its tangents along y and z."""


def test_point_on_a_ray_of_the_first_camera():
    # (1, 0, 1) ^ (3, 4, 5) = (-4, -2, 4), and their scalar product is 8.
    assert PointOnFirstBundle("Product").evaluate((3, 4, 5), (1, 0, 1)) == (-4, -2, 4)
    assert PointOnFirstBundle("Angle").evaluate((3, 4, 5), (1, 0, 1)) == (-0.5, -0.25, 0.5)
    assert PointOnFirstBundle("Angle").evaluate((2, 4, 6), (1, 2, 3)) == (0, 0, 0)


def test_angle_is_a_tangent():
    # 3 m to the right of a ray along z, 4 m ahead.
    assert PointOnFirstBundle("Angle").evaluate((3, 0, 4), (0, 0, 1)) == pytest.approx((0, 0.75, 0))


def test_point_on_a_ray_of_the_second_camera():
    # The camera is at (1, 0, 0), turned by a quarter: its ray (1, 0, 1) is (0, 1, 1); (3, 4, 5) is (2, 4, 5)
    # from it; (0, 1, 1) ^ (2, 4, 5) = (1, 2, -2), and their scalar product is 9.
    observations = (1, 0, 1, *ALONG_X, *QUARTER_ABOUT_Z)
    unknowns = (3, 4, 5, 0, 0, *STRAIGHT)
    assert PointOnSecondBundle("Product").evaluate(unknowns, observations) == (1, 2, -2)
    angle = PointOnSecondBundle("Angle").evaluate(unknowns, observations)
    assert angle == pytest.approx((1 / 9, 2 / 9, -2 / 9), rel=1e-15)
    # The base moved by 0.1 along y: (2, 3.9, 5) from the camera.
    moved = PointOnSecondBundle("Product").evaluate((3, 4, 5, 0.1, 0, *STRAIGHT), observations)
    assert moved == pytest.approx((1.1, 2, -2), rel=1e-14)


def test_point_on_a_ray_of_another_camera():
    observations = (1, 0, 1, *QUARTER_ABOUT_Z)
    unknowns = (3, 4, 5, 1, 0, 0, *STRAIGHT)
    assert PointOnOtherBundle("Product").evaluate(unknowns, observations) == (1, 2, -2)
    # Small rotation: (I - [w]x) (1, 0, 1) = (1, 0, 1) - (0, 0, 0.1) ^ (1, 0, 1) = (1, -0.1, 1), which turned
    # is (0.1, 1, 1); its product with (2, 4, 5) is (1, 1.5, -1.6).
    turned = PointOnOtherBundle("Product").evaluate((*unknowns[:6], 0, 0, 0.1), observations)
    assert turned == pytest.approx((1, 1.5, -1.6), rel=1e-14)


def test_second_and_other_cameras_agree():
    random = np.random.default_rng(1)
    rotation, frame = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    point, bundle, small = random.normal(size=(3, 3))
    du, dv = random.normal(size=2)
    base = frame[0] + du * frame[1] + dv * frame[2]
    second = PointOnSecondBundle("Angle").evaluate(
        (*point, du, dv, *small), (*bundle, *frame.ravel(), *rotation.ravel())
    )
    other = PointOnOtherBundle("Angle").evaluate((*point, *base, *small), (*bundle, *rotation.ravel()))
    assert second == pytest.approx(other, rel=1e-12)


def two_rays(formula, first, second, unknowns=(0, 0, 0, 0, 0), rotation=IDENTITY, frame=ALONG_X):
    return formula.evaluate(unknowns, (*first, *second, *frame, *rotation))


def test_determinant_of_the_base_and_the_rays():
    # (1, 0, 0) . ((0, 0, 1) ^ (0, 1, 1)) = (1, 0, 0) . (-1, 0, 0).
    assert two_rays(Coplanarity(), (0, 0, 1), (0, 1, 1)) == (-1,)
    # The same second ray, in a camera turned by a quarter.
    assert two_rays(Coplanarity(), (0, 0, 1), (1, 0, 1), rotation=QUARTER_ABOUT_Z) == (-1,)
    # Rays to the same point (3, 4, 5) are in one plane with the base.
    assert two_rays(Coplanarity(), (3, 4, 5), (2, 4, 5)) == (0,)


def test_linearised_determinant():
    """MMVII codes its linearisation apart: derivatives by the base and by the rotation, for w = 0."""
    random = np.random.default_rng(2)
    rotation, frame = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    first, second = random.normal(size=(2, 3))
    observations = [*first, *second, *frame.ravel(), *rotation.ravel()]
    values, jacobian = calculator("BunleElem_Det12").values_and_jacobian(np.zeros((1, 5)), [observations])
    normal = np.cross(first, rotation @ second)
    ray, base = rotation.T @ first, rotation.T @ frame[0]
    small = -((ray @ second) * base - (base @ second) * ray)
    np.testing.assert_allclose(values[0], [frame[0] @ normal], rtol=1e-13)
    expected = [frame[1] @ normal, frame[2] @ normal, *small]
    np.testing.assert_allclose(jacobian[0, 0], expected, rtol=1e-12, atol=1e-14)


def test_distance_of_two_rays():
    # The rays z from the origin, and (0, 1, 1) from (1, 0, 0), are 1 apart, along x.
    assert two_rays(BundleDistance(), (0, 0, 2), (0, 3, 3)) == pytest.approx((-1,), rel=1e-15)
    assert two_rays(BundleDistance(), (3, 4, 5), (2, 4, 5)) == (0,)


def test_distance_of_two_rays_seen_from_each_camera():
    # Rays at 45 degrees in the planes y = 0 and y = 0.1, from both ends of a base that is nearly along x.
    half = math.sqrt(0.5)
    away = (math.sqrt(0.99), 0.1, 0, *ALONG_X[3:])
    first, second = (half, 0, half), (-half, 0, half)
    a, b = two_rays(BundleAngles(), first, second, frame=away)
    # n = u1 ^ u2 = (0, -1, 0): c = -0.1; a = sqrt(0.99) sqrt(1/2), and b = -a.
    expected = -0.1 / (math.sqrt(0.99) * half)
    assert (a, b) == pytest.approx((expected, -expected), rel=1e-14)


def test_angles_solve_the_triangle():
    """B = a u1 + b u2 + c n/|n|, solved as a linear system."""
    random = np.random.default_rng(3)
    rotation, frame = (np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2))
    first, second = (v / np.linalg.norm(v) for v in random.normal(size=(2, 3)))
    turned = rotation @ second
    normal = np.cross(first, turned)
    columns = np.column_stack((first, turned, normal / np.linalg.norm(normal)))
    a, b, c = np.linalg.solve(columns, frame[0])
    angles = two_rays(BundleAngles(), first, second, rotation=rotation.ravel(), frame=frame.ravel())
    assert angles == pytest.approx((c / a, c / b), rel=1e-12)
    (distance,) = two_rays(BundleDistance(), first, second, rotation=rotation.ravel(), frame=frame.ravel())
    assert distance == pytest.approx(c, rel=1e-12)


@pytest.mark.parametrize("name", ["BunleElem_Dist12", "BunleElem_Ang12"])
def test_parallel_rays_spoil_their_row_only(name):
    rows = [[0, 0, 1, *ray, *ALONG_X, *IDENTITY] for ray in ((0, 0, 1), (0.6, 0, 0.8))]
    values = calculator(name).values(np.zeros((2, 5)), np.array(rows, dtype=float))
    assert np.isfinite(values).all(axis=1).tolist() == [False, True]
