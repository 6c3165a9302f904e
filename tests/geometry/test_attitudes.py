"""Rotations as quaternions and angles, there and back, and the derivatives of the angles."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.geometry import DegenerateGeometryError, absorb, attitude_jacobian, attitudes, rotations_from

RNG = np.random.default_rng(3)
ANGLES = RNG.uniform(-1.0, 1.0, (20, 3)) * [3.1, 1.4, 3.1]


@pytest.mark.parametrize("form", ["opk", "wpk", "ypr"])
def test_angles_come_back(form):
    np.testing.assert_allclose(attitudes(rotations_from(ANGLES, form), form), ANGLES, atol=1e-14)


def test_quaternions_come_back_whatever_their_length_and_sign():
    given = RNG.normal(size=(20, 4))
    found = attitudes(rotations_from(3.0 * given, "quaternion"), "quaternion")
    unit = given / np.linalg.norm(given, axis=1, keepdims=True)
    np.testing.assert_allclose(found, unit * np.sign(unit[:, :1]), atol=1e-14)


def test_a_quarter_turn_by_hand():
    # 90 degrees about z takes x to y: quaternion (cos 45, 0, 0, sin 45), yaw 90, kappa 90
    turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    half = np.sqrt(0.5)
    np.testing.assert_allclose(rotations_from([half, 0.0, 0.0, half], "quaternion"), turn, atol=1e-15)
    np.testing.assert_allclose(rotations_from([0.0, 0.0, np.pi / 2], "wpk"), turn, atol=1e-15)
    np.testing.assert_allclose(rotations_from([np.pi / 2, 0.0, 0.0], "ypr"), turn, atol=1e-15)


def test_photogrammetric_angles_of_a_vertical_image():
    # omega = phi = kappa = 0: the camera looks down, its columns go east and its lines south
    np.testing.assert_allclose(rotations_from([0.0, 0.0, 0.0], "opk"), np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize("form", ["opk", "wpk", "ypr"])
def test_the_jacobian_is_that_of_the_small_rotation(form):
    rotations = rotations_from(ANGLES, form)
    step = 1e-5
    columns = [
        (attitudes(absorb(rotations, step * axis), form) - attitudes(absorb(rotations, -step * axis), form))
        / (2 * step)
        for axis in np.eye(3)
    ]
    np.testing.assert_allclose(
        attitude_jacobian(rotations, form), np.stack(columns, axis=-1), atol=1e-8, rtol=1e-8
    )


def test_at_a_quarter_turn_of_the_second_angle_the_derivatives_are_not_finite():
    gimbal = rotations_from([0.3, np.pi / 2, 0.1], "wpk")
    assert np.abs(attitude_jacobian(gimbal, "wpk")).max() > 1e12


def test_a_matrix_that_is_no_rotation_is_refused():
    with pytest.raises(DegenerateGeometryError, match=r"by 0\.1"):
        rotations_from(np.diag([1.0, 1.0, 1.1]))
    with pytest.raises(DegenerateGeometryError, match="not finite"):
        rotations_from(np.full((3, 3), np.nan))
    with pytest.raises(DegenerateGeometryError, match="zero"):
        rotations_from(np.zeros(4), "quaternion")
    with pytest.raises(InputError, match="forms are matrix, quaternion, opk"):
        rotations_from(np.zeros(3), "pok")
