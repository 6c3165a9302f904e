"""Linear equations of the engine are those of the adjustment, with covariances within one observation too."""

import numpy as np
import pytest

import obseq
from obseq.diagnosis.linear import linearised


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
