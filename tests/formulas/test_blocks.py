"""The blocks: their conventions, and the names they give."""

from typing import Annotated

import numpy as np
import pytest

from obseq.errors import FormulaError
from obseq.formulas.base import Formula
from obseq.formulas.blocks import (
    WORLD_TO_LOCAL,
    Length,
    Matrix3,
    Point2,
    Point3,
    Pose,
    Rotation,
    Vector,
    matrix_names,
)


def random_rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def skew(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


@pytest.fixture
def turned():
    matrix, small = random_rotation(1), np.array([0.01, -0.02, 0.03])
    return Rotation(Matrix3.from_scalars(matrix.ravel()), Point3(*small)), matrix, small


def test_matrix_names_put_the_column_first():
    assert matrix_names("mi")[:4] == ("mi_0_0", "mi_1_0", "mi_2_0", "mi_0_1")


def test_a_rotation_is_its_matrix_times_identity_minus_skew(turned):
    rotation, matrix, small = turned
    expected = matrix @ (np.eye(3) - skew(small))
    vector = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(tuple(rotation @ Point3(*vector)), expected @ vector, rtol=1e-14)
    np.testing.assert_allclose(tuple(rotation.matrix()), expected.ravel(), rtol=1e-13)


def test_the_inverse_of_a_rotation_is_its_transpose(turned):
    rotation, matrix, small = turned
    expected = (np.eye(3) + skew(small)) @ matrix.T
    vector = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(tuple(rotation.inverse() @ Point3(*vector)), expected @ vector, rtol=1e-14)
    np.testing.assert_allclose(tuple(rotation.inverse().matrix()), expected.ravel(), rtol=1e-13)


def test_a_pose_times_its_inverse_is_the_identity():
    matrix = random_rotation(2)
    pose = Pose(Point3(1, 2, 3), Rotation(Matrix3.from_scalars(matrix.ravel()), Point3(0, 0, 0)))
    point = pose.inverse() @ (pose @ Point3(4.0, 5.0, 6.0))
    np.testing.assert_allclose(tuple(point), (4, 5, 6), rtol=1e-14)


def test_a_transposed_context_gives_the_same_rotation():
    stored = random_rotation(3)
    plain = Rotation.declare(("w", "m"), None).build((0, 0, 0), stored.ravel())
    transposed = Rotation.declare(("w", "m", WORLD_TO_LOCAL), None).build((0, 0, 0), stored.T.ravel())
    assert plain == transposed


def test_a_repeated_scalar_name_is_refused():
    class Twice(Formula):
        def residual(self, a: Annotated[Length, "same"], b: Annotated[Length, "same"]):
            return a - b

    with pytest.raises(FormulaError, match="Twice: the scalar name 'same' is declared twice"):
        Twice().expressions()


def test_an_argument_without_a_block_type_is_refused():
    class Bare(Formula):
        def residual(self, a: float):
            return a

    class Untyped(Formula):
        def residual(self, a):
            return a

    for formula in (Bare(), Untyped()):
        with pytest.raises(FormulaError, match=f"{formula.name}: the argument 'a' is not annotated"):
            _ = formula.unknowns


def test_what_takes_numbers_for_symbols_is_refused():
    class Rooted(Formula):
        def residual(self, a: Point2):
            return np.sqrt(a.x**2 + a.y**2)

    class Chosen(Formula):
        def residual(self, a: Point2):
            return a.x if a.y > 0 else -a.x

    for formula in (Rooted(), Chosen()):
        with pytest.raises(FormulaError, match=f"{formula.name}: .* functions of obseq.formulas.functions"):
            formula.expressions()


def test_a_vector_takes_its_names_from_the_formula():
    class Polynomial(Formula):
        coefficients = ("c0", "c1")

        def residual(self, c: Annotated[Vector, "coefficients"], *, x: Length):
            return c[0] + c[1] * x

    assert Polynomial().unknowns == ("c0", "c1")
    assert Polynomial().observations == ("x",)
    assert Polynomial().evaluate((1, 2), (3,)) == (7,)
