"""Linear equations of the engine are those of the adjustment, with covariances within one observation too."""

import numpy as np
import pytest

import obseq
from obseq.diagnosis.linear import linearised, with_priors


@pytest.mark.parametrize("is_correlated", [False, True])
def test_whitened_residuals_and_rows_are_those_that_the_solution_has_made_least(is_correlated: bool) -> None:
    rng = np.random.default_rng(4)
    system = obseq.LeastSquares()
    centre = system.add_points(["C"], [[0.0, 0.0, 0.0]])
    targets = system.add_points([f"P{k}" for k in range(4)], rng.normal(size=(4, 3)) * 5.0 + 20.0)
    frame = system.add_rotations(["S"], np.eye(3)[None])
    system.freeze(targets)
    system.freeze(frame)
    roots = rng.normal(size=(4, 3, 3))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.1 * np.eye(3)
    covariances = (covariances + covariances.transpose(0, 2, 1)) / 2.0
    batch = system.add(
        "TopoSubFrame",
        {"frame": frame, "p1": centre, "p2": targets},
        observations=system.values(targets) + rng.normal(size=(4, 3)),
        **({"covariances": covariances} if is_correlated else {"sigmas": 0.5}),
    )
    result = system.solve(covariance=True)
    linear = linearised(system, result, [batch])
    inverse = np.linalg.inv(covariances) if is_correlated else np.tile(4.0 * np.eye(3), (4, 1, 1))
    whitening = linear.whitening.toarray()
    expected = np.zeros((12, 12))
    for k in range(4):
        expected[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = inverse[k]
    np.testing.assert_allclose(whitening.T @ whitening, expected, atol=1e-9)
    assert linear.residuals @ linear.residuals == pytest.approx(result.cost)
    np.testing.assert_allclose(linear.rows.T @ linear.residuals, 0.0, atol=1e-6)
    taken = linear.rows @ linear.cofactors @ linear.rows.T
    np.testing.assert_allclose(np.trace(taken.toarray()), 3.0, atol=1e-9)


@pytest.fixture
def distances():
    """Of three unknown points from five known ones, of different sigmas; one of them is not used."""
    rng = np.random.default_rng(3)
    system = obseq.LeastSquares()
    known = system.add_points([f"K{k}" for k in range(5)], 100.0 * rng.normal(size=(5, 3)))
    points = system.add_points([f"P{k}" for k in range(3)], 100.0 * rng.normal(size=(3, 3)))
    system.freeze(known)
    ends = {"p1": np.tile(known, 3), "p2": np.repeat(points, 5)}
    lengths = np.linalg.norm(system.values(ends["p1"]) - system.values(ends["p2"]), axis=1)
    sigmas = np.linspace(0.5, 2.0, 15)[:, None]
    batch = system.add(
        "Dist3D", ends, observations=lengths + sigmas[:, 0] * rng.normal(size=15), sigmas=sigmas
    )
    batch.active = np.arange(15) != 7
    return system, points, batch


def test_plain_arrays_of_a_small_model_are_its_sparse_matrices(distances):
    system, _, batch = distances
    result = system.solve(covariance=True)
    sparse, dense = (linearised(system, result, [batch], dense=dense) for dense in (False, True))
    np.testing.assert_allclose(dense.residuals, sparse.residuals)
    for name in ("rows", "whitening", "taken", "cofactors"):
        np.testing.assert_allclose(
            getattr(dense, name), getattr(sparse, name).toarray(), atol=1e-12, err_msg=name
        )
    assert dense.residuals[7] == 0.0 and not dense.rows[7].any()
    assert dense.residuals @ dense.residuals == pytest.approx(result.cost)
    vector = np.linspace(-1.0, 1.0, 15)
    for linear in (sparse, dense):
        assert linear.left(vector) == pytest.approx(linear.left(np.column_stack([vector, vector]))[:, 1])
        assert np.abs(linear.back(linear.left(vector))).max() < 1e-9


def test_observed_unknowns_are_equations_as_all_others(distances):
    system, points, batch = distances
    given, sigmas = system.values(points) + 0.3, np.array([0.2, 0.4, np.inf])
    prior = system.add_prior(points, given, np.tile(sigmas, (3, 1)))
    result = system.solve(covariance=True)
    linear = with_priors(linearised(system, result, [batch]), system, result, system.priors)
    added = linear.residuals[15:].reshape(3, 2)
    np.testing.assert_allclose(added, (system.values(points) - given)[:, :2] / sigmas[:2], atol=1e-9)
    np.testing.assert_allclose(
        np.diag(linear.whitening.toarray())[15:].reshape(3, 2), np.tile(1 / sigmas[:2], (3, 1))
    )
    assert linear.residuals @ linear.residuals == pytest.approx(result.cost)
    rows = linear.rows.toarray()
    np.testing.assert_allclose(rows.T @ linear.residuals, 0.0, atol=1e-6)
    leverages = np.diag(rows @ np.linalg.inv(rows.T @ rows) @ rows.T)
    np.testing.assert_allclose(np.diag(linear.taken.toarray()), leverages, atol=1e-9)
    assert prior.n_scalars == 6 and with_priors(linear, system, result, ()) is linear


def test_without_unknowns_residuals_are_all_there_is(distances):
    system, points, batch = distances
    system.freeze(points)
    result = system.solve(covariance=True)
    linear = linearised(system, result, [batch])
    wanted = system.residuals(batch) / batch.sigmas
    np.testing.assert_allclose(linear.residuals[:7], wanted.ravel()[:7])
    np.testing.assert_allclose(linear.left(linear.residuals), linear.residuals)
    assert linear.rows.shape == (15, 0) and linear.n == 15
