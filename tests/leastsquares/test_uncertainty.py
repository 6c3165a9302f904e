"""Precisions are unbiased: every combination of a finite set of errors is solved (the original's 384 cases).

Seven linear observations of five unknowns. The error of each takes one of 2, 3 or 4 equally likely values,
with mean 0 and variance 1. Over all combinations, the mean solution is the truth, the mean of the estimated
covariance is the covariance of the solutions, and the mean variance factor is the true one.
"""

import itertools

import numpy as np
import pytest

from obseq.leastsquares import LeastSquares, reliability

LEVELS = (2, 3, 2, 2, 4, 2, 2)
SIGMA = 0.3


def errors_of(count):
    """Equally likely values with mean 0 and variance 1."""
    values = np.arange(count) - (count - 1) / 2
    return values / np.sqrt(np.mean(values**2))


def linear_system(seed, held):
    """The system, its block of unknowns, its batch, and the truth; `held` components are frozen at it."""
    rng = np.random.default_rng(seed)
    rows, truth = rng.normal(size=(len(LEVELS), 5)), rng.normal(size=5)
    system = LeastSquares()
    ids = system.add_vectors(["x"], [np.where(np.isin(np.arange(5), held), truth, 0.0)])
    if held:
        system.freeze(ids, held)
    batch = system.add_linear([np.repeat(ids, len(rows))], [rows], rows @ truth, SIGMA)
    return system, ids, batch, rows, truth


@pytest.mark.slow
@pytest.mark.parametrize("held", [(), (1,), (0, 3)])
def test_all_combinations_of_errors(held):
    system, ids, batch, rows, truth = linear_system(seed=4, held=held)
    exact = np.column_stack([rows, rows @ truth])
    solutions, covariances, factors = [], [], []
    for combination in itertools.product(*map(errors_of, LEVELS)):
        batch.observations = exact + _error_column(combination)
        result = system.solve(covariance="all")
        solutions.append(result.values(ids)[0])
        covariances.append(result.covariance(ids)[0])
        factors.append(result.variance_factor)
    assert len(solutions) == 384
    solutions = np.array(solutions)
    np.testing.assert_allclose(solutions.mean(axis=0), truth, atol=1e-12)
    spread = solutions - solutions.mean(axis=0)
    np.testing.assert_allclose(np.mean(covariances, axis=0), spread.T @ spread / 384, atol=1e-11)
    assert np.mean(factors) == pytest.approx(1.0, rel=1e-11)


def _error_column(combination):
    """(7, 6) what is added to coefficients and values: errors on the values only."""
    added = np.zeros((len(combination), 6))
    added[:, 5] = SIGMA * np.array(combination)
    return added


@pytest.mark.parametrize("solver", ["auto", "dense", "supernodal", "superlu"])
@pytest.mark.parametrize("is_held", [False, True])
def test_precisions_are_zero_where_everything_is_frozen(solver, is_held):
    system = LeastSquares(solver)
    ids = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    batch = system.add("Dist3D", {"p1": ids[:1], "p2": ids[1:]}, [10.01], 0.01)
    if is_held:
        system.constrain_linear([ids[:1]], [[[1.0, 0.0, 0.0]]], [0.0])
    system.freeze(ids)
    result = system.solve(covariance="all")
    assert not result.precisions(ids).any()
    assert not result.covariance_between(ids[:1], ids[1:]).any()
    assert not np.any(result.unknowns()["precision"])
    quality = reliability(system, result)
    assert quality.sum_of_redundancy_numbers == pytest.approx(result.redundancy) == 1
    assert quality.of(batch).w[0, 0] == pytest.approx(-1.0)
