"""A result is what was found at its time, whatever its system is changed to later."""

import pickle

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares import Huber, LeastSquares, reliability, variance_components

KNOWN = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 5.0], [0.0, 100.0, 0.0], [90.0, 90.0, 20.0]])
LENGTHS = np.array([61.648, 87.662, 58.306, 71.277])


def solved(**options):
    """A point from four distances and a prior, solved."""
    system = LeastSquares()
    base = system.add_points(list("ABCD"), KNOWN)
    point = system.add_points(["P"], [[50.0, 50.0, 30.0]])
    system.freeze(base)
    options = options or {"sigmas": 0.005}
    batch = system.add("Dist3D", {"p1": base, "p2": point}, LENGTHS, **options)
    prior = system.add_prior(point, [[30.0, 52.0, 14.0]], 0.1)
    return system, batch, prior, system.solve(covariance="all")


def told(result, batch, prior):
    return (
        result.summary(),
        result.to_json(),
        result.normalised_residuals(batch).tolist(),
        result.prior_residuals(prior).tolist(),
        {name: list(column) for name, column in result.observations().items()},
    )


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"sigmas": 0.005, "loss": Huber(0.3)},
        {"covariances": [[2.5e-5]]},
        {"covariance": 2.5e-5 * (np.eye(4) + 0.5)},
    ],
    ids=["sigmas", "loss", "covariances", "clusters"],
)
def test_what_is_changed_later_leaves_no_mark(options):
    system, batch, prior, result = solved(**options)
    before = told(result, batch, prior)
    batch.sigmas[:] = 0.5
    batch.active[0] = False
    batch.loss = None
    batch.observations = batch.observations + 1.0
    prior.values, prior.sigmas = [31.0, 53.0, 15.0], 0.3
    assert told(result, batch, prior) == before
    system.solve()
    assert told(result, batch, prior) == before
    copy, same_batch, same_prior = pickle.loads(pickle.dumps((result, batch, prior)))
    assert told(copy, same_batch, same_prior) == before


def test_the_solution_before_variance_components_is_that_before():
    system, batch, *_ = solved()
    batch.observations = LENGTHS + np.array([0.03, -0.02, 0.04, 0.0])
    before = system.solve()
    summary = before.summary()
    variance_components(system)
    assert batch.sigmas[0, 0] != pytest.approx(0.005, rel=0.01)  # they have changed the sigmas
    assert before.summary() == summary


def test_nothing_is_kept_twice_as_long_as_nothing_changes():
    system, batch, _, first = solved()
    second = system.solve()
    assert first.weighing(batch).sigmas is second.weighing(batch).sigmas
    assert not np.shares_memory(first.weighing(batch).sigmas, batch.sigmas)


def test_statistics_are_those_of_their_time():
    system, batch, _, result = solved()
    quality = reliability(system, result)
    part = quality.of(batch)
    columns = {name: np.array(column) for name, column in part.columns().items()}
    left_out = quality.left_out(batch, 1).cost
    batch.sigmas[:] = 0.5
    for name, column in part.columns().items():
        assert np.array_equal(column, columns[name]), name
    assert quality.left_out(batch, 1).cost == left_out


def test_statistics_of_other_sigmas_are_refused_even_where_all_fits():
    """Residuals of zero have the same sum of squares whatever the sigmas."""
    system = LeastSquares()
    (x,) = system.add_scalars(["x"], [1.0])
    batch = system.add_linear([[x, x]], [[[1.0], [1.0]]], [1.0, 1.0], 0.1)
    result = system.solve(covariance="all")
    batch.sigmas[0] = 0.2
    with pytest.raises(InputError, match="sigmas have changed since this result"):
        reliability(system, result)


def test_a_prior_of_another_system_has_no_residuals_here():
    *_, result = solved()
    _, _, other, _ = solved()
    with pytest.raises(InputError, match="this prior prior was not part of the solved system"):
        result.prior_residuals(other)
