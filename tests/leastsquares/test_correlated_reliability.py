"""Reliability of observations whose residuals are correlated, against dense algebra and refits."""

import numpy as np
import pytest

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.effects import effects_of_biases
from obseq.leastsquares.statistics.reliability import reliability
from obseq.leastsquares.statistics.snooping import snoop

CORNERS = np.array(
    [[0, 0, 0], [100, 0, 5], [100, 80, 0], [0, 80, 8], [50, 40, 30], [20, 60, 15], [70, 10, 12]], dtype=float
)


def correlated_vectors(bias=None):
    """Distances, and vectors with full covariances, between points in space; three points are held."""
    rng = np.random.default_rng(12)
    system = obseq.LeastSquares()
    points = system.add_points([f"P{k}" for k in range(len(CORNERS))], CORNERS)
    rotation = system.add_rotations(["S"], np.eye(3)[None])
    system.freeze(rotation)
    system.freeze(points[:2])
    i, j = np.triu_indices(len(CORNERS), 1)
    true = np.linalg.norm(CORNERS[i] - CORNERS[j], axis=1)
    system.add("Dist3D", {"p1": points[i], "p2": points[j]}, true + rng.normal(0, 1e-4, len(i)), 1e-4)
    factors = rng.normal(size=(6, 3, 3)) * 1e-4 + 2e-4 * np.eye(3)
    covariances = factors @ factors.transpose(0, 2, 1)
    covariances = (covariances + covariances.transpose(0, 2, 1)) / 2
    measured = CORNERS[1:] - CORNERS[0] + np.einsum("nij,nj->ni", factors, rng.normal(size=(6, 3)))
    if bias is not None:
        measured[bias[0], bias[1]] += bias[2]
    blocks = {"frame": rotation, "p1": points[:1], "p2": points[1:]}
    vectors = system.add("TopoSubFrame", blocks, measured, covariances=covariances)
    return system, points, vectors, covariances


def test_correlated_residuals_are_judged_as_they_were_observed():
    system, points, vectors, covariances = correlated_vectors(bias=(3, 1, 2e-3))
    result = system.solve(covariance=True, tolerance=1e-10)
    quality = reliability(system, result)
    part = quality.of(vectors)
    assert quality.sum_of_redundancy_numbers == pytest.approx(result.redundancy, abs=1e-8)
    np.testing.assert_allclose(part.sigmas, np.sqrt(np.diagonal(covariances, axis1=1, axis2=2)))
    for row in range(1, 6):  # the first vector joins two points that are held
        Q = result.covariance(points[row + 1 : row + 2], a_priori=True)[0]
        P, Qv = np.linalg.inv(covariances[row]), covariances[row] - Q
        v = result.residuals(vectors)[row]
        np.testing.assert_allclose(quality.residual_cofactors(vectors)[row], Qv, atol=1e-15)
        np.testing.assert_allclose(part.redundancy[row], np.diag(Qv @ P), atol=1e-7)
        np.testing.assert_allclose(part.w[row], P @ v / np.sqrt(np.diag(P @ Qv @ P)), rtol=1e-6)
        expected = quality.non_centrality / np.sqrt(np.diag(P @ Qv @ P))
        np.testing.assert_allclose(part.detectable[row], expected, rtol=1e-6)
    assert np.unravel_index(np.abs(part.w).argmax(), part.w.shape) == (3, 1)
    assert -part.left_out_residuals[3, 1] == pytest.approx(2e-3, rel=0.25)


def test_bias_and_leaving_out_of_correlated_residuals_equal_the_refits():
    system, points, vectors, _ = correlated_vectors()
    result = system.solve(covariance=True, tolerance=1e-10)
    quality = reliability(system, result)
    biased, others, *_ = correlated_vectors(bias=(4, 2, 1e-4))
    change = quality.change_of(points, quality.effect_of_bias(vectors, 4, 2, 1e-4))
    moved = biased.solve(tolerance=1e-10).values(others) - result.values(points)
    np.testing.assert_allclose(moved, change, atol=1e-3 * np.abs(change).max())
    left = quality.left_out(vectors, 3)
    vectors.set_active(3, False)
    refit = system.solve(tolerance=1e-10)
    np.testing.assert_allclose(refit.residuals(vectors)[3], left.residuals, rtol=2e-3)
    assert refit.cost == pytest.approx(left.cost, rel=1e-4)


def clustered_heights(bias=0.0, left_out=None):
    """Height differences of a mesh, correlated in threes; one of them with a bias, or left out."""
    system = obseq.LeastSquares()
    points = system.add_scalars([f"H{k}" for k in range(5)], np.zeros(5))
    system.freeze(points[:1])
    i, j = np.triu_indices(5, 1)
    i, j = i[:9], j[:9]
    errors = np.random.default_rng(5).normal(0.0, 0.002, 9)
    errors[4] += bias
    matrix = 1e-6 * np.array([[9.0, 2.0, 3.0], [2.0, 4.0, 1.0], [3.0, 1.0, 6.0]])
    one = np.ones((9, 1))
    batch = system.add_linear([points[i], points[j]], [-one, one], errors, 1.0)
    batch.correlate_all([matrix] * 3)
    if left_out is not None:
        batch.set_active(left_out, False)
    return system, batch, system.solve(covariance=True)


def test_leaving_out_one_of_a_cluster_equals_the_adjustment_without_it():
    system, batch, result = clustered_heights()
    quality = reliability(system, result)
    others, _, without = clustered_heights(left_out=4)
    left = quality.left_out(batch, 4)
    assert left.cost == pytest.approx(without.cost, rel=1e-9)
    moved = others.unknowns.values - system.unknowns.values
    np.testing.assert_allclose(left.change, moved, atol=1e-12)
    assert left.residuals[0] == pytest.approx(quality.of(batch).left_out_residuals[4, 0], rel=1e-9)
    biased, _, _ = clustered_heights(bias=0.01)
    moved = biased.unknowns.values - system.unknowns.values
    np.testing.assert_allclose(quality.effect_of_bias(batch, 4, bias=0.01), moved, atol=1e-12)
    shifts = effects_of_biases(quality, batch, range(5)).shifts[4]
    assert shifts[0] == pytest.approx(max(quality.effect_of_bias(batch, 4), key=abs), rel=1e-9)


def test_snooping_leaves_out_a_blunder_among_correlated_observations():
    system, batch, _ = clustered_heights(bias=0.04)
    found = snoop(system)
    assert [item.row for item in found.rejections] == [4]
    assert not batch.active[4]


def test_a_result_is_judged_after_others_with_more_frozen_and_not_with_more_equations():
    system, points, vectors, _ = correlated_vectors()
    result = system.solve(covariance=True)
    expected = reliability(system, result).of(vectors).redundancy
    frozen = system.unknowns.frozen.copy()
    system.freeze(points[4:])
    system.solve(covariance=True)
    with pytest.raises(InputError, match="frozen or freed"):
        reliability(system, result)
    system.unknowns.frozen[:] = frozen
    system.unknowns.restore(result.state)
    np.testing.assert_allclose(reliability(system, result).of(vectors).redundancy, expected)
    system.add("Dist3D", {"p1": points[3:4], "p2": points[5:6]}, [90.0], 1e-4)
    with pytest.raises(InputError, match="added"):
        reliability(system, result)
