"""Steps from stacked rows against those of the normal equations, and the L1 norm on its own terms."""

import numpy as np
import pytest

from obseq.leastsquares import LeastSquares
from obseq.leastsquares.iterations.stacked_rows import StackedRows, l1_step, lsmr_step, qr_step, stacked_rows


def network(n=8, seed=0, prior=0.5):
    """Distances in space between points, two of them held by priors and one by freezing."""
    rng = np.random.default_rng(seed)
    system = LeastSquares()
    true = rng.uniform(0, 100, (n, 3))
    ids = system.add_points([f"P{k}" for k in range(n)], true + rng.normal(0, 0.3, true.shape))
    system.set_values(ids[:1], true[:1])
    system.freeze(ids[:1])
    start, end = np.triu_indices(n, 1)
    lengths = np.linalg.norm(true[end] - true[start], axis=1) + rng.normal(0, 0.01, len(start))
    system.add("Dist3D", {"p1": ids[start], "p2": ids[end]}, lengths, np.linspace(0.01, 0.03, len(start)))
    system.add_prior(ids[1:3], true[1:3], prior)
    return system


def normal_step(system):
    equations = system.equations()
    rows = stacked_rows(equations)
    linearisation = equations.assemble()
    matrix = equations.pattern.matrix(linearisation.values)
    np.testing.assert_allclose(
        (rows.jacobian.T @ rows.jacobian).toarray(), matrix.toarray(), rtol=1e-10, atol=1e-6
    )
    np.testing.assert_allclose(rows.jacobian.T @ rows.residuals, linearisation.gradient, rtol=1e-9, atol=1e-6)
    return rows, np.linalg.solve(matrix.toarray(), -linearisation.gradient)


@pytest.mark.parametrize("step", [qr_step, lsmr_step])
def test_steps_of_the_rows_are_those_of_the_normal_equations(step):
    rows, expected = normal_step(network())
    np.testing.assert_allclose(step(rows), expected, rtol=1e-6, atol=1e-9)


def test_qr_solves_what_squaring_the_condition_spoils():
    from scipy.sparse import csr_array

    # Läuchli's matrix: its normal matrix is singular in double precision.
    epsilon = 1e-9
    jacobian = np.array([[1.0, 1.0], [epsilon, 0.0], [0.0, epsilon]])
    rows = StackedRows(csr_array(jacobian), -jacobian @ [1.0, 2.0])
    assert np.linalg.matrix_rank(jacobian.T @ jacobian) == 1
    np.testing.assert_allclose(qr_step(rows), [1.0, 2.0], rtol=1e-6)


def test_l1_is_not_moved_by_a_blunder_and_as_many_residuals_vanish_as_unknowns():
    from scipy.sparse import csr_array

    rng = np.random.default_rng(2)
    jacobian = rng.normal(size=(30, 4))
    observed = jacobian @ [1.0, -2.0, 3.0, 0.5] + rng.normal(0, 1e-3, 30)
    observed[7] += 100.0
    step = l1_step(StackedRows(csr_array(jacobian), -observed))
    np.testing.assert_allclose(step, [1.0, -2.0, 3.0, 0.5], atol=5e-3)
    residuals = jacobian @ step - observed
    assert np.count_nonzero(np.abs(residuals) < 1e-9) >= 4
    best = np.abs(residuals).sum()
    for _ in range(50):
        moved = jacobian @ (step + rng.normal(0, 0.01, 4)) - observed
        assert np.abs(moved).sum() >= best - 1e-9
