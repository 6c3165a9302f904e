"""Damped, dogleg, orthogonal, iterative and L1 iterations: the same minimum, and never uphill."""

from itertools import pairwise

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.iterations.strategies import Dogleg, GaussNewton, LevenbergMarquardt


def network(offset=0.3, seed=0, n=8):
    """Distances in space between points, three of them softly known."""
    rng = np.random.default_rng(seed)
    system = LeastSquares()
    true = rng.uniform(0, 100, (n, 3))
    ids = system.add_points([f"P{k}" for k in range(n)], true + rng.normal(0, offset, true.shape))
    start, end = np.triu_indices(n, 1)
    lengths = np.linalg.norm(true[end] - true[start], axis=1) + rng.normal(0, 0.01, len(start))
    system.add("Dist3D", {"p1": ids[start], "p2": ids[end]}, lengths, 0.01)
    system.add_prior(ids[:3], true[:3], 0.01)
    return system, ids


@pytest.mark.parametrize("strategy", ["levenberg-marquardt", "dogleg", "qr", "lsmr"])
def test_every_strategy_finds_the_minimum_of_gauss_newton(strategy):
    system, ids = network()
    expected = system.solve().values(ids)
    system, ids = network()
    result = system.solve(strategy=strategy, max_iterations=50)
    assert result.converged
    np.testing.assert_allclose(result.values(ids), expected, atol=2e-6)


@pytest.mark.parametrize(
    "strategy", [LevenbergMarquardt(), LevenbergMarquardt(damping=10.0), Dogleg(), Dogleg(5.0)]
)
def test_the_cost_never_rises_from_a_far_start(strategy):
    system, _ = network(offset=40.0, seed=3)
    result = system.solve(strategy=strategy, max_iterations=200)
    costs = [step.cost for step in result.iterations] + [result.cost]
    assert all(after <= before * (1 + 1e-12) for before, after in pairwise(costs))
    assert result.converged


def test_gauss_newton_goes_uphill_where_damping_does_not():
    system, _ = network(offset=40.0, seed=3)
    result = system.solve(max_iterations=30)
    costs = [step.cost for step in result.iterations]
    assert any(after > before for before, after in pairwise(costs))


def test_damping_makes_a_free_network_solvable():
    # Without any datum the normal matrix is singular; damping takes the shortest way.
    rng = np.random.default_rng(1)
    true = rng.uniform(0, 100, (6, 3))
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(6)], true + rng.normal(0, 0.5, true.shape))
    start, end = np.triu_indices(6, 1)
    lengths = np.linalg.norm(true[end] - true[start], axis=1)
    system.add("Dist3D", {"p1": ids[start], "p2": ids[end]}, lengths, 0.01)
    result = system.solve(strategy="levenberg-marquardt", max_iterations=50)
    assert result.cost < 1e-10


def test_constant_damping_is_that_of_mmvii():
    # One unknown pulled from 0 to 10: the damped step covers 1 / (1 + 0.1) of the way (MMVII, LVM = 0.1).
    system = LeastSquares()
    ids = system.add_scalars(["x"], [0.0])
    system.add_prior(ids, [[10.0]], 1.0)
    result = system.solve(strategy=LevenbergMarquardt(0.1, constant=True), max_iterations=1)
    assert result.values(ids)[0, 0] == pytest.approx(10.0 / 1.1, rel=1e-12)


def test_l1_iterations_ignore_a_blunder():
    system, ids = network()
    true = system.solve().values(ids)
    system, ids = network()
    batch = system.add("Dist3D", {"p1": ids[3], "p2": ids[4]}, [1.0], 0.01)
    assert len(batch) == 1
    robust = system.solve(strategy="l1", max_iterations=10).values(ids)
    assert np.abs(robust - true).max() < 0.1
    system, ids = network()
    system.add("Dist3D", {"p1": ids[3], "p2": ids[4]}, [1.0], 0.01)
    assert np.abs(system.solve().values(ids) - true).max() > 0.5


def test_dogleg_starts_at_the_solution_of_a_linear_system():
    system = LeastSquares()
    ids = system.add_scalars(["x"], [4.0])
    system.add_prior(ids, [[4.0]], 1.0)
    result = system.solve(strategy="dogleg")
    assert result.converged
    assert result.values(ids)[0, 0] == 4.0


def test_least_absolute_residuals_have_no_least_squares_covariance():
    system, _ = network()
    with pytest.raises(InputError, match="covariances of an L1 solution"):
        system.solve(strategy="l1", covariance="all")


def test_names_and_parameters_are_checked():
    system, _ = network()
    with pytest.raises(InputError, match="unknown strategy 'newton'; known: gauss-newton"):
        system.solve(strategy="newton")
    with pytest.raises(InputError, match="positive"):
        LevenbergMarquardt(0.0)
    with pytest.raises(InputError, match="unknown step"):
        GaussNewton("svd")


def test_viscosity_slows_and_biases_nothing():
    system, ids = network()
    expected = system.solve(covariance="all")
    system, ids = network()
    system.add_viscosity(ids, 0.02)
    slow = system.solve(max_iterations=400, covariance="all", tolerance=1e-9)
    assert slow.converged
    assert len(slow.iterations) > len(expected.iterations)
    assert slow.redundancy == expected.redundancy
    np.testing.assert_allclose(slow.values(ids), expected.values(ids), atol=1e-6)
    np.testing.assert_allclose(slow.covariance(ids), expected.covariance(ids), rtol=1e-4, atol=1e-12)


def test_viscosity_halves_the_step_that_it_weighs_as_much_as_the_observation():
    system = LeastSquares()
    ids = system.add_scalars(["x"], [0.0])
    system.add_prior(ids, [[10.0]], 1.0)
    system.add_viscosity(ids, 1.0)
    assert system.solve(max_iterations=1).values(ids)[0, 0] == pytest.approx(5.0)


@pytest.mark.parametrize("strategy", ["gauss-newton", "controlled", "levenberg-marquardt", "dogleg"])
def test_without_iterations_the_covariance_is_that_where_one_stands(strategy):
    system, ids = network()
    before = system.values(ids)
    result = system.solve(max_iterations=0, covariance=True, strategy=strategy)
    assert not result.converged
    np.testing.assert_array_equal(result.values(ids), before)
    assert (np.diagonal(result.covariance(ids, a_priori=True), axis1=1, axis2=2) > 0.0).all()
