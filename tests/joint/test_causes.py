"""An open adjustment as the engine of the diagnosis sees it: columns, and adjustments without errors."""

import numpy as np
import pytest

import obseq
from obseq.diagnosis.protocol import Change
from obseq.joint.causes import JointModel
from obseq.leastsquares.problem.losses import Huber

SIGMAS = np.linspace(0.5, 2.0, 15)[:, None]


def system_of(wrong=0.0, loss=None):
    """Distances of three points that are known themselves from five fixed ones; one distance is off."""
    rng = np.random.default_rng(3)
    system = obseq.LeastSquares()
    fixed = system.add_points([f"K{k}" for k in range(5)], 100.0 * rng.normal(size=(5, 3)))
    places = 100.0 * rng.normal(size=(3, 3))
    points = system.add_points([f"P{k}" for k in range(3)], places)
    system.freeze(fixed)
    ends = {"p1": np.tile(fixed, 3), "p2": np.repeat(points, 5)}
    lengths = np.linalg.norm(system.values(ends["p1"]) - system.values(ends["p2"]), axis=1)
    lengths += SIGMAS[:, 0] * rng.normal(size=15)
    lengths[7] += wrong
    batch = system.add(
        "Dist3D", ends, observations=lengths, sigmas=SIGMAS, **({"loss": loss} if loss else {})
    )
    prior = system.add_prior(points, places + 0.3, np.tile([2.0, 4.0, np.inf], (3, 1)))
    return system, batch, prior, points


def model_of(system, converged=True):
    start = system.unknowns.state()
    result = system.solve(20 if converged else 1, covariance=True)
    return JointModel(system, result, start, ())


def numbered(model, source, row):
    (index,) = [k for k, one in enumerate(model.observations) if one.source is source and one.row == row]
    return index


def test_each_observation_and_each_known_value_may_be_wrong():
    system, batch, _, _ = system_of()
    batch.active = np.arange(15) != 4
    model = model_of(system)
    assert len(model.hypotheses) == 14 + 6
    with model.borrowed():
        linear, columns = model.linearised(model.solution(), ())
    assert linear.n == 21
    for index, one in enumerate(model.observations):
        own = columns.effect(model.hypotheses.of(index), np.ones(one.width))
        place = one.first
        sigma = SIGMAS[one.row, 0] if one.source is batch else (2.0, 4.0)[one.row % 2]
        assert np.flatnonzero(own).tolist() == [place] and own[place] == pytest.approx(-1.0 / sigma)
        assert place == (one.row if one.source is batch else 15 + one.row)


@pytest.mark.parametrize(("of_prior", "row"), [(False, 7), (False, 0), (True, 0), (True, 3)])
def test_without_an_observation_it_is_adjusted_as_if_that_had_never_been(of_prior, row):
    system, batch, prior, points = system_of(wrong=9.0)
    model = model_of(system)
    index = numbered(model, prior if of_prior else batch, row)
    with model.borrowed():
        place, converged, iterations = model.adjusted(
            model.solution(), [Change(index, np.ones(1), np.ones(1))]
        )
        system.unknowns.restore(place.state)
        found = system.values(points)
    assert converged and iterations > 0
    other, batch, prior, points = system_of(wrong=9.0)
    if of_prior:
        sigmas = prior.sigmas.copy()
        sigmas[row] = 1e9
        prior.sigmas = sigmas
    else:
        batch.active = np.arange(15) != row
    other.solve()
    np.testing.assert_allclose(found, other.values(points), atol=1e-4)
    assert np.abs(found - system.values(points)).max() > 1e-3


def test_all_is_as_it_was_when_it_is_given_back():
    system, batch, prior, points = system_of(wrong=9.0, loss=Huber(2.0))
    model = model_of(system)
    active, sigmas, loss, values = batch.active.copy(), prior.sigmas.copy(), batch.loss, system.values(points)
    with pytest.raises(ZeroDivisionError), model.borrowed():
        assert batch.loss is None
        model.adjusted(model.robust(), [Change(0, np.ones(1), np.ones(1))])
        raise ZeroDivisionError
    assert np.array_equal(batch.active, active) and np.array_equal(prior.sigmas, sigmas)
    assert batch.loss is loss and np.array_equal(system.values(points), values)


def test_a_robust_start_leads_near_the_truth_with_a_large_error_in_it():
    right, _, _, points = system_of()
    right.solve()
    system, _, _, _ = system_of(wrong=500.0)
    model = model_of(system)
    with model.borrowed():
        system.unknowns.restore(model.robust().state)
        assert np.abs(system.values(points) - right.values(points)).max() < 2.0
        system.unknowns.restore(model.solution().state)
        assert np.abs(system.values(points) - right.values(points)).max() > 20.0


def test_a_robust_start_takes_errors_off_first():
    system, batch, _, points = system_of(wrong=500.0)
    model = model_of(system)
    other, others, _, _ = system_of()
    others.active = np.arange(15) != 7
    plain = model_of(other)
    with model.borrowed(), plain.borrowed():
        without = Change(numbered(model, batch, 7), np.ones(1), np.ones(1))
        system.unknowns.restore(model.robust([without]).state)
        other.unknowns.restore(plain.robust().state)
        np.testing.assert_allclose(system.values(points), other.values(points), atol=1e-2)


def test_where_iterations_did_not_converge_there_is_no_solution():
    system, _, _, _ = system_of(wrong=500.0)
    model = model_of(system, converged=False)
    with model.borrowed():
        assert model.solution() is None


def test_of_robust_weights_the_solution_is_that_of_least_squares():
    right, _, _, points = system_of(wrong=40.0)
    right.solve()
    system, _, _, _ = system_of(wrong=40.0, loss=Huber(2.0))
    model = model_of(system)
    assert np.abs(system.values(points) - right.values(points)).max() > 0.1
    with model.borrowed():
        system.unknowns.restore(model.solution().state)
        np.testing.assert_allclose(system.values(points), right.values(points), atol=1e-3)
