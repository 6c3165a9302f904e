"""Rotations against closed forms, 60-digit arithmetic and their own properties."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from obseq.geometry import (
    DegenerateGeometryError,
    absorb,
    closest_rotation,
    exponential,
    logarithm,
    rotation_x,
    rotation_y,
    rotation_z,
    skew,
)

EPS = np.finfo(float).eps
X, Y, Z = np.eye(3)

component = st.floats(-1.0, 1.0, allow_subnormal=False)
directions = (
    st.tuples(component, component, component)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)
magnitudes = st.one_of(
    st.floats(-300.0, 0.0).map(lambda e: 10.0**e),
    st.floats(0.0, np.pi),
    st.floats(-16.0, -1.0).map(lambda e: np.pi - 10.0**e),
)
rotation_vectors = st.builds(lambda direction, angle: direction * angle, directions, magnitudes)


def precise_exponential(w: np.ndarray) -> np.ndarray:
    """Rodrigues' formula with 60 digits."""
    with mpmath.workdps(60):
        x, y, z = (mpmath.mpf(float(value)) for value in w)
        cross = mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = mpmath.sqrt(x * x + y * y + z * z)
        first = mpmath.sin(angle) / angle if angle else mpmath.mpf(1)
        second = (1 - mpmath.cos(angle)) / angle**2 if angle else mpmath.mpf(1) / 2
        rotation = mpmath.eye(3) + first * cross + second * cross * cross
        return np.array([[float(rotation[i, j]) for j in range(3)] for i in range(3)])


def test_skew_is_the_cross_product() -> None:
    # (1, 2, 3) x (4, 5, 6) = (2*6 - 3*5, 3*4 - 1*6, 1*5 - 2*4) = (-3, 6, -3)
    assert skew([1.0, 2.0, 3.0]) @ [4.0, 5.0, 6.0] == pytest.approx([-3.0, 6.0, -3.0])


@pytest.mark.parametrize(
    ("turn", "axis", "start", "end"),
    [(rotation_x, X, Y, Z), (rotation_y, Y, Z, X), (rotation_z, Z, X, Y)],
)
def test_a_quarter_turn_is_right_handed(turn, axis, start, end) -> None:
    assert turn(np.pi / 2) @ start == pytest.approx(end, abs=EPS)
    assert exponential(axis * np.pi / 2) == pytest.approx(turn(np.pi / 2), abs=EPS)


def test_small_rotation_of_one_degree_about_z() -> None:
    # x goes to (cos 1 deg, sin 1 deg, 0)
    turned = exponential([0.0, 0.0, np.deg2rad(1.0)]) @ X
    assert turned == pytest.approx([0.9998476951563913, 0.01745240643728351, 0.0], abs=EPS)


@given(rotation_vectors)
def test_exponential_has_machine_precision(w) -> None:
    assert np.abs(exponential(w) - precise_exponential(w)).max() <= 8 * EPS


@given(rotation_vectors)
def test_exponential_is_a_rotation(w) -> None:
    rotation = exponential(w)
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() <= 16 * EPS
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=16 * EPS)


@given(directions, st.floats(-300.0, np.log10(3.0)))
def test_logarithm_gives_the_vector_back_relatively(direction, exponent) -> None:
    w = direction * 10.0**exponent
    error = np.linalg.norm(logarithm(exponential(w)) - w)
    assert error <= 1e-14 * np.linalg.norm(w) or np.linalg.norm(w) < 1e-290


@given(directions, st.floats(-17.0, -1.0))
def test_logarithm_near_half_a_turn(direction, exponent) -> None:
    w = direction * (np.pi - 10.0**exponent)
    found = logarithm(exponential(w))
    error = min(np.linalg.norm(found - w), np.linalg.norm(found + w) if 10.0**exponent < 1e-14 else np.inf)
    assert error <= 1e-14


@pytest.mark.parametrize("axis", [X, Y, Z])
def test_logarithm_of_exact_half_turns_and_identity(axis) -> None:
    half_turn = 2.0 * np.outer(axis, axis) - np.eye(3)
    assert np.abs(logarithm(half_turn)) == pytest.approx(np.pi * axis, abs=EPS)
    assert logarithm(np.eye(3)) == pytest.approx(np.zeros(3), abs=0.0)


def test_logarithm_takes_the_shorter_way() -> None:
    assert logarithm(rotation_z(1.5 * np.pi)) == pytest.approx([0.0, 0.0, -0.5 * np.pi])


def test_batches_equal_single_calls() -> None:
    vectors = np.random.default_rng(1).uniform(-2.0, 2.0, (50, 3))
    rotations = exponential(vectors)
    assert rotations.shape == (50, 3, 3)
    assert rotations == pytest.approx(np.array([exponential(w) for w in vectors]), abs=0.0)
    assert logarithm(rotations) == pytest.approx(np.array([logarithm(r) for r in rotations]), abs=0.0)
    assert logarithm(rotations).shape == (50, 3)
    assert rotation_y(vectors[:, 0]).shape == (50, 3, 3)
    noisy = rotations + 0.01
    assert closest_rotation(noisy) == pytest.approx(np.array([closest_rotation(m) for m in noisy]), abs=1e-15)


def test_absorb_follows_the_small_rotation_of_the_equations() -> None:
    """R0 (I - [w]x) to the first order, and local = (I + [w]x) R0^T (X - C) with it."""
    current, w = exponential([0.3, -0.8, 1.2]), np.array([2e-6, -1e-6, 3e-6])
    absorbed = absorb(current, w)
    assert absorbed == pytest.approx(current @ (np.eye(3) - skew(w)), abs=1e-11)
    assert np.abs(absorbed - current @ (np.eye(3) + skew(w))).max() > 1e-6
    arm = np.array([1.0, 2.0, 3.0])
    assert absorbed.T @ arm == pytest.approx((np.eye(3) + skew(w)) @ current.T @ arm, abs=1e-10)


@given(rotation_vectors, rotation_vectors)
def test_absorbing_a_rotation_and_its_opposite_changes_nothing(w, v) -> None:
    rotation = exponential(w)
    assert absorb(absorb(rotation, v), -v) == pytest.approx(rotation, abs=16 * EPS)


def test_closest_rotation_is_a_minimum() -> None:
    generator = np.random.default_rng(2)
    matrix = exponential([0.1, 2.0, -0.5]) @ np.diag([2.0, 1.0, 0.5]) + 0.1 * generator.standard_normal(
        (3, 3)
    )
    best = closest_rotation(matrix)
    distance = np.linalg.norm(matrix - best)
    for w in generator.uniform(-0.5, 0.5, (100, 3)):
        assert np.linalg.norm(matrix - absorb(best, w)) > distance


def test_closest_rotation_never_reflects() -> None:
    found = closest_rotation(np.diag([3.0, 2.0, -1.0]))
    assert found == pytest.approx(np.eye(3))


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), np.diag([2.0, 1.0, -1.0])])
def test_closest_rotation_refuses_what_does_not_determine_it(matrix) -> None:
    with pytest.raises(DegenerateGeometryError, match="equally close"):
        closest_rotation(matrix)
