"""Variance components against dense algebra and against simulations with known variances."""

import numpy as np
import pytest

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.variance_components import (
    Component,
    Method,
    group_components,
    variance_components,
)

N_POINTS = 7


SIGMAS = (0.01, 0.03)


def network(seed, true=(1.0, 1.0), repeats=1, prior_sigma=None, n_points=N_POINTS):
    """Plane points; differences of x and y (group "vectors") and of x alone ("levels") between all pairs."""
    system = obseq.LeastSquares()
    points = system.add_points([f"P{k}" for k in range(n_points)], np.zeros((n_points, 2)))
    i, j = (np.tile(index, repeats) for index in np.triu_indices(n_points, 1))
    for axis, sigma, group in (
        (0, SIGMAS[0], "vectors"),
        (1, SIGMAS[0], "vectors"),
        (0, SIGMAS[1], "levels"),
    ):
        rows = np.tile(np.eye(2)[axis], (len(i), 1))
        system.add_linear([points[i], points[j]], [-rows, rows], np.zeros(len(i)), sigma, group=group)
    if prior_sigma is None:
        system.freeze(points[:1])
    else:
        system.add_prior(points, np.zeros((n_points, 2)), 0.02, group="control")
    draw(system, seed, true, prior_sigma)
    return system, points


def draw(system, seed, true=(1.0, 1.0), prior_sigma=None):
    """Gives a network the places and the observations of a seed."""
    rng = np.random.default_rng(seed)
    points = np.arange(len(system.unknowns))
    places = rng.uniform(0, 100, (len(points), 2))
    system.set_values(points, places)
    i, j = system.batches[0].blocks
    noise = [SIGMAS[k] * np.sqrt(true[k]) * rng.normal(size=(2, len(i))) for k in range(2)]
    shift = (places[j] - places[i]).T
    for batch, values in zip(system.batches, [*(shift + noise[0]), shift[0] + noise[1][0]], strict=True):
        observe(batch, values)
    for prior in system.priors:
        prior.values = (places + rng.normal(0, prior_sigma, places.shape)).ravel()


def observe(batch, values):
    """Gives linear rows other right-hand sides."""
    batch.observations = np.column_stack([batch.observations[:, :-1], values])


def estimated(system, *parts, **options):
    """Variance components of a system, which keeps the sigmas that were given.

    A last round of one hundredth moves the mean of many by less than a thousandth of what it is uncertain by.
    """
    found = variance_components(system, *parts, tolerance=0.01, **options)
    found.restore()
    return found


def dense_equations(system, groups):
    """Traces of D_k R D_l R and sums v' D_k v by dense matrices, for groups of linear rows."""
    batches = system.equations().batches
    result = system.solve()
    A, v, group = [], [], []
    for batch in batches:
        rows = np.zeros((batch.n, system.unknowns.n_scalars))
        for ids, part in zip(batch.blocks, np.split(batch.observations[:, :-1], 2, axis=1), strict=True):
            for k in range(batch.n):
                start = system.unknowns.start[ids[k]]
                rows[k, start : start + 2] += part[k]
        A.append(rows[:, ~system.unknowns.frozen] / batch.sigmas)
        v.append(result.normalised_residuals(batch)[:, 0])
        group += [batch.group] * batch.n
    A, v, group = np.vstack(A), np.concatenate(v), np.array(group)
    R = np.eye(len(v)) - A @ np.linalg.solve(A.T @ A, A.T)
    D = [np.diag((group == name).astype(float)) for name in groups]
    return np.array([[np.trace(a @ R @ b @ R) for b in D] for a in D]), np.array([v @ d @ v for d in D])


def test_one_round_solves_helmerts_equations():
    system, _ = network(1, (4.0, 0.5))
    matrix, right = dense_equations(system, ("vectors", "levels"))
    found = variance_components(system, max_rounds=1)
    assert found.names == ("vectors", "levels")
    np.testing.assert_allclose(found.factors, np.linalg.solve(matrix, right), rtol=1e-8)
    assert not found.converged


def test_fixed_point_gives_every_group_a_variance_factor_of_one():
    system, _ = network(2, (4.0, 0.5))
    found = variance_components(system, tolerance=1e-8, solve_options={"tolerance": 1e-9})
    assert found.converged
    assert found.result.variance_factor == pytest.approx(1.0, abs=1e-6)
    squares = [found.result.squares[name] for name in found.names]
    np.testing.assert_allclose(squares, found.redundancy, rtol=1e-5)
    assert found.redundancy.sum() == pytest.approx(found.result.redundancy, rel=1e-9)
    matrix, _ = dense_equations(system, found.names)
    np.testing.assert_allclose(
        found.covariance, 2 * np.linalg.inv(matrix) * np.outer(found.factors, found.factors), rtol=1e-6
    )


def test_methods_meet_at_the_same_point():
    results = {}
    for method in Method:
        system, _ = network(5, (3.0, 0.3))
        results[method] = variance_components(system, method=method, tolerance=1e-7, max_rounds=200)
        assert results[method].converged
    for found in results.values():
        np.testing.assert_allclose(found.factors, results[Method.LS_VCE].factors, rtol=1e-4)
    with pytest.raises(InputError, match='use the method "ls-vce"'):
        _ = results[Method.REDUNDANCY].precisions
    assert np.isnan(results[Method.REDUNDANCY].columns()["precision"]).all()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["helmert", "redundancy"])
def test_estimates_are_unbiased_and_as_precise_as_stated(method):
    true, trials = np.array([4.0, 0.5]), 80
    system, _ = network(0, true, repeats=5)
    found = []
    for seed in range(trials):
        draw(system, seed, true)
        found.append(estimated(system, method=method))
    factors = np.array([estimate.factors for estimate in found])
    error = factors.std(axis=0) / np.sqrt(trials)
    assert (np.abs(factors.mean(axis=0) - true) < 3.5 * error).all(), factors.mean(axis=0)
    if method == "helmert":
        stated = np.mean([estimate.precisions for estimate in found], axis=0)
        np.testing.assert_allclose(factors.std(axis=0), stated, rtol=0.2)
    assert all(estimate.converged for estimate in found)


@pytest.mark.slow
def test_three_groups_priors_among_them():
    true, trials = np.array([4.0, 0.5, 2.25]), 70
    factors = []
    system, _ = network(0, true[:2], prior_sigma=0.03, n_points=15)
    for seed in range(trials):
        draw(system, seed, true[:2], prior_sigma=0.03)
        found = estimated(system)
        assert found.names == ("vectors", "levels", "control")
        factors.append(found.factors)
    error = np.std(factors, axis=0) / np.sqrt(trials)
    assert (np.abs(np.mean(factors, axis=0) - true) < 3.5 * error).all(), np.mean(factors, axis=0)


def distances(n=9, repeats=3):
    """Distances from one unknown station offset, each repeated; what a constant and a share explain."""
    lengths = np.tile(np.geomspace(50, 5000, n), repeats)
    system = obseq.LeastSquares()
    unknown = system.add_scalars([f"D{k}" for k in range(n)], lengths[:n])
    ids = np.tile(unknown, repeats)
    batch = system.add_linear([ids], [np.ones((len(ids), 1))], lengths, 0.005)
    parts = (
        Component("constant", ((batch, np.full((len(ids), 1), 1e-3**2)),)),
        Component("proportional", ((batch, np.square(1e-6 * lengths)[:, None]),)),
    )
    return system, parts, lengths


def measure(system, lengths, seed, constant, ppm):
    """Gives distances observations of variance constant^2 + (ppm D)^2."""
    spread = np.hypot(constant, ppm * lengths)
    observe(system.batches[0], lengths + spread * np.random.default_rng(seed).normal(size=len(lengths)))


@pytest.mark.slow
def test_additive_components_are_unbiased():
    trials, found = 80, []
    system, parts, lengths = distances(repeats=15)
    for seed in range(trials):
        measure(system, lengths, seed, constant=0.002, ppm=3e-6)
        found.append(estimated(system, parts).factors)
    error = np.std(found, axis=0) / np.sqrt(trials)
    assert (np.abs(np.mean(found, axis=0) - [4.0, 9.0]) < 3.5 * error).all(), np.mean(found, axis=0)


def test_a_component_that_is_not_there_is_held_and_named():
    system, parts, lengths = distances()
    for seed in range(20):
        measure(system, lengths, seed, constant=0.002, ppm=0.0)
        found = estimated(system, parts)
        assert (found.factors > 0).all()
        if found.negative:
            assert found.negative == ("proportional",)
            assert found.factors[1] <= 1e-7
            break
    else:
        pytest.fail("no seed gave a negative estimate")


def test_given_variances_explain_their_part_of_the_squares():
    system, _ = network(3, (4.0, 1.0))
    matrix, right = dense_equations(system, ("vectors", "levels"))
    found = variance_components(system, group_components(system, ["vectors"]), max_rounds=1)
    assert found.factors[0] == pytest.approx((right[0] - matrix[0, 1]) / matrix[0, 0], rel=1e-8)


def test_chosen_groups_leave_the_others_as_given():
    system, _ = network(3, (4.0, 1.0))
    found = variance_components(system, group_components(system, ["vectors"]))
    batches = {batch.group: batch for batch in system.equations().batches}
    assert found.names == ("vectors",)
    assert found.factors[0] == pytest.approx(4.0, rel=0.6)
    np.testing.assert_allclose(batches["vectors"].sigmas, 0.01 * np.sqrt(found.factors[0]))
    np.testing.assert_allclose(batches["levels"].sigmas, 0.03)
    found.restore()
    np.testing.assert_allclose(batches["vectors"].sigmas, 0.01)


def test_estimated_traces_come_close():
    exact = variance_components(network(4, (4.0, 0.5), repeats=3)[0])
    sampled = variance_components(network(4, (4.0, 0.5), repeats=3)[0], probes=200)
    np.testing.assert_allclose(sampled.factors, exact.factors, rtol=0.01)
    np.testing.assert_allclose(sampled.precisions, exact.precisions, rtol=0.05)


def test_inactive_observations_do_not_count():
    plain, _ = network(6, (4.0, 0.5))
    spoiled, points = network(6, (4.0, 0.5))
    one = np.array([[1.0, 0.0]] * 3)
    extra = spoiled.add_linear([points[:3], points[3:6]], [-one, one], [1e6] * 3, 0.01, group="vectors")

    for row in range(3):
        extra.set_active(row, False)
    np.testing.assert_allclose(
        variance_components(spoiled).factors, variance_components(plain).factors, rtol=1e-9
    )


def test_errors_name_the_components_and_restore_the_sigmas():
    system, _ = network(1)
    batch = system.equations().batches[0]
    same = Component("one", ((batch, np.square(batch.sigmas)),))
    twice = Component("two", ((batch, 2.0 * np.square(batch.sigmas)),))
    with pytest.raises(InputError, match="'one', 'two' cannot be told apart"):
        variance_components(system, [same, twice])
    np.testing.assert_allclose(batch.sigmas, 0.01)
    with pytest.raises(InputError, match="share observations"):
        variance_components(system, [same, twice], "helmert")
    with pytest.raises(InputError, match="expected"):
        variance_components(system, [Component("flat", ((batch, np.ones(3)),))])
    with pytest.raises(InputError, match="no group is called 'GNSS'"):
        group_components(system, ["GNSS"])
    lonely = system.add_points(["Q"], [[0.0, 0.0]])
    system.add_linear([lonely, lonely], [[[1.0, 0.0]], [[0.0, 1.0]]], [0.0], 1.0, group="one sight")
    system.freeze(lonely, ["y"])
    with pytest.raises(InputError, match="'one sight' has no redundancy"):
        variance_components(system)


def test_the_datum_changes_no_component():
    held, points = network(8, (4.0, 0.5))
    free, _ = network(8, (4.0, 0.5))
    free.unfreeze(points[:1])
    free.set_datum(points)
    expected, found = variance_components(held), variance_components(free)
    assert found.result.redundancy == expected.result.redundancy
    np.testing.assert_allclose(found.factors, expected.factors, rtol=1e-6)
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6)


def test_robust_batches_are_refused():
    from obseq.leastsquares.problem.losses import Huber

    system, _ = network(1)
    system.equations().batches[0].loss = Huber()
    with pytest.raises(InputError, match="it has a loss"):
        variance_components(system)
