"""Inner constraints against pseudo-inverses and bordered systems."""

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares.datum import DatumSolver
from obseq.leastsquares.solvers import SymmetricPattern, choose_solver


def free_network(n_points=12, seed=3):
    """Normal matrix of distances in the plane: two translations and a rotation are undetermined."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0, 100, (n_points, 2))
    rows = []
    for i in range(n_points):
        for j in range(i):
            if rng.uniform() < 0.6:
                direction = (points[j] - points[i]) / np.linalg.norm(points[j] - points[i])
                row = np.zeros(2 * n_points)
                row[2 * i : 2 * i + 2], row[2 * j : 2 * j + 2] = -direction, direction
                rows.append(row)
    jacobian = np.array(rows)
    return points, jacobian.T @ jacobian


def solver_on(matrix, chosen, name):
    pattern, values = SymmetricPattern.of(matrix)
    solver = DatumSolver(choose_solver(pattern, name), chosen)
    solver.analyse(pattern)
    solver.factor(values)
    return solver, pattern


def bordered_inverse(matrix, kernel, chosen):
    """The inverse on the datum from the bordered system [N B; B' 0], B the kernel on the chosen unknowns."""
    border = np.where(chosen[:, None], kernel, 0.0)
    k = kernel.shape[1]
    return np.linalg.inv(np.block([[matrix, border], [border.T, np.zeros((k, k))]]))[:-k, :-k]


@pytest.mark.parametrize("name", ["dense", "superlu"])
@pytest.mark.parametrize("n_chosen", [2, 5, 12])
def test_cofactors_are_those_of_the_bordered_system(name, n_chosen):
    _, matrix = free_network()
    chosen = np.arange(24) < 2 * n_chosen
    solver, pattern = solver_on(matrix, chosen, name)
    kernel = np.linalg.svd(matrix)[0][:, -3:]
    expected = bordered_inverse(matrix, kernel, chosen)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(solver.solve(np.eye(24)), expected, atol=1e-11 * scale)
    found = solver.selected_inverse()
    np.testing.assert_allclose(found, expected[pattern.indices, pattern.columns()], atol=1e-11 * scale)
    assert solver.dimension == 3


def test_all_unknowns_chosen_is_the_pseudo_inverse():
    _, matrix = free_network()
    solver, _ = solver_on(matrix, np.ones(24, bool), "dense")
    np.testing.assert_allclose(solver.solve(np.eye(24)), np.linalg.pinv(matrix, rcond=1e-10), atol=1e-11)


def test_a_settled_step_ends_on_the_datum():
    points, matrix = free_network()
    chosen = np.arange(24) < 10
    solver, _ = solver_on(matrix, chosen, "dense")
    offset = np.random.default_rng(1).normal(size=24)
    end = solver.settled(np.zeros(24), offset) + offset
    turned = np.column_stack([-points[:, 1], points[:, 0]]).ravel()
    for movement in (np.tile([1.0, 0.0], 12), np.tile([0.0, 1.0], 12), turned):
        assert movement[chosen] @ end[chosen] == pytest.approx(0.0, abs=1e-9)


def test_a_regular_system_is_left_as_it_is():
    _, matrix = free_network()
    matrix = matrix + np.eye(24)
    solver, _ = solver_on(matrix, np.ones(24, bool), "dense")
    assert solver.dimension == 0
    np.testing.assert_allclose(solver.solve(np.eye(24)), np.linalg.inv(matrix), atol=1e-12)


def test_a_datum_of_one_point_does_not_fix_a_rotation():
    _, matrix = free_network()
    with pytest.raises(InputError, match="3 free parameters"):
        solver_on(matrix, np.arange(24) < 2, "dense")
