"""Rigid blocks, on poses that a person can follow."""

import numpy as np
import pytest

from obseq.formulas.rigid_blocks import BlocRigid, BlocRigid_RE, KnownRotation, RigidPair, VNormOrthog
from obseq.geometry import rotations
from obseq.kernels import calculator

IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)
QUARTER = (0, -1, 0, 1, 0, 0, 0, 0, 1)
"""A quarter turn about z, counter-clockwise: its x axis is the world's y."""
STILL = (0.0, 0.0, 0.0)


def test_relative_pose_of_two_cameras() -> None:
    # A at (1, 0, 0) turned by a quarter, B at (1, 5, 2) turned by a quarter: from A, B is 5 along x and 2 up,
    # not turned. Its place: 1 at the origin, 2 at (4, 0, 2), not turned either: 1 m is missing along x.
    unknowns = (1, 0, 0, *STILL, 1, 5, 2, *STILL, 0, 0, 0, *STILL, 4, 0, 2, *STILL)
    found = BlocRigid().evaluate(unknowns, (*QUARTER, *QUARTER, *IDENTITY, *IDENTITY))
    assert found == pytest.approx((1, 0, 0, *[0] * 9), abs=1e-15)


def test_relative_rotation_is_the_transpose_of_a_times_b() -> None:
    # A turned by a quarter, B not turned: from A, B is turned by minus a quarter, rows (0, 1, 0), (-1, 0, 0).
    unknowns = (*[0.0] * 24,)
    found = BlocRigid().evaluate(unknowns, (*QUARTER, *IDENTITY, *IDENTITY, *IDENTITY))
    assert found == pytest.approx((0, 0, 0, -1, 1, 0, -1, -1, 0, 0, 0, 0), abs=1e-15)


def test_a_small_rotation_of_a_turns_what_it_sees_counter_clockwise() -> None:
    # Local = (I + [w]x) R0^T X: with w_z = 1e-3, B, 5 m ahead along x, moves by +5e-3 along y.
    unknowns = (0, 0, 0, 0, 0, 1e-3, 5, 0, 0, *STILL, 0, 0, 0, *STILL, 5, 0, 0, *STILL)
    found = BlocRigid().evaluate(unknowns, (*IDENTITY * 4,))
    assert found[:3] == pytest.approx((0, 5e-3, 0), abs=1e-15)


def test_moving_the_whole_block_in_the_world_changes_nothing() -> None:
    random = np.random.default_rng(3)
    matrices = rotations.exponential(random.normal(size=(5, 3)))
    centres = random.normal(size=(4, 3)) * 10
    motion, shift = matrices[4], random.normal(size=3)

    def residuals(moved: bool) -> tuple[float, ...]:
        rotation = [motion @ m if moved and k < 2 else m for k, m in enumerate(matrices[:4])]
        centre = [motion @ c + shift if moved and k < 2 else c for k, c in enumerate(centres)]
        unknowns = [x for c in centre for x in (*c.tolist(), *STILL)]
        return BlocRigid().evaluate(unknowns, [x for m in rotation for x in m.ravel().tolist()])

    assert residuals(moved=True) == pytest.approx(residuals(moved=False), abs=1e-13)


def test_the_pose_attached_to_a_known_one() -> None:
    # 0.5 m too far along y, and turned by w_z = 0.01: R0 (I - [w]x) has +w_z at row 0, column 1.
    found = BlocRigid_RE().evaluate((1, 2.5, 3, 0, 0, 0.01), (*IDENTITY, 1, 2, 3, *IDENTITY))
    assert found == pytest.approx((0, 0.5, 0, 0, 0.01, 0, -0.01, 0, 0, 0, 0, 0), abs=1e-15)


def test_six_equations_of_a_pair() -> None:
    # A and the places are not turned, B is turned by a quarter about z: 2 sin(45 degrees) along z.
    # From A, B is 5 m along x; place 2 is 4 m from place 1: 1 m is missing.
    unknowns = (0, 0, 0, *STILL, 5, 0, 0, *STILL, 0, 0, 0, *STILL, 4, 0, 0, *STILL)
    found = RigidPair().evaluate(unknowns, (*IDENTITY, *QUARTER, *IDENTITY, *IDENTITY))
    assert found == pytest.approx((1, 0, 0, 0, 0, 2**0.5), abs=1e-15)


def test_the_turn_of_a_pair_has_the_sign_of_the_rotation_vector() -> None:
    # The small rotation of B is R0 (I - [w]x): w_z = 1e-3 turns B by -1e-3 about z.
    unknowns = [0.0] * 24
    unknowns[11] = 1e-3
    found = RigidPair().evaluate(tuple(unknowns), IDENTITY * 4)
    assert found == pytest.approx((0, 0, 0, 0, 0, -1e-3), abs=1e-9)


def test_a_rotation_attached_to_a_known_one() -> None:
    # Known: not turned; found: a quarter about z, 2 sin(45 degrees); and a sixth of a circle the other way.
    found = KnownRotation().evaluate(STILL, (*QUARTER, *IDENTITY))
    assert found == pytest.approx((0, 0, 2**0.5), abs=1e-15)
    sixth = rotations.exponential(np.array([np.pi / 3, 0.0, 0.0])).ravel().tolist()
    assert KnownRotation().evaluate(STILL, (*IDENTITY, *sixth)) == pytest.approx((-1, 0, 0), abs=1e-15)


def test_orthogonality_is_the_cosine() -> None:
    # N1 = x + 0.1 y, N2 = y + 0.2 x: the product is 0.2 + 0.1.
    first, second = (1, 0, 0, 0, 1, 0, 0, 0, 1), (0, 1, 0, 1, 0, 0, 0, 0, 1)
    assert VNormOrthog().evaluate((0.1, 0.0, 0.2, 0.0), (*first, *second)) == pytest.approx((0.3,))


def test_operations_of_a_rigid_block_stay_below_the_original() -> None:
    # MMVII's generator needs 588; sympy's cse of sympy's derivatives, jointly, 633.
    assert calculator("BlocRigid").kernel.module.OPERATIONS[1] <= 510
