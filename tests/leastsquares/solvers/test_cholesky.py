"""The supernodal Cholesky: orders, threads, unknowns kept for the end, singular blocks of every size."""

import numpy as np
import pytest
import scipy.sparse as sp

from obseq.errors import InputError
from obseq.leastsquares.solvers import (
    SingularMatrixError,
    SolverStateError,
    SolverUnavailableError,
    SymmetricPattern,
)
from obseq.leastsquares.solvers import ordering as orderings
from obseq.leastsquares.solvers.cholesky import SupernodalCholesky
from obseq.leastsquares.solvers.outside.superlu import SuperLU


def factored(matrix, **options):
    """A solver that has factored the matrix, and its pattern."""
    pattern, values = SymmetricPattern.of(matrix)
    solver = SupernodalCholesky(**options)
    solver.analyse(pattern)
    solver.factor(values)
    return solver, pattern


def assert_inverts(solver, pattern, matrix):
    """Solution and selected inverse are those of the dense inverse."""
    inverse = np.linalg.inv(matrix)
    sigmas = np.sqrt(np.diag(inverse))
    rows, columns = pattern.indices, pattern.columns()
    error = np.abs(solver.selected_inverse() - inverse[rows, columns]) / (sigmas[rows] * sigmas[columns])
    assert np.max(error) < 1e-12
    expected = np.arange(1.0, pattern.n + 1.0)
    np.testing.assert_allclose(solver.solve(matrix @ expected), expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("ordering", orderings.ORDERINGS)
def test_all_orderings_give_the_same_numbers(ordering, regular):
    solver, pattern = factored(regular, ordering=ordering)
    assert_inverts(solver, pattern, regular)
    assert solver.statistics.ordering == ordering


def test_auto_is_metis_for_many_unknowns_where_it_is_installed_else_minimum_degree(monkeypatch):
    assert SupernodalCholesky(ordering="metis").name == "supernodal"
    many = orderings.FEW + 1
    assert orderings.resolve_ordering("auto", many) == "metis"
    assert orderings.resolve_ordering("auto", orderings.FEW) == "minimum-degree"
    monkeypatch.setattr(orderings, "find_spec", lambda name: None)
    assert orderings.resolve_ordering("auto", many) == "minimum-degree"
    with pytest.raises(SolverUnavailableError, match="pip install 'pymetis'"):
        SupernodalCholesky(ordering="metis")


def test_unknown_ordering_and_no_thread_are_refused():
    with pytest.raises(InputError, match="choose one of: auto, metis, minimum-degree, natural"):
        SupernodalCholesky(ordering="amd")
    with pytest.raises(InputError, match="at least one"):
        SupernodalCholesky(threads=0)


def test_fill_reducing_orders_reduce_the_fill(build):
    matrix = build.survey(300)
    filled = {name: factored(matrix, ordering=name)[0].statistics.nnz_factor for name in orderings.ORDERINGS}
    assert filled["metis"] < 0.7 * filled["natural"]
    assert filled["minimum-degree"] < 0.7 * filled["natural"]


def test_a_chain_fills_next_to_nothing(build):
    solver, _ = factored(build.chain(400))
    assert solver.statistics.nnz_factor < 6 * 400


def test_threads_change_no_number(build):
    matrix = build.survey(400)
    alone, pattern = factored(matrix, threads=1)
    for threads in (2, 3):
        shared, _ = factored(matrix, threads=threads)
        assert len(shared._schedule.tasks) > 4
        np.testing.assert_array_equal(shared.selected_inverse(), alone.selected_inverse())
        np.testing.assert_array_equal(shared.solve(np.ones(pattern.n)), alone.solve(np.ones(pattern.n)))


def test_threads_on_many_small_parts(build):
    matrix = build.blocks(*[build.chain(5)] * 40, build.survey(30), build.dense(20))
    solver, pattern = factored(matrix, threads=2)
    assert_inverts(solver, pattern, matrix)


def grid(side):
    """Sparse normal matrix of a levelling grid with a stiff datum at one corner."""
    number = np.arange(side * side).reshape(side, side)
    edges = np.vstack(
        [
            np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
            np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
        ]
    )
    m, n = len(edges), side * side
    jacobian = sp.csr_array(
        (np.tile([-1.0, 1.0], m), (np.repeat(np.arange(m), 2), edges.ravel())), shape=(m, n)
    )
    return (jacobian.T @ jacobian + sp.coo_array(([1.0], ([0], [0])), shape=(n, n))).tocsc()


@pytest.mark.parametrize("threads", [1, 2])
def test_agrees_with_superlu_on_a_large_grid(threads):
    pattern, values = SymmetricPattern.of(grid(36))
    ours, witness = SupernodalCholesky(threads=threads), SuperLU()
    for solver in (ours, witness):
        solver.analyse(pattern)
        solver.factor(values)
    rhs = np.random.default_rng(3).normal(size=(pattern.n, 2))
    np.testing.assert_allclose(ours.solve(rhs), witness.solve(rhs), rtol=0, atol=1e-9)
    expected = witness.selected_inverse()
    sigmas = np.sqrt(expected[pattern.diagonal])
    scale = sigmas[pattern.indices] * sigmas[pattern.columns()]
    assert np.max(np.abs(ours.selected_inverse() - expected) / scale) < 1e-12


def test_defect_inside_a_large_front(build):
    square = np.random.default_rng(2).normal(size=(90, 86))
    pattern, values = SymmetricPattern.of(square @ square.T)
    solver = SupernodalCholesky()
    solver.analyse(pattern)
    with pytest.raises(SingularMatrixError) as caught:
        solver.factor(values)
    assert len(caught.value.indices) == 4
    vectors = solver.null_vectors()
    np.testing.assert_allclose(vectors.T @ square, 0.0, atol=1e-11)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("threads", [1, 2])
def test_defect_above_a_large_front(build, threads):
    points, pairs = build.network(150, radius=0.6)
    pattern, values = SymmetricPattern.of(build.normal_matrix(build.trilateration(points, pairs)))
    solver = SupernodalCholesky(threads=threads)
    solver.analyse(pattern)
    with pytest.raises(SingularMatrixError) as caught:
        solver.factor(values)
    assert len(caught.value.indices) == 3
    motions = np.linalg.qr(build.plane_motions(points))[0]
    vectors = solver.null_vectors()
    np.testing.assert_allclose(motions @ (motions.T @ vectors), vectors, atol=1e-10)


def test_a_pivot_vanishing_early_spoils_nothing_else(build):
    """Two groups that do not hold together: the one eliminated first is singular, the other is not."""
    square = np.random.default_rng(2).normal(size=(40, 39))
    matrix = build.blocks(square @ square.T, build.survey(40))
    pattern, values = SymmetricPattern.of(matrix)
    solver = SupernodalCholesky()
    solver.analyse(pattern)
    with pytest.raises(SingularMatrixError) as caught:
        solver.factor(values)
    assert len(caught.value.indices) == 1
    vector = solver.null_vectors()[:, 0]
    np.testing.assert_allclose(matrix @ vector, 0.0, atol=1e-10)


LAST = np.array([17, 3, 40, 41, 5])


@pytest.fixture
def split(build):
    """A matrix, its pattern and values, the unknowns kept, the others."""
    matrix = build.survey(60)
    pattern, values = SymmetricPattern.of(matrix)
    return matrix, pattern, values, np.setdiff1d(np.arange(len(matrix)), LAST)


@pytest.mark.parametrize("ordering", orderings.ORDERINGS)
@pytest.mark.parametrize("threads", [1, 2])
def test_schur_complement_of_chosen_unknowns(split, ordering, threads):
    matrix, pattern, values, inner = split
    solver = SupernodalCholesky(last=LAST, ordering=ordering, threads=threads)
    solver.analyse(pattern)
    solver.eliminate(values)
    coupling = np.linalg.solve(matrix[np.ix_(inner, inner)], matrix[np.ix_(inner, LAST)])
    expected = matrix[np.ix_(LAST, LAST)] - matrix[np.ix_(LAST, inner)] @ coupling
    np.testing.assert_allclose(solver.schur_complement(), expected, rtol=1e-10, atol=1e-10)
    rhs = np.random.default_rng(4).normal(size=(len(matrix), 2))
    reduced = rhs[LAST] - coupling.T @ rhs[inner]
    np.testing.assert_allclose(solver.reduce(rhs), reduced, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(solver.reduce(rhs[:, 0]), reduced[:, 0], rtol=1e-10, atol=1e-10)
    solution = np.linalg.solve(matrix, rhs)
    np.testing.assert_allclose(solver.expand(rhs, solution[LAST]), solution, rtol=1e-8, atol=1e-8)
    inverse = np.linalg.inv(matrix)
    selected = solver.expand_inverse(inverse[np.ix_(LAST, LAST)])
    np.testing.assert_allclose(
        selected, inverse[pattern.indices, pattern.columns()], rtol=0, atol=1e-11 * np.max(np.diag(inverse))
    )


def test_whole_factorisation_with_unknowns_kept_for_the_end(split):
    matrix, _, _, _ = split
    solver, pattern = factored(matrix, last=LAST)
    assert_inverts(solver, pattern, matrix)
    assert solver.schur_complement().shape == (5, 5)


def test_all_unknowns_may_be_kept(build):
    matrix = build.dense(6)
    solver, pattern = factored(matrix, last=np.arange(6)[::-1])
    assert_inverts(solver, pattern, matrix)
    np.testing.assert_allclose(solver.schur_complement(), matrix[::-1, ::-1])


def test_remaining_system_may_be_singular_but_not_the_eliminated_one(build):
    matrix = build.normal_matrix(build.levelling(np.array([[0, 1], [1, 2], [2, 3], [4, 5]]), 6))
    pattern, values = SymmetricPattern.of(matrix)
    solver = SupernodalCholesky(last=[0, 3, 4])
    solver.analyse(pattern)
    solver.eliminate(values)
    expected = np.array([[1 / 3, -1 / 3, 0.0], [-1 / 3, 1 / 3, 0.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(solver.schur_complement(), expected, atol=1e-15)
    solver = SupernodalCholesky(last=[0, 3])
    solver.analyse(pattern)
    with pytest.raises(SingularMatrixError) as caught:
        solver.eliminate(values)
    assert caught.value.indices[0] in (4, 5)


def test_interior_held_by_a_weak_prior_is_eliminated(build):
    points, pairs = build.network(30, seed=1, radius=0.6)
    free = build.normal_matrix(build.trilateration(points, pairs))
    matrix = np.zeros((61, 61))
    matrix[:60, :60] = free + 1e-10 * np.eye(60)
    matrix[60, 60] = 1.0
    matrix[60, 0] = matrix[0, 60] = -1e-5
    matrix[0, 0] += 1e-10
    pattern, values = SymmetricPattern.of(matrix)
    solver = SupernodalCholesky(last=[60])
    solver.analyse(pattern)
    solver.eliminate(values)
    inner = np.linalg.solve(matrix[:60, :60], matrix[:60, 60])
    np.testing.assert_allclose(solver.schur_complement(), [[1.0 - matrix[60, :60] @ inner]], atol=1e-4)
    values[pattern.diagonal[:60]] -= 1e-10
    values[0] -= 1e-10
    with pytest.raises(SingularMatrixError):
        solver.eliminate(values)
    with pytest.raises(SolverStateError, match="eliminate"):
        solver.schur_complement()


def test_elimination_alone_solves_nothing(build):
    pattern, values = SymmetricPattern.of(build.chain(5))
    solver = SupernodalCholesky(last=[2])
    solver.analyse(pattern)
    with pytest.raises(SolverStateError):
        solver.schur_complement()
    solver.eliminate(values)
    with pytest.raises(SolverStateError, match="factor"):
        solver.solve(np.ones(5))
    with pytest.raises(SolverStateError, match="last"):
        factored(build.chain(5))[0].eliminate(values)


def test_unknowns_to_keep_are_checked(build):
    with pytest.raises(InputError, match="twice"):
        SupernodalCholesky(last=[1, 1])
    with pytest.raises(InputError, match="below 5"):
        factored(build.chain(5), last=[5])
