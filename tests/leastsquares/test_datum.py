"""Inner constraints against pseudo-inverses and bordered systems."""

from types import SimpleNamespace

import numpy as np
import pytest

from obseq.errors import InputError, SingularMatrixError
from obseq.leastsquares import LeastSquares, LevenbergMarquardt
from obseq.leastsquares.iterations.datum_solver import Border, DatumSolver
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


def solver_on(matrix, chosen, name, offset=None):
    pattern, values = SymmetricPattern.of(matrix)
    offset = np.zeros(len(matrix)) if offset is None else offset
    solver = DatumSolver(choose_solver(pattern, name), chosen, lambda: offset)
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


@pytest.mark.parametrize("name", ["dense", "superlu"])
def test_the_defect_is_the_same_from_one_linearisation_to_the_next(name):
    """The vector of the kernel fades: the last pivot is rounding, now above any limit, now below zero."""
    vector = 0.35 ** np.arange(12.0)
    seen = np.linalg.svd(vector[:, None])[0][:, 1:]
    for seed in range(12):
        generator = np.random.default_rng(seed)
        first, second = (seen @ generator.normal(size=(11, 60)) for _ in range(2))
        solver, _ = solver_on(first @ first.T, np.ones(12, bool), name)
        assert solver.dimension == 1
        solver.factor(SymmetricPattern.of(second @ second.T)[1])
        expected = np.linalg.pinv(second @ second.T, rcond=1e-10)
        np.testing.assert_allclose(solver.solve(np.eye(12)), expected, atol=1e-9 * np.abs(expected).max())


def test_all_unknowns_chosen_is_the_pseudo_inverse():
    _, matrix = free_network()
    solver, _ = solver_on(matrix, np.ones(24, bool), "dense")
    np.testing.assert_allclose(solver.solve(np.eye(24)), np.linalg.pinv(matrix, rcond=1e-10), atol=1e-11)


def test_a_settled_step_ends_on_the_datum():
    points, matrix = free_network()
    chosen = np.arange(24) < 10
    offset = np.random.default_rng(1).normal(size=24)
    solver, _ = solver_on(matrix, chosen, "dense", offset)
    end = solver.settle(np.zeros(24)) + offset
    turned = np.column_stack([-points[:, 1], points[:, 0]]).ravel()
    for movement in (np.tile([1.0, 0.0], 12), np.tile([0.0, 1.0], 12), turned):
        assert movement[chosen] @ end[chosen] == pytest.approx(0.0, abs=1e-9)


def test_a_regular_system_is_left_as_it_is():
    _, matrix = free_network()
    matrix = matrix + np.eye(24)
    solver, _ = solver_on(matrix, np.ones(24, bool), "dense")
    assert solver.dimension == 0
    np.testing.assert_allclose(solver.solve(np.eye(24)), np.linalg.inv(matrix), atol=1e-12)


@pytest.mark.parametrize("name", ["dense", "superlu"])
@pytest.mark.parametrize("weight", [1e-9, 1.0])
def test_what_is_held_is_held_whatever_observations_say_of_it(name, weight):
    """A scale that is seen by something, weakly or well, beside the three motions that nothing sees."""
    points, matrix = free_network()
    chosen = np.arange(24) < 14
    arms = (points - points.mean(axis=0)).ravel() / 50.0
    seen = np.random.default_rng(2).normal(size=24)
    kernel = np.linalg.svd(matrix)[0][:, -3:]
    seen -= kernel @ (kernel.T @ seen)
    matrix = matrix + weight * np.outer(seen, seen)
    pattern, values = SymmetricPattern.of(matrix)
    motions = np.column_stack([kernel, arms])
    along = np.where(chosen[:, None], motions, 0.0)
    offset = np.random.default_rng(1).normal(size=24)
    solver = DatumSolver(choose_solver(pattern, name), chosen, lambda: offset, None, lambda: along, 4)
    solver.analyse(pattern)
    solver.factor(values)
    expected = bordered_inverse(matrix, motions, chosen)
    scale = np.abs(expected).max()
    assert solver.dimension == 4
    np.testing.assert_allclose(solver.solve(np.eye(24)), expected, atol=1e-9 * scale)
    found = solver.selected_inverse()
    np.testing.assert_allclose(found, expected[pattern.indices, pattern.columns()], atol=1e-9 * scale)
    end = solver.settle(np.zeros(24))
    np.testing.assert_allclose(along.T @ (end + offset), 0.0, atol=1e-9)
    free = expected @ np.random.default_rng(3).normal(size=24)
    assert free @ matrix @ end == pytest.approx(0.0, abs=1e-9 * np.abs(matrix).max())


@pytest.mark.parametrize("name", ["dense", "superlu"])
def test_what_a_constraint_holds_has_no_variance_however_little_is_seen_of_it(name):
    """A point seen in one direction well, across it 1e-9 as well, and held along a line between the two."""
    _, matrix = free_network()
    matrix = np.block([[matrix, np.zeros((24, 2))], [np.zeros((2, 24)), np.zeros((2, 2))]])
    row = np.zeros(26)
    row[[0, 24]] = -1.0, 1.0
    faint = np.zeros(26)
    faint[[1, 25]] = -1.0, 1.0
    matrix += np.outer(row, row) + 1e-18 * np.outer(faint, faint)
    constraint = np.zeros((26, 1))
    constraint[24:, 0] = 1e-3, 1.0
    chosen = np.arange(26) < 24
    pattern, values = SymmetricPattern.of(matrix)
    solver = DatumSolver(
        choose_solver(pattern, name),
        chosen,
        lambda: np.zeros(26),
        holds=lambda: (constraint, np.zeros(1)),
    )
    solver.analyse(pattern)
    solver.factor(values)
    found = solver.solve(np.eye(26))
    assert solver.dimension == 3
    spread = np.sqrt(constraint[:, 0] @ found @ constraint[:, 0])
    assert spread <= 1e-8 * np.sqrt(np.diag(found).max())


def test_a_weak_direction_has_the_digits_of_the_rows():
    """A scale that one row sees by 3e-8 of what it sees of points: N has 1e-15 of it, which is rounding."""
    points, _ = free_network()
    start, end = np.triu_indices(12, 1)
    sights = (points[end] - points[start]) / np.linalg.norm(points[end] - points[start], axis=1)[:, None]
    rows = np.zeros((len(start) + 1, 24))
    for row, (i, j, sight) in enumerate(zip(start, end, sights, strict=True)):
        across = np.array([-sight[1], sight[0]]) / np.linalg.norm(points[j] - points[i])
        rows[row, 2 * i : 2 * i + 2], rows[row, 2 * j : 2 * j + 2] = -across, across
    arms = (points - points.mean(axis=0)).ravel()
    rows[-1] = 3e-8 * arms / (arms @ arms)
    shifts = np.tile(np.eye(2), (12, 1))
    weak = np.column_stack([shifts, arms / 50.0])
    pattern, values = SymmetricPattern.of(rows.T @ rows)
    chosen, still = np.ones(24, np.bool_), np.zeros(24)
    found = {}
    for seen in (lambda directions: rows @ directions, None):
        solver = DatumSolver(
            choose_solver(pattern, "dense"), chosen, lambda: still, None, lambda: weak, 2, seen
        )
        solver.analyse(pattern)
        try:
            solver.factor(values)
            found[seen is None] = solver.solve(np.eye(24))
        except SingularMatrixError:
            found[seen is None] = np.zeros((24, 24))
    across = np.linalg.svd(shifts)[0][:, 2:]
    inverse = np.linalg.pinv(rows @ across, rcond=1e-12)
    expected = across @ inverse @ inverse.T @ across.T
    np.testing.assert_allclose(found[False], expected, atol=1e-6 * np.abs(expected).max())
    assert np.abs(found[True] - expected).max() > 1e-3 * np.abs(expected).max()


def test_a_datum_whose_directions_rounding_makes_one_is_a_singular_matrix():
    """Heights of 900 km beside sights of 100 m did so: M^-1 then has one direction for two of the datum."""
    solver = SimpleNamespace(solve=lambda right: np.ones((4, 4)) @ right)
    with pytest.raises(SingularMatrixError, match="singular to rounding"):
        Border.of(solver, np.eye(4)[:, :1], np.eye(4)[:, :2], None)


def test_a_datum_of_one_point_does_not_fix_a_rotation():
    _, matrix = free_network()
    with pytest.raises(InputError, match="3 free parameters"):
        solver_on(matrix, np.arange(24) < 2, "dense")


def free_system(seed=5, n=9, noise=0.01):
    """Distances in the plane without any known point."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0, 100, (n, 2))
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(n)], start)
    first, second = np.triu_indices(n, 1)
    true = start + rng.normal(0, 0.5, start.shape)
    lengths = np.linalg.norm(true[second] - true[first], axis=1) * (1 + rng.normal(0, noise / 50, len(first)))
    system.add("Dist2DCons", {"p1": ids[first], "p2": ids[second]}, lengths, noise / 50)
    return system, ids, start


def test_a_free_network_moves_its_datum_points_as_little_as_possible():
    system, ids, start = free_system()
    system.set_datum(ids[:4])
    result = system.solve(covariance="all")
    assert result.converged
    assert (system.datum_defect, result.redundancy) == (3, 36 + 3 - 18)
    moved = (result.values(ids) - start)[:4]
    points = result.values(ids)[:4]
    turned = np.column_stack([-points[:, 1], points[:, 0]])
    assert np.abs(moved.sum(axis=0)).max() < 1e-7
    assert abs(np.sum(moved * turned)) < 1e-5


def test_the_datum_changes_neither_residuals_nor_the_fit():
    results = []
    for chosen in (slice(0, 4), slice(None), slice(3, 6)):
        system, ids, _ = free_system()
        system.set_datum(ids[chosen])
        results.append(system.solve(covariance="all"))
    assert results[0].sigma0 == pytest.approx(results[1].sigma0, rel=1e-9)
    assert results[0].sigma0 == pytest.approx(results[2].sigma0, rel=1e-9)
    # The trace of the covariance of all points is least when all of them define the datum.
    traces = [np.trace(result.covariance(ids), axis1=1, axis2=2).sum() for result in results]
    assert traces[1] < min(traces[0], traces[2])


def test_a_datum_of_points_that_fix_nothing_is_refused():
    system, ids, _ = free_system()
    system.set_datum(ids[:1])
    with pytest.raises(InputError, match="does not fix the 3 free parameters"):
        system.solve()


def stations_and_targets(eliminated, seed=5):
    """A free network in space: stations that measure distances to targets, and to each other."""
    rng = np.random.default_rng(seed)
    true = rng.uniform(0.0, 100.0, (5 + 15, 3))
    system = LeastSquares("supernodal")
    ids = system.add_points([f"P{k}" for k in range(20)], true + rng.normal(0.0, 0.05, true.shape))
    station, target = (k.ravel() for k in np.meshgrid(np.arange(5), np.arange(5, 20), indexing="ij"))
    i, j = (
        np.concatenate([station, np.triu_indices(5, 1)[0]]),
        np.concatenate([target, np.triu_indices(5, 1)[1]]),
    )
    lengths = np.linalg.norm(true[i] - true[j], axis=1) + rng.normal(0.0, 0.01, len(i))
    system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, lengths, 0.01)
    if eliminated:
        system.eliminate(ids[5:])
    return system, ids


@pytest.mark.parametrize("chosen", [slice(5, 12), slice(3, 9)])
def test_eliminated_points_may_define_the_datum(chosen):
    solved = []
    for eliminated in (False, True):
        system, ids = stations_and_targets(eliminated)
        start = system.values(ids)
        system.set_datum(ids[chosen])
        result = system.solve(covariance=True)
        assert (system.datum_defect, result.converged) == (6, True)
        moved = (result.values(ids) - start)[chosen]
        assert np.abs(moved.sum(axis=0)).max() < 1e-9
        solved.append((result.values(ids), result.covariance(ids), len(result.iterations)))
    np.testing.assert_allclose(solved[0][0], solved[1][0], atol=1e-9)
    np.testing.assert_allclose(solved[0][1], solved[1][1], rtol=1e-6)
    assert solved[0][2] == solved[1][2]


def test_components_of_the_datum_point_by_point():
    components = [["x", "y", "z"], ["x", "y"], [2, 0], "xyz", ["z"]]
    mask = np.array([[1, 1, 1], [1, 1, 0], [1, 0, 1], [1, 1, 1], [0, 0, 1]], dtype=bool)
    chosen = []
    for given in (components, mask):
        system, ids = stations_and_targets(False)
        system.set_datum(ids[:5], given)
        chosen.append(system.datum.scalars.tolist())
    assert chosen[0] == chosen[1] == [0, 1, 2, 3, 4, 6, 8, 9, 10, 11, 14]
    start = system.unknowns.values.copy()
    system.solve()
    assert abs((system.unknowns.values - start)[[0, 3, 6, 9]].sum()) < 1e-8
    for wrong in (components[:3], mask[:, :2], [["w"]] * 5):
        with pytest.raises(InputError, match="datum"):
            system.set_datum(ids[:5], wrong)


def test_unknowns_may_be_added_after_the_datum():
    system, ids = stations_and_targets(False)
    system.set_datum(ids[:5])
    new = system.add_points(["new"], [[1.0, 2.0, 3.0]])
    system.add_prior(new, [[1.0, 2.0, 3.0]], 0.1)
    assert system.solve().converged


@pytest.mark.parametrize("strategy", ["controlled", "levenberg-marquardt"])
@pytest.mark.parametrize("is_eliminated", [False, True])
def test_damped_steps_from_far_end_on_the_datum(strategy, is_eliminated):
    rng = np.random.default_rng(4)
    true = rng.uniform(0, 100, (9, 3))
    start = true + rng.normal(0, 25, true.shape)
    i, j = np.triu_indices(9, 1)
    system = LeastSquares()
    ids = system.add_points([f"P{k}" for k in range(9)], start)
    lengths = np.linalg.norm(true[j] - true[i], axis=1) + rng.normal(0, 0.01, len(i))
    kept = (j > 5) & (i <= 5) | (j <= 5)
    system.add("Dist3D", {"p1": ids[i[kept]], "p2": ids[j[kept]]}, lengths[kept], 0.01)
    chosen = ids[[0, 2, 4, 7]]
    system.set_datum(chosen)
    if is_eliminated:
        system.eliminate(ids[6:])
    result = system.solve(strategy=strategy, max_iterations=200, covariance=True)
    assert result.converged
    assert result.redundancy == np.count_nonzero(kept) - 27 + 6
    assert len(result.iterations) > 6  # some steps were held back
    change = result.values(chosen) - start[[0, 2, 4, 7]]
    np.testing.assert_allclose(change.sum(axis=0), 0.0, atol=1e-8)


def test_a_constant_damping_is_refused_with_a_datum():
    system = LeastSquares()
    ids = system.add_points(["A", "B", "C"], [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]])
    system.add("Dist3D", {"p1": ids[[0, 1, 2]], "p2": ids[[1, 2, 0]]}, [10.0, 14.1, 10.0], 0.01)
    system.set_datum(ids)
    with pytest.raises(InputError, match="not together with a datum"):
        system.solve(strategy=LevenbergMarquardt(constant=True))


@pytest.mark.parametrize("seed", range(10))
def test_what_the_datum_alone_determines_has_no_variance_and_no_negative_one(seed):
    _, matrix = free_network(seed=seed)
    chosen = np.isin(np.arange(24), [4, 5, 12])  # as many as there are free parameters
    solver, pattern = solver_on(matrix, chosen, "dense")
    variances = solver.selected_inverse()[pattern.diagonal]
    assert variances.min() >= 0.0
    assert variances[chosen].max() < 1e-9 * variances.max()


def test_constraints_and_datum_parameters_count_for_themselves():
    system, ids, start = free_system()
    system.set_datum(ids[:4])
    between = ids[[0]], ids[[1]]
    system.constrain_linear(
        between, [np.array([[-1.0, 0.0]]), np.array([[1.0, 0.0]])], start[1, :1] - start[0, :1]
    )
    result = system.solve()
    assert result.redundancy == 36 + 1 + system.datum_defect - 18
