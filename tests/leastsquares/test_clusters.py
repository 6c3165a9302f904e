"""Covariances across observations, against dense algebra."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csr_array

from obseq.errors import InputError
from obseq.leastsquares import Huber, LeastSquares, reliability, variance_components

N_POINTS = 5


@pytest.fixture(params=["dense", "sparse"])
def products(request, monkeypatch) -> None:
    """Rows of clusters multiplied as those of small systems are, and of large ones."""
    if request.param == "sparse":
        monkeypatch.setattr("obseq.leastsquares.assembly.clusters.FEW", 0)


def covariance_of(rng, n, scale=1e-2):
    """A covariance of n residuals, all of them correlated."""
    root = np.eye(n) + 0.3 * rng.normal(size=(n, n))
    return scale**2 * (root @ root.T)


def vectors(covariance, seed=2, **more):
    """Twelve vectors between five points in a known frame, in four clusters of three vectors."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.0, 100.0, (N_POINTS, 3))
    system = LeastSquares()
    ids = system.add_points(list("ABCDE"), true + rng.normal(0.0, 0.1, true.shape))
    frame = system.add_rotations(["frame"], np.eye(3)[None])
    system.freeze(frame)
    system.freeze(ids[:1])
    pairs = np.array([rng.permutation(N_POINTS)[:2] for _ in range(12)])
    measured = true[pairs[:, 1]] - true[pairs[:, 0]] + rng.normal(0.0, 0.01, (12, 3))
    blocks = {"frame": frame, "p1": ids[pairs[:, 0]], "p2": ids[pairs[:, 1]]}
    batch = system.add("TopoSubFrame", blocks, measured, covariance=covariance, **more)
    return system, ids, batch, pairs, measured


def clusters(seed=0):
    rng = np.random.default_rng(seed)
    return [covariance_of(rng, 9) for _ in range(4)]


def dense(system, pairs, measured, whole, active):
    """Solution, covariance and sum of squares by the textbook; the first point is known."""
    first = system.unknowns.values[:3]
    rows = np.zeros((36, 15))
    for k, (a, b) in enumerate(pairs):
        rows[3 * k : 3 * k + 3, 3 * b : 3 * b + 3] += np.eye(3)
        rows[3 * k : 3 * k + 3, 3 * a : 3 * a + 3] -= np.eye(3)
    kept = np.repeat(active, 3)
    right = (measured.ravel() - rows[:, :3] @ first)[kept]
    rows, weight = rows[kept, 3:], np.linalg.inv(whole[np.ix_(kept, kept)])
    inverse = np.linalg.inv(rows.T @ weight @ rows)
    solution = inverse @ rows.T @ weight @ right
    v = rows @ solution - right
    return solution.reshape(4, 3), inverse, float(v @ weight @ v), rows, weight, v


@pytest.mark.parametrize("form", ["list", "dense", "sparse"])
def test_the_solution_is_that_of_dense_algebra(form):
    given = clusters()
    whole = block_diag(given).toarray()
    covariance = {"list": given, "dense": whole, "sparse": csr_array(whole)}[form]
    system, ids, _, pairs, measured = vectors(covariance)
    result = system.solve(covariance=True)
    expected, inverse, cost, *_ = dense(system, pairs, measured, whole, np.ones(12, bool))
    np.testing.assert_allclose(result.values(ids[1:]), expected, atol=1e-9)
    found = result.covariance_between(ids[1:], ids[1:], a_priori=True)
    np.testing.assert_allclose(found, inverse, atol=1e-12)
    assert result.cost == pytest.approx(cost)
    assert result.redundancy == 36 - 12
    assert result.converged
    assert len(result.iterations) <= 3


@pytest.mark.usefixtures("products")
def test_the_numbers_of_each_observation():
    given = clusters()
    whole = block_diag(given).toarray()
    system, _, batch, pairs, measured = vectors(given)
    quality = reliability(system, system.solve(covariance=True)).of(batch)
    _, inverse, _, rows, weight, v = dense(system, pairs, measured, whole, np.ones(12, bool))
    residual = whole - rows @ inverse @ rows.T  # cofactors of residuals
    np.testing.assert_allclose(quality.redundancy.ravel(), np.diag(residual @ weight), atol=1e-8)
    w = (weight @ v) / np.sqrt(np.diag(weight @ residual @ weight))
    np.testing.assert_allclose(quality.w.ravel(), w, rtol=1e-6, atol=1e-8)
    assert quality.redundancy.sum() == pytest.approx(24.0)
    np.testing.assert_allclose(quality.sigmas.ravel(), np.sqrt(np.diag(whole)))


@pytest.mark.usefixtures("products")
def test_an_observation_left_out_leaves_the_marginal_covariance():
    given = clusters()
    system, ids, batch, pairs, measured = vectors(given)
    active = np.ones(12, bool)
    active[[1, 7]] = False
    batch.active = active
    whole = block_diag(given).toarray()
    expected, _, cost, *_ = dense(system, pairs, measured, whole, active)
    result = system.solve()
    np.testing.assert_allclose(result.values(ids[1:]), expected, atol=1e-9)
    assert result.cost == pytest.approx(cost)
    assert result.n_observations == 30


@pytest.mark.usefixtures("products")
def test_a_loss_gives_each_cluster_one_weight():
    system, ids, batch, *_ = vectors(clusters(), loss=Huber(1.0))
    rows = batch.observations.copy()
    width = rows.shape[1] - 3
    rows[:3, width:] += 0.5  # one cluster of three vectors is grossly wrong
    batch.observations = rows
    system.solve()
    weights = batch.robust_weights().reshape(4, 3)
    assert np.ptp(weights, axis=1).max() == 0.0
    assert weights[0, 0] < 0.5
    plain, same_ids, other, *_ = vectors(clusters())
    other.observations = rows
    other.sigmas = 1.0 / np.sqrt(weights.ravel())
    np.testing.assert_allclose(system.values(ids), plain.solve().values(same_ids), atol=1e-4)


def test_factors_scale_the_covariance():
    system, _, batch, *_ = vectors(clusters())
    before = system.solve().cost
    batch.sigmas = 2.0
    assert system.solve().cost == pytest.approx(before / 4.0)
    batch.sigmas = 1.0
    found = variance_components(system)
    assert found.factors[0] == pytest.approx(before / 24.0, rel=1e-3)


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.eye(35), "values have shape"),
        ([np.eye(9)] * 3, "clusters of 27 residuals; there are 36"),
        (csr_array(np.eye(35)), "is wanted, not"),
        (-np.eye(36), "not positive definite"),
        (np.eye(36) + np.triu(np.ones((36, 36)), 35), "not symmetric"),
        (np.full((36, 36), np.nan), "not finite"),
        ("text", "real numbers"),
    ],
)
def test_covariances_that_do_not_fit(covariance, message):
    with pytest.raises(InputError, match=message):
        vectors(covariance)


def test_what_does_not_go_together():
    with pytest.raises(InputError, match="either sigmas or covariances"):
        vectors(clusters(), sigmas=1.0)
    system, ids, *_ = vectors(clusters())
    with pytest.raises(InputError, match="steps of rows"):
        system.solve(strategy="qr")
    system.eliminate(ids[2:3])
    with pytest.raises(InputError, match=r"to be eliminated, .*eliminate\(ids, False\) takes them back"):
        system.solve()
