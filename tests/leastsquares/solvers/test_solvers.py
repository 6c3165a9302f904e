"""Every solver against dense inverses, on regular and on singular matrices."""

import sys

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.leastsquares.solvers import (
    SOLVER_NAMES,
    SingularMatrixError,
    SolverStateError,
    SolverUnavailableError,
    SymmetricPattern,
    choose_solver,
)


def factored(solver_name, matrix):
    """The solver of that name, having factored the matrix; and the pattern."""
    pattern, values = SymmetricPattern.of(matrix)
    solver = choose_solver(pattern, solver_name)
    solver.analyse(pattern)
    solver.factor(values)
    return solver, pattern


def scaled_inverse(matrix, pattern):
    """Entries of the dense inverse on the pattern, and the product of the two standard deviations of each."""
    inverse = np.linalg.inv(matrix)
    sigmas = np.sqrt(np.diag(inverse))
    rows, columns = pattern.indices, pattern.columns()
    return inverse[rows, columns], sigmas[rows] * sigmas[columns]


def test_solves_one_and_several_right_hand_sides(solver_name, regular):
    solver, _ = factored(solver_name, regular)
    expected = np.random.default_rng(1).normal(size=(len(regular), 3))
    np.testing.assert_allclose(solver.solve(regular @ expected), expected, rtol=0, atol=1e-10)
    one = solver.solve(regular @ expected[:, 1])
    assert one.shape == (len(regular),)
    np.testing.assert_allclose(one, expected[:, 1], rtol=0, atol=1e-10)


def test_right_hand_side_is_left_as_it_was(solver_name, build):
    solver, _ = factored(solver_name, build.chain(5))
    for rhs in (np.arange(5.0), np.asfortranarray(np.arange(10.0).reshape(5, 2))):
        before = rhs.copy()
        solver.solve(rhs)
        np.testing.assert_array_equal(rhs, before)


def test_selected_inverse_is_the_inverse_on_the_whole_pattern(solver_name, regular):
    solver, pattern = factored(solver_name, regular)
    expected, scale = scaled_inverse(regular, pattern)
    assert np.max(np.abs(solver.selected_inverse() - expected) / scale) < 1e-12


def test_refactors_new_values_after_one_analysis(solver_name, build):
    pattern, values = SymmetricPattern.of(build.survey(30))
    solver = choose_solver(pattern, solver_name)
    solver.analyse(pattern)
    for change in (1.0, 2.5, 0.1):
        changed = values * change
        changed[pattern.diagonal] += change**2
        solver.factor(changed)
        matrix = pattern.matrix(changed).toarray()
        rhs = np.arange(1.0, pattern.n + 1.0)
        np.testing.assert_allclose(solver.solve(rhs), np.linalg.solve(matrix, rhs), rtol=1e-9, atol=1e-9)
        expected, scale = scaled_inverse(matrix, pattern)
        assert np.max(np.abs(solver.selected_inverse() - expected) / scale) < 1e-12


def test_the_same_values_are_factored_once(solver_name, build, monkeypatch):
    solver, pattern = factored(solver_name, build.survey(30))
    same, plain, factorings = SymmetricPattern.of(build.survey(30))[1], type(solver)._factor, []
    monkeypatch.setattr(
        type(solver), "_factor", lambda self, *given: factorings.append(1) or plain(self, *given)
    )
    solver.factor(same.copy())
    assert not factorings
    same[pattern.diagonal[0]] *= 2.0
    solver.factor(same)
    assert factorings
    rhs = np.arange(1.0, pattern.n + 1.0)
    expected = np.linalg.solve(pattern.matrix(same).toarray(), rhs)
    np.testing.assert_allclose(solver.solve(rhs), expected, rtol=1e-9, atol=1e-9)


def test_entries_of_the_pattern_may_be_zero(solver_name):
    pattern = SymmetricPattern.of(np.ones((3, 3)))[0]
    solver = choose_solver(pattern, solver_name)
    solver.analyse(pattern)
    solver.factor(np.array([2.0, 0.0, 0.0, 4.0, 0.0, 8.0]))
    np.testing.assert_allclose(solver.selected_inverse(), [0.5, 0.0, 0.0, 0.25, 0.0, 0.125], atol=1e-15)


def test_a_regular_matrix_has_no_defect(solver_name, regular):
    solver, _ = factored(solver_name, regular)
    assert solver.defect().dimension == 0
    assert solver.null_vectors().shape == (len(regular), 0)


def test_empty_system(solver_name):
    pattern = SymmetricPattern(0, np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int32))
    solver = choose_solver(pattern, solver_name)
    solver.analyse(pattern)
    solver.factor(np.zeros(0))
    assert solver.defect().dimension == 0
    assert solver.solve(np.zeros((0, 2))).shape == (0, 2)
    assert solver.selected_inverse().shape == (0,)


def test_statistics_count_the_factor(solver_name, build):
    solver, pattern = factored(solver_name, build.chain(40))
    statistics = solver.statistics
    assert statistics.solver == solver_name == solver.name
    assert statistics.n == 40
    assert statistics.nnz_pattern == pattern.nnz == 79
    assert 79 <= statistics.nnz_factor <= 40 * 41 / 2
    assert statistics.flops >= 0
    assert statistics.memory >= 8 * 79


def singular(solver_name, matrix):
    """The solver and the error of the attempt to factor the matrix."""
    pattern, values = SymmetricPattern.of(matrix)
    solver = choose_solver(pattern, solver_name)
    solver.analyse(pattern)
    with pytest.raises(SingularMatrixError) as caught:
        solver.factor(values)
    return solver, caught.value


def assert_same_space(vectors, expected):
    """Both (n, k) span the same space."""
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(vectors.shape[1]), atol=1e-12)
    basis = np.linalg.qr(expected)[0]
    assert vectors.shape == basis.shape
    np.testing.assert_allclose(basis @ (basis.T @ vectors), vectors, atol=1e-9)


def test_free_plane_network_lacks_two_translations_and_one_rotation(solver_name, build):
    points, pairs = build.network(50)
    matrix = build.normal_matrix(build.trilateration(points, pairs))
    solver, error = singular(solver_name, matrix)
    assert len(error.indices) == 3
    assert np.all(np.abs(error.pivots) < 1e-9)
    np.testing.assert_array_equal(solver.defect().indices, error.indices)
    assert_same_space(solver.null_vectors(), build.plane_motions(points))
    held = matrix.copy()
    held[error.indices, error.indices] += 1.0
    assert np.linalg.eigvalsh(held)[0] > 1e-9, "holding the unknowns named makes the matrix regular"


def test_free_networks_are_never_taken_for_regular(solver_name, build):
    for seed in range(8):
        points, pairs = build.network(30, seed=seed, radius=0.5)
        _, error = singular(solver_name, build.normal_matrix(build.trilateration(1e3 * points, pairs)))
        assert len(error.indices) == 3


def test_long_free_networks_are_singular_although_rounding_is_large(solver_name, build):
    points, pairs = build.network(100, seed=3, radius=0.3)
    jacobian = build.trilateration(points * [100.0, 1.0], pairs)
    solver, error = singular(solver_name, build.normal_matrix(jacobian))
    assert len(error.indices) == 3
    assert np.max(np.abs(jacobian @ solver.null_vectors())) < 1e-9


@pytest.mark.parametrize(("n", "share"), [(12, 0.35), (13, 0.4), (18, 0.5)])
def test_pivots_made_of_rounding_hide_no_kernel(solver_name, build, n, share):
    """The last unknown has 1e-5 of the vector: its pivot should vanish, and is 1e-6 of any sign."""
    for seed in range(12):
        matrix, vector = build.fading(n, share, seed)
        solver, error = singular(solver_name, matrix)
        assert len(error.indices) == 1
        assert_same_space(solver.null_vectors(), vector[:, None])


def test_network_held_by_a_weak_prior_is_regular(solver_name, build):
    points, pairs = build.network(40, seed=1, radius=0.4)
    normal = build.normal_matrix(build.trilateration(points, pairs))
    motions = np.linalg.qr(build.plane_motions(points))[0]
    for prior in (1e-9, 1e-11):
        solver, pattern = factored(solver_name, normal + prior * np.eye(80))
        assert solver.defect().dimension == 0
        inverse = motions @ motions.T / prior  # what the prior alone holds dominates
        found = pattern.matrix(solver.selected_inverse()).toarray() * prior
        present = pattern.matrix(np.ones(pattern.nnz)).toarray()
        np.testing.assert_allclose(found, inverse * prior * present, atol=1e-3)


def test_only_the_undetermined_part_is_named_beside_a_weak_one(solver_name, build):
    points, pairs = build.network(25, seed=1, radius=0.6)
    normal = build.normal_matrix(build.trilateration(points, pairs))
    zero = np.zeros((50, 50))
    matrix = np.block([[normal + 1e-10 * np.eye(50), zero], [zero, normal]])
    solver, error = singular(solver_name, matrix)
    assert len(error.indices) == 3
    assert np.all(error.indices >= 50)
    vectors = solver.null_vectors()
    np.testing.assert_allclose(vectors[:50], 0.0, atol=1e-9)
    assert_same_space(vectors[50:], build.plane_motions(points))


def test_many_unknowns_never_observed_are_all_named(solver_name, build):
    matrix = np.zeros((150, 150))
    matrix[40:60, 40:60] = build.dense(20)
    _, error = singular(solver_name, matrix)
    np.testing.assert_array_equal(error.indices, np.setdiff1d(np.arange(150), np.arange(40, 60)))


def test_each_disconnected_levelling_line_lacks_a_height(solver_name, build):
    free = [build.normal_matrix(build.levelling(np.array([[0, 1], [1, 2], [2, 3]]), 4)) for _ in range(3)]
    matrix = build.blocks(*free, build.chain(6))
    solver, error = singular(solver_name, matrix)
    assert len(error.indices) == 3
    vectors = solver.null_vectors()
    np.testing.assert_allclose(matrix @ vectors, 0.0, atol=1e-13)
    assert np.linalg.matrix_rank(vectors) == 3


def test_unknown_never_observed_is_named(solver_name, build):
    matrix = build.chain(8)
    matrix[5] = matrix[:, 5] = 0.0
    matrix[6, 6] = matrix[4, 4] = 2.0
    solver, error = singular(solver_name, np.diag(np.diag(matrix)))
    np.testing.assert_array_equal(error.indices, [5])
    np.testing.assert_array_equal(error.pivots, [0.0])
    np.testing.assert_allclose(np.abs(solver.null_vectors()[:, 0]), np.eye(8)[5], atol=1e-15)
    assert "unknown(s) 5" in str(error)


def test_indefinite_matrix_is_refused(solver_name):
    _, error = singular(solver_name, np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert len(error.indices) == 1
    assert error.indices[0] in (0, 1)
    assert error.pivots[0] == pytest.approx(-3.0)


def test_singular_matrix_gives_no_numbers_and_the_solver_recovers(solver_name, build):
    matrix = build.chain(5)
    pattern, values = SymmetricPattern.of(matrix)
    solver, _ = singular(solver_name, build.normal_matrix(build.levelling(np.array([[0, 1], [1, 2]]), 3)))
    with pytest.raises(SingularMatrixError):
        solver.solve(np.ones(3))
    with pytest.raises(SingularMatrixError):
        solver.selected_inverse()
    solver.analyse(pattern)
    solver.factor(values)
    np.testing.assert_allclose(solver.solve(matrix @ np.arange(5.0)), np.arange(5.0), atol=1e-12)


def test_steps_out_of_order_are_refused(solver_name, build):
    pattern, values = SymmetricPattern.of(build.chain(5))
    solver = choose_solver(pattern, solver_name)
    with pytest.raises(SolverStateError, match="analyse"):
        solver.factor(values)
    solver.analyse(pattern)
    with pytest.raises(SolverStateError, match="factor"):
        solver.solve(np.ones(5))
    with pytest.raises(SolverStateError, match="factor"):
        solver.defect()


def test_wrong_values_and_right_hand_sides_are_refused(solver_name, build):
    solver, pattern = factored(solver_name, build.chain(5))
    with pytest.raises(InputError, match="9 entries"):
        solver.factor(np.ones(4))
    with pytest.raises(InputError, match="5 unknowns"):
        solver.solve(np.ones(4))
    values = np.ones(pattern.nnz)
    values[3] = np.nan
    with pytest.raises(InputError, match="not finite at row 2, column 1"):
        solver.factor(values)


def test_auto_takes_dense_for_small_and_for_full_matrices_only(build):
    assert choose_solver(SymmetricPattern.of(build.chain(30))[0]).name == "dense"
    assert choose_solver(SymmetricPattern.of(np.ones((1100, 1100)))[0]).name == "dense"
    assert choose_solver(SymmetricPattern.of(np.eye(1100))[0]).name == "supernodal"


def test_unknown_solver_is_refused(build):
    pattern, _ = SymmetricPattern.of(build.chain(3))
    with pytest.raises(InputError, match="choose one of: auto, " + ", ".join(SOLVER_NAMES)):
        choose_solver(pattern, "gauss")


@pytest.mark.parametrize(
    ("name", "module", "package"),
    [("pardiso", "pypardiso", "pypardiso"), ("cholmod", "sksparse.cholmod", "scikit-sparse<0.5")],
)
def test_missing_package_is_named_and_nothing_else_is_taken_instead(
    build, monkeypatch, name, module, package
):
    monkeypatch.setitem(sys.modules, module, None)
    pattern, _ = SymmetricPattern.of(build.chain(3))
    with pytest.raises(SolverUnavailableError, match=f"'{name}' needs .* pip install '{package}'"):
        choose_solver(pattern, name)
