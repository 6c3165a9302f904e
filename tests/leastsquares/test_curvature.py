"""The curvature of residuals, learnt from gradients: its equation, its solutions, and what it saves."""

from typing import Annotated

import numpy as np
import pytest

import obseq
from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number, Vector
from obseq.formulas.functions import Scalar
from obseq.leastsquares.iterations.curvature import COMPONENTS, curvature_of


class Brown(Formula):
    """Brown and Dennis (1971): four unknowns, residuals of hundreds at the minimum."""

    def residual(
        self, b: Annotated[Vector, "b1", "b2", "b3", "b4"], *, e: Number, s: Number, c: Number, t: Number
    ) -> Scalar:
        """Sum of two squares."""
        return (b[0] + t * b[1] - e) ** 2 + (b[2] + b[3] * s - c) ** 2


@pytest.fixture(scope="module")
def brown():
    return compile_formula(Brown())


def system_of(kernel, start):
    t = np.arange(1, 21) / 5.0
    system = obseq.LeastSquares()
    unknown = system.add_vectors(["b"], [start])
    data = np.column_stack([np.exp(t), np.sin(t), np.cos(t), t])
    system.add(kernel, {"b": np.repeat(unknown, len(t))}, data, 1.0)
    return system, unknown


START = np.array([25.0, 5.0, -5.0, -1.0])
NEXT = np.array([22.0, 6.0, -3.0, -0.5])
LAST = np.array([20.0, 7.0, -2.0, -1.0])


def learnt(kernel, places):
    system, unknown = system_of(kernel, places[0])
    curvature = curvature_of(system.equations())
    for place in places:
        system.set_values(unknown, [place])
        linearisation = system.equations().assemble()
        curvature.learn(system.equations(), linearisation, linearisation.diagonal)
    return curvature


def test_the_change_of_the_gradient_is_that_of_both_parts_of_the_curvature(brown):
    last, place = START, NEXT
    curvature = learnt(brown, [last, place])
    system, unknown = system_of(brown, last)
    before = system.equations().assemble()
    normal = system.equations().pattern.matrix(before.values) @ (place - last)
    gradient = before.gradient.copy()
    system.set_values(unknown, [place])
    change = system.equations().assemble().gradient - gradient
    np.testing.assert_allclose(curvature.times(place - last), change - normal, rtol=1e-9)


def test_solutions_are_those_of_the_sum_of_both_matrices(brown):
    curvature = learnt(brown, [START, NEXT, LAST])
    added = np.column_stack([curvature.times(axis) for axis in np.eye(4)])
    np.testing.assert_allclose(added, added.T, rtol=1e-8, atol=1e-8 * np.abs(added).max())
    matrix, right = np.diag(10.0 * np.abs(added).sum(axis=0)), np.array([1.0, -2.0, 3.0, 0.5])
    bent = curvature.correcting(lambda v: np.linalg.solve(matrix, v))
    np.testing.assert_allclose((matrix + added) @ bent(right), right, rtol=1e-10)


def test_a_sum_without_minimum_is_refused(brown):
    curvature = learnt(brown, [START, NEXT])
    added = np.column_stack([curvature.times(axis) for axis in np.eye(4)])
    lowest = np.linalg.eigvalsh(added)[0]
    assert lowest < 0.0
    for factor, is_definite in ((0.9, False), (1.1, True)):
        solved = curvature.correcting(lambda v, shift=-factor * lowest: v / shift)
        assert (solved is not None) == is_definite


def test_no_more_components_are_kept_than_stated():
    rng = np.random.default_rng(0)
    system = obseq.LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(8)], rng.uniform(0, 100, (8, 3)))
    start, end = np.triu_indices(8, 1)
    system.add("Dist3D", {"p1": ids[start], "p2": ids[end]}, rng.uniform(20, 100, len(start)), 1.0)
    curvature = curvature_of(system.equations())
    for _ in range(COMPONENTS + 2):
        system.set_values(ids, rng.uniform(0, 100, (8, 3)))
        linearisation = system.equations().assemble()
        curvature.learn(system.equations(), linearisation, linearisation.diagonal)
    added = np.column_stack([curvature.times(axis) for axis in np.eye(24)])
    assert 0 < np.linalg.matrix_rank(added) <= COMPONENTS


@pytest.mark.parametrize("strategy", ["levenberg-marquardt", "dogleg"])
@pytest.mark.parametrize("far", [1.0, 10.0])
def test_large_residuals_take_tens_of_evaluations_instead_of_hundreds(brown, strategy, far):
    system, _ = system_of(brown, far * START)
    result = system.solve(max_iterations=500, strategy=strategy)
    assert result.converged
    assert result.cost == pytest.approx(85822.2016, rel=1e-8)
    assert result.evaluations < 100


def test_rotations_losses_and_eliminated_unknowns_keep_to_gauss_newton():
    system = obseq.LeastSquares()
    ids = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    batch = system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [1.0], 1.0)
    assert curvature_of(system.equations()) is not None
    batch.loss = obseq.leastsquares.Huber(1.5)
    assert curvature_of(system.equations()) is None
