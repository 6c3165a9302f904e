"""Correlated residuals: a full covariance per observation, against the general least-squares formula."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.assembly.clusters import whitening_of
from obseq.leastsquares.iterations.stacked_rows import stacked_rows
from obseq.leastsquares.statistics.reliability import reliability


def covariances(n, m=3, seed=0):
    roots = np.random.default_rng(seed).normal(size=(n, m, m))
    return 1e-4 * (roots @ roots.transpose(0, 2, 1) + 0.5 * np.eye(m))


def baselines(n=6, seed=1):
    """GNSS vectors between points, one of them known; the rotation of their frame is the identity."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(0, 1000, (n, 3))
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(n)], true + rng.normal(0, 1, true.shape))
    system.set_values(ids[:1], true[:1])
    system.freeze(ids[:1])
    frame = system.add_rotations(["frame"], np.eye(3)[None])
    system.freeze(frame)
    first, second = np.triu_indices(n, 1)
    given = covariances(len(first))
    noise = np.einsum("nij,nj->ni", np.linalg.cholesky(given), rng.normal(size=(len(first), 3)))
    observed = np.column_stack([true[second] - true[first] + noise])
    blocks = {"frame": frame, "p1": ids[first], "p2": ids[second]}
    batch = system.add("TopoSubFrame", blocks, observed, covariances=given)
    return system, ids, batch, (first, second, observed, given, true)


def direct_solution(first, second, observed, given, true):
    """(x, Q) of the free points by the textbook formula, with dense matrices."""
    n = len(true)
    design = np.zeros((3 * len(first), 3 * n))
    for row, (i, j) in enumerate(zip(first, second, strict=True)):
        design[3 * row : 3 * row + 3, 3 * i : 3 * i + 3] = -np.eye(3)
        design[3 * row : 3 * row + 3, 3 * j : 3 * j + 3] = np.eye(3)
    weight = np.zeros((len(design), len(design)))
    for row, matrix in enumerate(given):
        weight[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] = np.linalg.inv(matrix)
    right = observed.ravel() - design[:, :3] @ true[0]
    inverse = np.linalg.inv(design[:, 3:].T @ weight @ design[:, 3:])
    return inverse @ (design[:, 3:].T @ weight @ right), inverse


def test_solution_and_cofactors_are_those_of_the_general_formula():
    system, ids, _, data = baselines()
    result = system.solve(covariance="all")
    expected, inverse = direct_solution(*data)
    np.testing.assert_allclose(result.values(ids)[1:].ravel(), expected, atol=1e-8)
    blocks = inverse.reshape(5, 3, 5, 3)[np.arange(5), :, np.arange(5)]
    np.testing.assert_allclose(result.covariance(ids[1:], a_priori=True), blocks, rtol=1e-9, atol=1e-15)


def test_residuals_are_in_metres_and_normalised_ones_are_whitened():
    system, ids, batch, (first, second, observed, given, _) = baselines()
    result = system.solve()
    xyz = result.values(ids)
    raw = xyz[second] - xyz[first] - observed
    np.testing.assert_allclose(result.residuals(batch), raw, atol=1e-9)
    squares = np.einsum("ni,nij,nj->n", raw, np.linalg.inv(given), raw)
    np.testing.assert_allclose(np.sum(result.normalised_residuals(batch) ** 2, axis=1), squares, rtol=1e-6)
    assert result.cost == pytest.approx(squares.sum(), rel=1e-9)


def test_stacked_rows_and_reliability_see_whitened_equations():
    system, _, _, _ = baselines()
    result = system.solve(covariance="all")
    rows, linearisation = stacked_rows(system.equations()), system.equations().assemble()
    matrix = system.equations().pattern.matrix(linearisation.values).toarray()
    np.testing.assert_allclose((rows.jacobian.T @ rows.jacobian).toarray(), matrix, rtol=1e-10)
    (record,) = reliability(system, result).observations
    assert np.sum(record.redundancy) == pytest.approx(result.redundancy)


def test_a_diagonal_covariance_is_a_sigma():
    system, ids, batch, (first, second, observed, _, _) = baselines()
    batch.correlate(np.diag([1e-4, 4e-4, 9e-4]))
    one = system.solve().values(ids)
    system, ids, batch, _ = baselines()
    batch.active[:] = False
    batch.weights[:] = 0.0
    frame = system.ids(["frame"], "Rotation")
    blocks = {"frame": frame, "p1": ids[first], "p2": ids[second]}
    system.add("TopoSubFrame", blocks, observed, np.tile([0.01, 0.02, 0.03], (len(first), 1)))
    np.testing.assert_allclose(system.solve().values(ids), one, atol=1e-9)


def test_what_is_no_covariance_is_refused_by_name():
    system, _, batch, _ = baselines()
    with pytest.raises(InputError, match=r"TopoSubFrame .*P0 -> P1.*not symmetric and positive definite"):
        batch.correlate(np.diag([1.0, 1.0, 0.0]))
    with pytest.raises(InputError, match="expected"):
        batch.correlate(np.eye(2))
    with pytest.raises(InputError, match="either sigmas or covariances"):
        system.add("TopoSubFrame", {}, None)


def test_the_whitening_of_observations_is_that_of_their_covariances():
    system, _, batch, (*_, given, _) = baselines()
    whitening = whitening_of(batch).toarray().reshape(len(given), 3, len(given), 3)
    for k, covariance in enumerate(given):
        own = whitening[k, :, k]
        np.testing.assert_allclose(own.T @ own @ covariance, np.eye(3), atol=1e-9)
        whitening[k, :, k] = 0.0
    assert not whitening.any()
    result = system.solve()
    residuals = whitening_of(batch) @ result.residuals(batch).ravel()
    assert residuals @ residuals == pytest.approx(result.cost, rel=1e-9)
