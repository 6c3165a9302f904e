"""Reliability against dense algebra, true refits, and the distributions that the statistics must have."""

import numpy as np
import pytest

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.hypothesis_tests import non_centrality, normal_critical, tau_critical
from obseq.leastsquares.statistics.reliability import reliability

CORNERS = np.array(
    [[0, 0, 0], [100, 0, 5], [100, 80, 0], [0, 80, 8], [50, 40, 30], [20, 60, 15], [70, 10, 12]], dtype=float
)


def trilateration(seed=1, sigma=0.01, blunder=None):
    """Seven points, all distances between them, a sub-frame with its vectors, and priors on three points."""
    system = obseq.LeastSquares()
    points = system.add_points([f"P{k}" for k in range(len(CORNERS))], CORNERS)
    rotation = system.add_rotations(["S"], np.eye(3)[None])
    i, j = np.triu_indices(len(CORNERS), 1)
    distances = system.add("Dist3D", {"p1": points[i], "p2": points[j]}, np.zeros(len(i)), sigma)
    vectors = system.add(
        "TopoSubFrame",
        {"frame": rotation, "p1": points[:1], "p2": points[1:]},
        np.zeros((6, 3)),
        np.array([1.0, 2.0, 3.0]) * sigma * np.ones((6, 1)),
    )
    prior = system.add_prior(points[:3], CORNERS[:3], 0.02)
    network = system, points, distances, vectors, prior
    draw(network, seed, sigma, blunder)
    return network


def draw(network, seed, sigma=0.01, blunder=None):
    """Gives a trilateration the starts and the observations of a seed."""
    system, points, distances, vectors, prior = network
    rng = np.random.default_rng(seed)
    system.set_values(points, CORNERS + rng.normal(0, 0.05, CORNERS.shape))
    system.set_values(system.ids(["S"], "Rotation"), np.eye(3)[None])
    i, j = np.triu_indices(len(CORNERS), 1)
    measured = np.linalg.norm(CORNERS[i] - CORNERS[j], axis=1) + rng.normal(0, sigma, len(i))
    if blunder is not None:
        measured[blunder[0]] += blunder[1]
    distances.observations = measured
    vectors.observations = CORNERS[1:] - CORNERS[0] + rng.normal(0, sigma, (6, 3)) * [1, 2, 3]
    prior.values = (CORNERS[:3] + rng.normal(0, 0.02, (3, 3))).ravel()


def dense(system, parts):
    """The whole weighted Jacobian of some batches."""
    from obseq.leastsquares.assembly.evaluation import jacobian_rows

    table, rows = system.unknowns, []
    for part in parts:
        m, u = part.shape.n_residuals, part.shape.n_unknowns
        derivatives = jacobian_rows(table, part)[m:].reshape(m, u, part.n)
        for k in range(part.n):
            roles = zip(part.shape.roles, part.blocks, strict=True)
            columns = np.concatenate([table.start[ids[k]] + np.arange(role.size) for role, ids in roles])
            for r in range(m):
                row = np.zeros(table.n_scalars)
                np.add.at(row, columns, derivatives[r, :, k] * part.weights[r, k])
                rows.append(row)
    return np.array(rows)


def prior_rows(system, prior):
    rows = np.zeros((prior.n_scalars, system.unknowns.n_scalars))
    rows[np.arange(prior.n_scalars), prior.scalars] = prior.weights
    return rows


def hat_matrix(system, batches, prior):
    A = np.vstack([dense(system, batches), prior_rows(system, prior)])
    free = ~system.unknowns.frozen
    return A[:, free] @ np.linalg.solve(A[:, free].T @ A[:, free], A[:, free].T)


def test_redundancy_numbers_are_those_of_dense_algebra():
    system, points, distances, vectors, prior = trilateration()
    system.freeze(points[1], ["y"])
    result = system.solve(covariance=True)
    quality = reliability(system, result)
    expected = 1.0 - np.diag(hat_matrix(system, [distances, vectors], prior))
    found = np.concatenate([quality.of(part).redundancy.ravel() for part in (distances, vectors, prior)])
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert quality.sum_of_redundancy_numbers == pytest.approx(result.redundancy, abs=1e-9)


def test_residual_vectors_have_the_covariance_of_dense_algebra():
    system, _, distances, vectors, prior = trilateration()
    result = system.solve(covariance=True)
    H = hat_matrix(system, [vectors, distances], prior)
    found = reliability(system, result).residual_cofactors(vectors)
    for k in range(vectors.n):
        at = slice(3 * k, 3 * k + 3)
        expected = (np.eye(3) - H[at, at]) * np.outer(vectors.sigmas[k], vectors.sigmas[k])
        np.testing.assert_allclose(found[k], expected, atol=1e-12)
    assert np.abs(found[:, 0, 1]).max() > 1e-7  # the test would not see a missing cross term otherwise


def test_a_block_in_two_arguments_and_frozen_parts_are_counted_once():
    system = obseq.LeastSquares()
    a, b = system.add_vectors(["a", "b"], np.zeros((2, 2)))
    rng = np.random.default_rng(3)
    left, right, y = rng.normal(size=(9, 2)), rng.normal(size=(9, 2)), rng.normal(size=9)
    second = np.where(np.arange(9) < 4, a, b)
    rows = system.add_linear([[a] * 9, second], [left, right], y, 0.5)
    system.freeze([b], [1])
    result = system.solve(covariance=True)
    A = np.zeros((9, 4))
    A[:, :2] = left
    A[:4, :2] += right[:4]
    A[4:, 2:] = right[4:]
    A = A[:, :3]
    H = A @ np.linalg.solve(A.T @ A, A.T)
    quality = reliability(system, result)
    np.testing.assert_allclose(quality.of(rows).redundancy[:, 0], 1 - np.diag(H), atol=1e-12)
    assert quality.sum_of_redundancy_numbers == pytest.approx(6, abs=1e-12)


def test_inactive_observations_have_no_numbers_and_no_share():
    system, points, *_ = trilateration()
    active = np.array([True, False, True])
    more = system.add(
        "Dist3D", {"p1": points[:3], "p2": points[3:6]}, [128.0, 64.0, 53.0], 0.05, active=active
    )
    quality = reliability(system, system.solve(covariance=True, tolerance=1e-10))
    assert np.isnan(quality.of(more).redundancy[1, 0])
    assert np.isnan(quality.of(more).w[1, 0])
    assert quality.sum_of_redundancy_numbers == pytest.approx(quality.redundancy, abs=1e-9)


def test_an_uncontrolled_observation_is_named():
    system = obseq.LeastSquares()
    a, b = system.add_scalars(["a", "b"], [0.0, 0.0])
    rows = system.add_linear(
        [[a, a, b]], [[[1.0], [1.0], [1.0]]], [1.0, 3.0, 5.0], 0.1, labels=["first", "second", "alone"]
    )
    quality = reliability(system, system.solve(covariance=True))
    assert quality.uncontrolled() == ("linear alone",)
    part = quality.of(rows)
    np.testing.assert_allclose(part.redundancy[:, 0], [0.5, 0.5, 0.0], atol=1e-15)
    assert np.isnan(part.w[2, 0])
    assert np.isinf(part.detectable[2, 0])
    assert quality.n_tests == 2
    # residual +1 at the first, -1 at the second (computed 2), sigma of each residual 0.1 sqrt(0.5)
    np.testing.assert_allclose(part.w[:2, 0], np.array([1.0, -1.0]) / (0.1 * np.sqrt(0.5)))
    np.testing.assert_allclose(part.left_out_residuals[:2, 0], [2.0, -2.0])
    with pytest.raises(InputError, match="nothing controls"):
        quality.effect_of_bias(rows, 2)
    with pytest.raises(InputError, match="linear alone: without this observation"):
        quality.left_out(rows, 2)


@pytest.mark.slow
def test_detectable_bias_is_found_with_the_stated_power():
    level, power = 0.01, 0.8
    network = system, _, distances, *_ = trilateration()
    part = reliability(system, system.solve(covariance=True), level, power).of(distances)
    row = int(np.argmin(part.redundancy[:, 0]))
    response = _response(network, row)
    assert np.linalg.norm(response) == pytest.approx(1.0, abs=1e-3)  # of a standard normal w
    plain = np.random.default_rng(0).standard_normal((4000, len(response))) @ response
    biased = plain + response[row] * part.detectable[row, 0] / part.sigmas[row, 0]
    for w, share in ((plain, level), (biased, power)):
        rejected = np.mean(np.abs(w) > normal_critical(level))
        assert abs(rejected - share) < 3 * np.sqrt(share * (1 - share) / len(w))


def _response(network, row):
    """(48,) what errors of one sigma of distances, vectors and priors do to w of a distance: it is linear."""
    system, _, distances, vectors, prior = network
    draw(network, 1, sigma=0.0)
    prior.values = CORNERS[:3].ravel()
    batches = [(part, part.observations.copy(), part.sigmas) for part in (distances, vectors)]
    exact = [*batches, (prior, prior.values.copy(), 1.0 / prior.weights)]
    columns = []
    for part, values, sigmas in exact:
        name = "values" if part is prior else "observations"
        for place in np.ndindex(values.shape):
            changed = values.copy()
            changed[place] += sigmas[place]
            setattr(part, name, changed)
            columns.append(reliability(system, system.solve(covariance=True)).of(distances).w[row, 0])
        setattr(part, name, values)
    return np.array(columns)


def test_effect_of_a_bias_is_that_of_a_changed_observation():
    system, points, distances, *_ = trilateration(sigma=1e-5)
    result = system.solve(covariance=True)
    quality = reliability(system, result)
    change = quality.change_of(points, quality.effect_of_bias(distances, 4, bias=1e-3))
    before = result.values(points)
    observations = distances.observations.copy()
    observations[4] += 1e-3
    distances.observations = observations
    np.testing.assert_allclose(
        system.solve().values(points) - before, change, atol=1e-3 * np.abs(change).max()
    )
    detectable = quality.of(distances).detectable[4, 0]
    np.testing.assert_allclose(
        quality.change_of(points, quality.effect_of_bias(distances, 4)),
        change * detectable / 1e-3,
        atol=1e-12,
    )


def test_external_reliability_is_the_length_of_the_effect():
    system, *_, vectors, prior = trilateration()
    result = system.solve(covariance=True)
    quality = reliability(system, result)
    change = quality.effect_of_bias(vectors, 2, component=1)
    values = system.equations().assemble().values.copy()
    N = system.equations().pattern.matrix(values).toarray()
    free = change[system.equations().free.scalars]
    assert np.sqrt(free @ N @ free) == pytest.approx(quality.of(vectors).external[2, 1], rel=1e-6)
    assert quality.of(prior).external.shape == (9, 1)


def test_left_out_without_refit_equals_the_refit():
    system, points, distances, vectors, _ = trilateration(sigma=1e-4)
    result = system.solve(covariance=True, tolerance=1e-9)
    quality = reliability(system, result)
    for batch, row in ((distances, 7), (vectors, 3)):
        left = quality.left_out(batch, row)
        batch.active[row] = False
        weights = batch.weights[:, row].copy()
        batch.weights[:, row] = 0.0
        refit = system.solve(tolerance=1e-9)
        scale = np.abs(left.residuals).max()
        np.testing.assert_allclose(refit.residuals(batch)[row], left.residuals, atol=1e-4 * scale)
        change = quality.change_of(points, left.change)
        np.testing.assert_allclose(
            refit.values(points) - result.values(points), change, atol=1e-3 * np.abs(change).max()
        )
        assert refit.cost == pytest.approx(left.cost, rel=1e-4)
        batch.active[row], batch.weights[:, row] = True, weights
        system.solve(tolerance=1e-9)
    scalar = quality.of(distances).left_out_residuals[7, 0]
    assert scalar == pytest.approx(quality.left_out(distances, 7).residuals[0], rel=1e-9)


@pytest.mark.slow
def test_w_and_tau_have_their_distributions():
    level, w_over, tau_over, n = 0.05, 0, 0, 0
    network = system, _, distances, vectors, _ = trilateration()
    for seed in range(150):
        draw(network, seed)
        quality = reliability(system, system.solve(covariance=True))
        for part in (quality.of(distances), quality.of(vectors)):
            w_over += np.count_nonzero(np.abs(part.w) > normal_critical(level))
            tau_over += np.count_nonzero(np.abs(part.tau) > tau_critical(level, quality.redundancy))
            n += part.w.size
            np.testing.assert_array_equal(
                part.tau_p_values < level, np.abs(part.tau) > tau_critical(level, quality.redundancy)
            )
    assert n == 150 * 39
    assert abs(w_over / n - level) < 0.012
    assert abs(tau_over / n - level) < 0.012


def test_tables_have_labels_and_numbers():
    system, _, distances, _, prior = trilateration()
    quality = reliability(system, system.solve(covariance=True))
    columns = quality.of(distances).columns()
    assert columns["observation"][1] == "Dist3D P0 -> P2 (row 1)"
    assert columns["w"][1] == quality.of(distances).w[1, 0]
    assert {len(column) for column in columns.values()} == {21}
    assert quality.of(prior).columns()["observation"][2] == "prior of P0.z"
    assert quality.to_dict()["observations"][0]["group"] == "Dist3D"


def test_errors_say_what_is_missing():
    system, points, *_ = trilateration()
    with pytest.raises(InputError, match="covariance=True"):
        reliability(system, system.solve())
    result = system.solve(covariance=True)
    system.freeze(points[:1])
    with pytest.raises(InputError, match="since this result"):
        reliability(system, result)
    assert non_centrality(0.001, 0.80) == pytest.approx(4.13, abs=0.005)


@pytest.mark.slow
def test_hundreds_of_thousands_of_observations():
    rng = np.random.default_rng(0)
    side, repeats = 40, 40
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    heights = rng.normal(0, 1.0, side * side)  # as uneven as wide: few iterations
    grid = np.column_stack([x.ravel(), y.ravel(), heights]).astype(float)
    number = np.arange(side * side).reshape(side, side)
    steps = [(1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2)]
    pairs = [(number[max(0, -b) :, :][: side - abs(b), : side - a], a, b) for a, b in steps]
    i = np.concatenate([part.ravel() for part, _, _ in pairs])
    j = np.concatenate([(part + b * side + a).ravel() for part, a, b in pairs])
    i, j = np.tile(i, repeats), np.tile(j, repeats)
    system = obseq.LeastSquares()
    points = system.add_points([str(k) for k in range(side * side)], grid)
    true = np.linalg.norm(grid[i] - grid[j], axis=1)
    batch = system.add("Dist3D", {"p1": points[i], "p2": points[j]}, true + rng.normal(0, 1e-3, len(i)), 1e-3)
    system.add_prior(points, grid, 1e-2)
    result = system.solve(covariance=True, tolerance=1e-2)  # redundancies do not ask for more
    assert result.converged
    assert len(i) > 360_000
    quality = reliability(system, result)
    assert quality.sum_of_redundancy_numbers == pytest.approx(result.redundancy, rel=1e-9)
    assert quality.of(batch).redundancy.min() > 1 - 1 / repeats  # of n alike, none says more than an nth


def test_robust_weights_count_and_outliers_stand_out():
    from obseq.leastsquares.problem.losses import Tukey

    system, _, distances, *_ = trilateration(blunder=(7, 0.5))
    plain = reliability(system, system.solve(covariance=True))
    distances.loss = Tukey(5.0)
    result = system.solve(max_iterations=60, covariance=True, tolerance=1e-10)
    assert distances.robust_weights()[7] == 0.0
    quality = reliability(system, result)
    assert quality.sum_of_redundancy_numbers == pytest.approx(result.redundancy, abs=1e-6)
    part = quality.of(distances)
    assert abs(part.w[7, 0]) > 20 > np.abs(np.delete(part.w[:, 0], 7)).max() * 4
    assert part.w[7, 0] == pytest.approx(plain.of(distances).w[7, 0], rel=0.05)
    assert -part.left_out_residuals[7, 0] == pytest.approx(0.5, abs=0.06)
    assert part.external[7, 0] == 0.0
    np.testing.assert_array_equal(quality.effect_of_bias(distances, 7, bias=1.0), 0.0)
    left = quality.left_out(distances, 7)
    np.testing.assert_allclose(left.residuals, result.residuals(distances)[7])
    # the variance of its residual is its own and that of the distance computed from the others
    i, j = distances.blocks[:, 7]
    shift = np.diff(result.values([i, j]), axis=0)[0]
    along = np.concatenate([-shift, shift]) / np.linalg.norm(shift)
    computed = along @ result.covariance_between([i, j], [i, j], a_priori=True) @ along
    assert quality.residual_cofactors(distances)[7, 0, 0] == pytest.approx(0.01**2 + computed, rel=1e-6)
    assert part.w[7, 0] == pytest.approx(
        result.residuals(distances)[7, 0] / np.sqrt(0.01**2 + computed), rel=1e-6
    )


def test_weights_that_changed_since_are_refused():
    system, _, distances, *_ = trilateration()
    result = system.solve(covariance=True)
    distances.weights *= 2.0
    with pytest.raises(InputError, match="weights or sigmas have changed"):
        reliability(system, result)


def test_eliminated_unknowns_and_hard_constraints_keep_the_sum():
    system, points, distances, *_ = trilateration()
    plain = reliability(system, system.solve(covariance=True, tolerance=1e-10))
    system.eliminate(points[4:5])
    reduced = reliability(system, system.solve(covariance=True, tolerance=1e-10))
    np.testing.assert_allclose(reduced.of(distances).redundancy, plain.of(distances).redundancy, atol=1e-9)
    system.eliminate(points[4:5], False)
    system.share(points[[0, 1]], ["z"])
    result = system.solve(covariance=True, tolerance=1e-10)
    shared = reliability(system, result)
    assert shared.redundancy == plain.redundancy + 1
    assert shared.sum_of_redundancy_numbers == pytest.approx(result.redundancy, abs=1e-8)
    left = shared.left_out(distances, 3)
    change = shared.change_of(points[:2], left.change)
    assert change[0, 2] == pytest.approx(change[1, 2], abs=1e-12)


def test_a_datum_changes_no_redundancy_number():
    system, points, distances, *_ = trilateration()
    free = obseq.LeastSquares()
    names = [f"P{k}" for k in range(len(CORNERS))]
    ids = free.add_points(names, system.values(points))
    batch = free.add(
        "Dist3D", {"p1": distances.blocks[0], "p2": distances.blocks[1]}, distances.observations, 0.01
    )
    qualities = []
    for datum in (ids, ids[:3]):
        free.set_datum(datum)
        result = free.solve(covariance=True, tolerance=1e-10)
        quality = reliability(free, result)
        assert result.redundancy == 21 - 21 + 6
        assert quality.sum_of_redundancy_numbers == pytest.approx(6, abs=1e-7)
        qualities.append(quality.of(batch))
    np.testing.assert_allclose(qualities[0].redundancy, qualities[1].redundancy, atol=1e-7)
    np.testing.assert_allclose(qualities[0].w, qualities[1].w, rtol=1e-4)
