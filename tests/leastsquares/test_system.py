"""Solutions against what is known: by hand, by scipy, by symmetry; and what a result says of them."""

import numpy as np
import pytest
from networks import jacobian, levelled_square, mixed_system
from scipy.optimize import least_squares

from obseq.errors import DivergenceError
from obseq.geometry import exponential
from obseq.leastsquares import LeastSquares, StopReason


def levelling_design():
    a = np.array([[-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1], [1, 0, 0, -1], [-1, 0, 1, 0]], float)
    return a[:, 1:], np.array([1.02, 2.01, -0.98, -2.02, 3.00])


def test_a_levelling_network_by_hand():
    system, heights, batch = levelled_square()
    system.freeze(heights[:1])
    result = system.solve(covariance="all")
    a, values = levelling_design()
    expected = np.linalg.solve(a.T @ a, a.T @ values)
    assert result.values(heights).ravel() == pytest.approx([0.0, *expected], abs=1e-12)
    residuals = a @ expected - values
    assert result.residuals(batch).ravel() == pytest.approx(residuals, abs=1e-12)
    assert result.normalised_residuals(batch).ravel() == pytest.approx(residuals / 0.01, abs=1e-9)
    assert (result.n_observations, result.n_unknowns, result.redundancy) == (5, 3, 2)
    assert result.sigma0 == pytest.approx(np.sqrt(np.sum((residuals / 0.01) ** 2) / 2))
    cofactors = 0.01**2 * np.linalg.inv(a.T @ a)
    assert result.covariance(heights, a_priori=True)[1:, 0, 0] == pytest.approx(np.diag(cofactors))
    assert result.covariance(heights)[1:, 0, 0] == pytest.approx(result.sigma0**2 * np.diag(cofactors))
    assert result.covariance(heights)[0, 0, 0] == 0.0
    between = result.covariance_between(heights, heights, a_priori=True)
    assert between[1:, 1:] == pytest.approx(cofactors)
    assert not between[0].any()
    assert result.precisions(heights, a_priori=True)[2, 0] == pytest.approx(np.sqrt(cofactors[1, 1]))


def test_a_linear_system_takes_one_iteration_and_says_why_it_stops():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    result = system.solve()
    assert result.converged
    assert result.stop_reason is StopReason.STEP
    assert len(result.iterations) == 2
    assert result.iterations[0].max_step == pytest.approx(3.015, abs=0.01)
    values = [1.02, 2.01, -0.98, -2.02, 3.00]
    start = np.sqrt(np.sum((np.array(values) / 0.01) ** 2) / 2)
    assert result.iterations[0].sigma0 == pytest.approx(start)
    assert result.iterations[1].sigma0 == pytest.approx(result.sigma0)


def test_a_number_of_iterations_is_kept_and_is_no_convergence():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    result = system.solve(max_iterations=1)
    assert (len(result.iterations), result.converged) == (1, False)
    assert result.stop_reason is StopReason.ITERATIONS
    assert len(system.solve(max_iterations=4, tolerance=-1.0).iterations) == 4


def trilateration(seed=0, n=12, noise=1e-3, solver="auto", order=None):
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.0, 100.0, (n, 3))
    i, j = np.triu_indices(n, 1)
    measured = np.linalg.norm(points[i] - points[j], axis=1) + rng.normal(0.0, noise, len(i))
    start = points + rng.normal(0.0, 0.5, points.shape)
    start[:3] = points[:3]
    order = np.arange(n) if order is None else order
    system = LeastSquares(solver)
    ids = np.empty(n, dtype=np.int64)
    ids[order] = system.add_points([f"P{k}" for k in order], start[order])
    batch = system.add("Dist3D", {"p1": ids[i], "p2": ids[j]}, measured, noise)
    system.freeze(ids[:1])
    system.freeze(ids[1:2], ("y", "z"))
    system.freeze(ids[2:3], ("z",))
    return system, ids, batch, points, measured, (i, j)


def test_distances_as_scipy_solves_them():
    system, ids, _, _, measured, (i, j) = trilateration()
    start = system.values(ids).copy()
    free = np.ones_like(start, dtype=bool)
    free[0] = free[1, 1:] = free[2, 2] = False

    def residuals(x):
        moved = start.copy()
        moved[free] = x
        return (np.linalg.norm(moved[i] - moved[j], axis=1) - measured) / 1e-3

    expected = least_squares(residuals, start[free], jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    result = system.solve(covariance="all")
    assert result.converged
    assert result.values(ids)[free] == pytest.approx(expected.x, abs=1e-8)
    assert result.cost == pytest.approx(2.0 * expected.cost, rel=1e-9)
    cofactors = np.linalg.inv(expected.jac.T @ expected.jac)
    found = result.covariance(ids, a_priori=True)
    assert np.diagonal(found, axis1=1, axis2=2)[free] == pytest.approx(np.diag(cofactors), rel=1e-5)


@pytest.mark.parametrize("solver", ["dense", "superlu"])
def test_numbering_and_solver_do_not_matter(solver):
    system, ids, *_ = trilateration()
    other, renumbered, *_ = trilateration(solver=solver, order=np.arange(12)[::-1])
    first, second = system.solve(covariance="all"), other.solve(covariance="all")
    assert first.values(ids) == pytest.approx(second.values(renumbered), abs=1e-9)
    assert first.covariance(ids) == pytest.approx(second.covariance(renumbered), rel=1e-6, abs=1e-12)


def test_splitting_a_batch_changes_nothing():
    system, ids, _, _, measured, (i, j) = trilateration()
    other, same, *_ = trilateration()
    other.problem._batches.clear()
    for part in np.array_split(np.arange(len(measured)), 7):
        other.add("Dist3D", {"p1": same[i[part]], "p2": same[j[part]]}, measured[part], 1e-3)
    first, second = system.solve(covariance="all"), other.solve(covariance="all")
    assert first.values(ids) == pytest.approx(second.values(same), abs=1e-10)
    assert first.sigma0 == pytest.approx(second.sigma0, rel=1e-9)


def observed_stations(seed=5, noise=1e-5):
    """Two stations whose orientation is unknown observe eight known points."""
    rng = np.random.default_rng(seed)
    system = LeastSquares()
    points = rng.uniform(-50.0, 50.0, (8, 3))
    centres = np.array([[1.0, 2.0, 3.0], [-9.0, 4.0, 1.0]])
    turns = exponential(rng.normal(0.0, 1.0, (2, 3)))
    known = system.add_points([f"P{k}" for k in range(8)], points)
    system.freeze(known)
    places = system.add_points(["S0", "S1"], centres + rng.normal(0.0, 1.0, (2, 3)))
    start = turns @ exponential(rng.normal(0.0, 0.2, (2, 3)))
    rotations = system.add_rotations(["S0", "S1"], start)
    station, target = np.repeat([0, 1], 8), np.tile(np.arange(8), 2)
    local = np.einsum("nji,nj->ni", turns[station], points[target] - centres[station])
    blocks = {
        "station.centre": places[station],
        "station.rotation": rotations[station],
        "target": known[target],
    }
    angles = np.arctan2(local[:, 0], local[:, 1]) + rng.normal(0.0, noise, 16)
    zenith = np.arctan2(np.hypot(local[:, 0], local[:, 1]), local[:, 2]) + rng.normal(0.0, noise, 16)
    lengths = np.linalg.norm(local, axis=1) + rng.normal(0.0, noise, 16)
    ends = {"origin": places[station], "target": known[target]}
    batches = [
        system.add("TopoHz", blocks, angles, 1e-5),
        system.add("TopoZen", blocks, np.column_stack([zenith, np.zeros(16)]), 1e-5),
        system.add("TopoDist", ends, lengths, 1e-5),
    ]
    return system, places, rotations, centres, turns, batches


def test_rotations_are_found_and_stay_rotations():
    system, places, rotations, centres, turns, batches = observed_stations()
    result = system.solve(covariance="all")
    assert result.converged
    assert 0.5 < result.sigma0 < 1.5
    assert result.values(places) == pytest.approx(centres, abs=2e-3)
    found = result.values(rotations)
    assert found == pytest.approx(turns, abs=1e-4)
    assert np.swapaxes(found, 1, 2) @ found == pytest.approx(np.tile(np.eye(3), (2, 1, 1)), abs=1e-14)
    gradient = sum(
        jacobian(system, batch).T @ (system.residuals(batch) / batch.sigmas**2).ravel() for batch in batches
    )
    free = ~system.unknowns.frozen
    scale = np.sqrt(
        sum(np.sum((jacobian(system, b) / b.sigmas.ravel()[:, None]) ** 2, axis=0) for b in batches)
    )
    assert np.abs(gradient[free] / scale[free]).max() < 1e-4


def test_the_precision_of_a_rotation_is_that_of_its_scatter():
    system, _, rotations, _, _, batches = observed_stations()
    predicted = system.solve(covariance="all").precisions(rotations, a_priori=True)
    truth, exact = system.values(rotations), [batch.observations.copy() for batch in batches]
    for values, batch in zip(exact, batches, strict=True):
        values[:, :1] += system.residuals(batch)
    rng, found = np.random.default_rng(8), []
    for _ in range(40):
        for values, batch in zip(exact, batches, strict=True):
            batch.observations = values + np.eye(1, values.shape[1]) * rng.normal(0.0, 1e-5, (16, 1))
        turned = np.swapaxes(truth, 1, 2) @ system.solve().values(rotations)
        found.append(np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1))
    ratio = np.std(found, axis=0) / predicted
    assert np.all((ratio > 0.65) & (ratio < 1.4))


def test_directions_move_on_the_sphere():
    system = LeastSquares()
    ids = system.add_directions(["d"], [[0.0, 0.0, 2.0]])
    assert system.values(ids) == pytest.approx(np.array([[0.0, 0.0, 1.0]]))
    context = system.unknowns.padded_context[:9].reshape(3, 3).copy()
    assert context @ context.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(context) == pytest.approx(1.0)
    system.unknowns.move(np.array([0.3, -0.4]))
    expected = context[0] + 0.3 * context[1] - 0.4 * context[2]
    assert system.values(ids)[0] == pytest.approx(expected / np.linalg.norm(expected), abs=1e-15)
    assert not system.unknowns.values.any()


def test_a_prior_is_an_observation_of_the_unknown():
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    batch = system.add_linear([x], [[[1.0]]], [10.0], 2.0)
    prior = system.add_prior(x, [[4.0]], 1.0)
    result = system.solve(covariance="all", sigma0_groups=["linear"])
    assert result.values(x)[0, 0] == pytest.approx((10.0 / 4.0 + 4.0) / 1.25)
    assert (result.n_observations, result.n_constraints, result.redundancy) == (1, 1, 1)
    assert result.prior_residuals(prior) == pytest.approx([5.2 - 4.0])
    assert result.squares == pytest.approx({"linear": (4.8 / 2.0) ** 2, "prior": 1.2**2})
    assert result.sigma0 == pytest.approx(4.8 / 2.0)
    assert result.variance_factor == pytest.approx(2.4**2 + 1.2**2)
    assert result.covariance(x, a_priori=True)[0, 0, 0] == pytest.approx(1.0 / 1.25)
    assert result.residuals(batch)[0, 0] == pytest.approx(-4.8)


def test_values_of_a_prior_may_be_given_anew():
    from obseq import InputError

    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    system.add_linear([x], [[[1.0]]], [10.0], 2.0)
    prior = system.add_prior(x, [[4.0]], 1.0)
    system.solve()
    prior.values = [6.0]
    result = system.solve()
    assert result.values(x)[0, 0] == pytest.approx((10.0 / 4.0 + 6.0) / 1.25)
    assert result.prior_residuals(prior) == pytest.approx([6.8 - 6.0])
    with pytest.raises(InputError, match="prior: values"):
        prior.values = [np.nan]


def test_an_infinite_sigma_leaves_a_component_without_prior():
    system = LeastSquares()
    point = system.add_points(["A"], [[0.0, 0.0, 0.0]])
    system.freeze(point, ("z",))
    system.add_prior(point, [[1.0, 2.0, 3.0]], [[1.0, 0.5, np.inf]])
    result = system.solve()
    assert result.values(point)[0] == pytest.approx([1.0, 2.0, 0.0])
    assert (result.n_constraints, result.redundancy, result.sigma0) == (2, 0, None)


def test_no_redundancy_has_no_sigma0_and_says_so():
    from obseq import InputError

    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    system.add_linear([x], [[[2.0]]], [10.0], 0.5)
    result = system.solve(covariance=True)
    assert (result.redundancy, result.sigma0, result.variance_factor) == (0, None, None)
    assert result.covariance(x, a_priori=True)[0, 0, 0] == pytest.approx(0.0625)
    with pytest.raises(InputError, match=r"redundancy 0.*a_priori"):
        result.covariance(x)


def test_with_every_unknown_frozen_the_residuals_remain():
    system, heights, batch = levelled_square()
    system.freeze(heights)
    result = system.solve(covariance="all")
    assert result.stop_reason is StopReason.NO_UNKNOWNS
    assert (result.redundancy, len(result.iterations)) == (5, 0)
    assert result.residuals(batch).ravel() == pytest.approx([-1.02, -2.01, 0.98, 2.02, -3.0])


def test_perfect_data_end_at_rounding():
    system, ids, _, points, *_ = trilateration(noise=1e-3)
    i, j = np.triu_indices(12, 1)
    system.batches[0].observations = np.linalg.norm(points[i] - points[j], axis=1)
    result = system.solve(max_iterations=30)
    assert result.converged
    assert result.sigma0 < 1e-8
    assert len(result.iterations) < 15
    assert result.values(ids) == pytest.approx(points, abs=1e-10)


def test_observations_may_follow_the_positions():
    """A correction that depends on the unknowns: x = 10 + x / 10 has the solution 100 / 9."""
    system = LeastSquares()
    x = system.add_scalars(["x"], [0.0])
    batch = system.add_linear([x[[0, 0]]], [[[1.0], [1.0]]], [0.0, 0.0], 1.0)
    calls = []

    def correct(current, iteration):
        calls.append(iteration)
        rows = batch.observations.copy()
        rows[:, 1] = [10.0, 10.0] + current.values(x)[0, 0] / 10.0
        batch.observations = rows

    result = system.solve(max_iterations=40, before_iteration=correct)
    assert result.values(x)[0, 0] == pytest.approx(100.0 / 9.0, rel=1e-9)
    assert result.residuals(batch) == pytest.approx(np.zeros((2, 1)), abs=1e-6)
    assert calls == list(range(len(result.iterations) + 1))


def test_progress_hears_of_each_iteration():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    heard = []
    result = system.solve(progress=heard.append)
    assert tuple(heard) == result.iterations


def test_divergence_names_the_observation_and_restores_the_last_accepted_state():
    system = LeastSquares()
    points = system.add_points(["A", "B"], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    system.freeze(points[:1])
    system.freeze(points[1:], ("y", "z"))
    system.add("Dist3D", {"p1": points[:1], "p2": points[1:]}, [0.0], 1.0, labels=["A B (f.obs:3)"])
    with pytest.raises(DivergenceError, match=r"A B \(f.obs:3\).*iteration 2.*last accepted"):
        system.solve()
    assert system.values(points[1:])[0] == pytest.approx([1.0, 0.0, 0.0])


def test_an_interruption_leaves_the_last_accepted_state():
    system, ids, *_ = trilateration()
    seen = []

    def interrupt(current, iteration):
        seen.append(current.values(ids).copy())
        if iteration == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        system.solve(before_iteration=interrupt)
    assert np.array_equal(system.values(ids), seen[-1])


def test_a_result_keeps_its_own_copy():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    result = system.solve()
    before = result.values(heights).copy()
    system.set_values(heights, np.full((4, 1), 7.0))
    assert np.array_equal(result.values(heights), before)


def test_freezing_between_two_solutions_changes_the_system():
    system, heights, _ = levelled_square()
    system.freeze(heights[:1])
    assert system.solve().n_unknowns == 3
    system.freeze(heights[2:3])
    assert system.solve().n_unknowns == 2
    system.unfreeze(heights[2:3])
    assert system.solve().n_unknowns == 3


def test_a_thousand_unknowns_added_one_by_one():
    system = LeastSquares()
    ids = np.concatenate([system.add_scalars([f"h{k}"], [0.0]) for k in range(1000)])
    ones = np.ones((999, 1))
    system.add_linear([ids[:-1], ids[1:]], [-ones, ones], np.full(999, 0.5), 0.01)
    system.freeze(ids[:1])
    assert system.solve().values(ids).ravel() == pytest.approx(0.5 * np.arange(1000))


@pytest.mark.slow
def test_sigma0_and_precisions_over_many_seeds():
    squares, scaled = [], []
    system, ids, _, points, *_ = trilateration(seed=3, n=7)
    i, j = np.triu_indices(7, 1)
    exact = np.linalg.norm(points[i] - points[j], axis=1)
    for seed in range(200):
        rng = np.random.default_rng(1000 + seed)
        system.batches[0].observations = exact + rng.normal(0.0, 1e-3, len(i))
        result = system.solve(covariance="all")
        squares.append(result.cost)
        precisions = result.precisions(ids, a_priori=True)
        free = precisions > 0.0
        scaled.append((result.values(ids) - points)[free] / precisions[free])
    redundancy = 21 - 15
    assert np.mean(squares) == pytest.approx(redundancy, abs=4.0 * np.sqrt(2.0 * redundancy / 200))
    assert np.var(squares) == pytest.approx(2.0 * redundancy, rel=0.5)
    assert np.std(scaled, axis=0) == pytest.approx(np.ones(15), abs=0.2)


def test_mixed_formulas_converge_to_a_point_where_the_gradient_vanishes():
    system, points, _, lengths, batches = mixed_system(9)
    system.problem._batches.remove(batches.pop())
    system.add_prior(points, system.values(points), 0.5)
    system.add_prior(lengths, system.values(lengths), 0.5)
    for batch in batches[:-1]:
        batch.observations = batch.observations + 0.9 * system.residuals(batch)
    result = system.solve(max_iterations=60)
    found = system.equations().assemble()
    scale = np.sqrt(found.values[system.equations().pattern.diagonal])
    assert result.converged
    assert np.abs(found.gradient / scale).max() < 1e-4 * np.sqrt(result.cost)
