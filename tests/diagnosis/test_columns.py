"""What the unknowns leave of columns: read from blocks of observations, from the inverse, or solved for."""

from dataclasses import replace

import numpy as np
import pytest

from obseq.diagnosis.columns import Columns, joint
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.selection import equals, exchanged, gains, inside, kept, merged, select
from obseq.leastsquares.sparse import Sparse

N, U = 24, 5
PAIRS = [np.array([2 * k, 2 * k + 1]) for k in range(N // 2)]


@pytest.fixture
def rows():
    return np.random.default_rng(5).normal(size=(N, U))


def linear_of(rows, residuals):
    """Observations of two equations each."""
    cofactors = np.linalg.inv(rows.T @ rows)
    taken = Sparse.of_blocks(np.array([rows[pair] @ cofactors @ rows[pair].T for pair in PAIRS]))
    solve, unit = cofactors.__matmul__, Sparse.of_diagonal(np.ones(N))
    return Linear(
        residuals, Sparse.of_dense(rows), unit, lambda: Sparse.of_dense(cofactors), taken, solve, N - U
    )


def left_of(rows):
    return np.eye(N) - rows @ np.linalg.solve(rows.T @ rows, rows.T)


def mixed_columns():
    """Of single equations, of both of an observation, of several observations, and of nothing."""
    made = np.zeros((N, 8))
    made[0, 0] = made[1, 1] = -1.0
    made[4:6, 2] = 0.6, -0.8
    made[4:6, 3] = 0.8, 0.6
    made[[2, 9], 4] = 0.6, 0.8
    made[[9, 20], 5] = -0.8, 0.6
    made[23, 7] = 1.0
    return made


@pytest.mark.parametrize("is_local", [True, False])
def test_products_are_those_of_dense_matrices_whichever_way_they_are_found(rows, is_local):
    dense = mixed_columns()
    columns = Columns(Sparse.of_dense(dense.T), np.full(8, is_local))
    linear = linear_of(rows, np.zeros(N))
    sets = np.array([[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [7, 4]])
    found = columns.grams(linear, sets)
    for own, gram in zip(sets, found, strict=True):
        assert gram == pytest.approx(dense[:, own].T @ left_of(rows) @ dense[:, own], abs=1e-12)


def test_products_of_sets_of_three_are_those_of_dense_matrices(rows):
    dense, linear = mixed_columns(), linear_of(rows, np.zeros(N))
    sets = np.array([[0, 1, 6], [1, 4, 5], [7, 3, 2]])
    for is_local in (True, False):
        columns = Columns(Sparse.of_dense(dense.T), np.full(8, is_local))
        for own, gram in zip(sets, columns.grams(linear, sets), strict=True):
            assert gram == pytest.approx(dense[:, own].T @ left_of(rows) @ dense[:, own], abs=1e-12)


def test_sets_that_change_one_observation_or_whose_unknowns_are_joined_take_no_solves(rows):
    dense, linear = mixed_columns(), linear_of(rows, np.zeros(N))
    sets = np.array([[0, 1], [2, 6], [0, 2], [4, 4], [7, 3]])
    apart, joined = (Columns(Sparse.of_dense(dense.T), np.full(8, local)) for local in (False, True))
    assert apart.are_near(linear, sets).tolist() == [True, True, False, False, False]
    assert joined.are_near(linear, sets).all()
    assert Columns(dense, np.zeros(8, bool)).are_near(linear, sets).all()  # plain arrays are solved already


@pytest.mark.parametrize("share", [1.0, 1e-3, 0.0])
def test_sets_of_two_are_judged_as_sets_of_three_with_nothing_in_the_third(share):
    rng = np.random.default_rng(11)
    roots = rng.normal(size=(20, 2, 2)) * [1.0, share]
    weights = roots @ roots.transpose(0, 2, 1)
    shown = np.einsum("gij,gj->gi", weights, rng.normal(size=(20, 2)))
    larger = np.zeros((20, 3, 3))
    larger[:, :2, :2] = weights
    two, three = joint(weights, shown, 1e-4), joint(larger, np.pad(shown, ((0, 0), (0, 1))), 1e-4)
    np.testing.assert_allclose(two[0], three[0], rtol=1e-9)
    assert set(two[1].tolist()) == ({2} if share == 1.0 else {1}) and np.array_equal(two[1], three[1])
    np.testing.assert_allclose(two[2], three[2][:, :2], rtol=1e-7, atol=1e-9)
    if share == 1.0:
        np.testing.assert_allclose(np.einsum("gij,gj->gi", weights, two[2]), shown)


def test_weights_that_cost_little_are_right_and_the_others_are_left_open(rows):
    dense = mixed_columns()
    linear, wanted = linear_of(rows, np.zeros(N)), np.diag(dense.T @ left_of(rows) @ dense)
    local = Columns(Sparse.of_dense(dense.T), np.ones(8, bool)).first_weights(linear)
    assert local == pytest.approx(wanted, abs=1e-12)
    far = Columns(Sparse.of_dense(dense.T), np.zeros(8, bool)).first_weights(linear)
    assert np.flatnonzero(np.isnan(far)).tolist() == [4, 5]
    seen = ~np.isnan(far)
    assert far[seen] == pytest.approx(wanted[seen], abs=1e-12)


def test_plain_arrays_give_the_same_products(rows):
    dense = mixed_columns()
    plain, linear = Columns(dense, np.ones(8, bool)), linear_of(rows, np.zeros(N))
    sets = np.array([[0, 1], [4, 5]])
    sparse = Columns(Sparse.of_dense(dense.T), np.ones(8, bool))
    dense_rows = Linear(
        linear.residuals, rows, np.eye(N), lambda: np.eye(U), linear.taken, linear.solve, linear.redundancy
    )
    assert plain.grams(dense_rows, sets) == pytest.approx(sparse.grams(linear, sets))
    assert plain.first_weights(dense_rows) == pytest.approx(sparse.first_weights(linear))
    assert plain.norms() == pytest.approx(sparse.norms())


def test_what_is_left_of_vectors_is_orthogonal_to_the_unknowns(rows):
    linear = linear_of(rows, np.zeros(N))
    many = np.random.default_rng(1).normal(size=(N, 130))  # more than are solved together
    assert linear.left(many) == pytest.approx(left_of(rows) @ many)
    assert linear.left(many[:, 0]) == pytest.approx(left_of(rows) @ many[:, 0])


def weighed(rows, residuals, **policy):
    """Pairs, single equations of the first of them, and all of the first four pairs as a block."""
    hypotheses = Hypotheses(
        [
            Family("T1", 2 * np.arange(N // 2 + 1), np.arange(N), is_start=True),
            Family.alone("T2", np.arange(4)),
            Family("T3", np.array([0, 8]), np.arange(8), rarity=5.0, is_block=True),
        ]
    )
    columns = Columns(Sparse.of_dense(-np.eye(N)), np.ones(N, bool))
    return LinearTests(linear_of(rows, residuals), columns, hypotheses, replace(POLICY, **policy))


def taken_by(rows, residuals, own):
    whole = np.hstack([rows, np.eye(N)[:, own]])
    before, after = (
        np.sum((residuals - a @ np.linalg.lstsq(a, residuals, rcond=None)[0]) ** 2) for a in (rows, whole)
    )
    return before - after


def test_statistics_of_pairs_are_what_both_equations_take(rows):
    residuals = np.random.default_rng(2).normal(size=N)
    tests = weighed(rows, residuals)
    found = tests.tests(tests.given(()))
    for k, pair in enumerate(PAIRS):
        assert found.statistic[k] == pytest.approx(taken_by(rows, residuals, pair)), k
        assert found.limit[k] == tests.limit(2) and found.noise[k] == 2.0
    for k in range(4):
        assert found.statistic[N // 2 + k] == pytest.approx(taken_by(rows, residuals, [k])), k
        assert found.limit[N // 2 + k] == tests.limit(1) and found.noise[N // 2 + k] == 1.0


def test_a_pair_of_which_one_direction_is_controlled_has_one_degree_of_freedom(rows):
    rows = np.hstack([rows, np.eye(N)[:, [0]]])  # an unknown of the first equation alone
    residuals = np.random.default_rng(2).normal(size=N)
    tests = weighed(rows, residuals)
    found = tests.tests(tests.given(()))
    assert found.statistic[0] == pytest.approx(taken_by(rows, residuals, [1]))
    assert found.limit[0] == tests.limit(1) and tests.rank(0) == 1


def test_what_several_take_together_is_that_of_all_their_columns(rows):
    residuals = np.random.default_rng(3).normal(size=N)
    tests = weighed(rows, residuals)
    for chosen in ([0], [0, 3], [0, N // 2], [N // 2 + 4]):
        own = sorted({k for i in chosen for k in tests.hypotheses.of(i).tolist()})
        assert tests.took(chosen) == pytest.approx(taken_by(rows, residuals, own)), chosen
        left = tests.cost - tests.took(chosen)
        assert tests.price(chosen) == pytest.approx(left + tests.due(chosen))
    assert tests.took([]) == 0.0


def test_what_is_due_is_the_limit_of_each_its_noise_and_its_rarity(rows):
    tests = weighed(rows, np.zeros(N))
    block = N // 2 + 4
    assert tests.due([0]) == pytest.approx(tests.limit(2) + 2.0)
    assert tests.due([block]) == pytest.approx(tests.limit(8) + 8.0 + 5.0)
    assert tests.due([0, block]) == pytest.approx(tests.due([0]) + tests.due([block]))
    before = tests.due([block])
    tests.scale = 3.0
    assert tests.due([block]) == pytest.approx(3.0 * before)


def test_blocks_are_tested_where_most_of_their_rows_are_off_and_they_are_not_too_large(rows):
    residuals = np.random.default_rng(4).normal(size=N)
    residuals[:8] += 40.0 * np.array([1, -1, 1, 1, -1, 1, -1, -1])
    block = N // 2 + 4
    tests = weighed(rows, residuals)
    assert tests.tests(tests.given(())).statistic[block] == pytest.approx(
        taken_by(rows, residuals, np.arange(8))
    )
    assert tests.tests(tests.given(()), blocks=False).statistic[block] == 0.0
    few = weighed(rows, residuals, columns=7)
    assert few.tests(few.given(())).statistic[block] == 0.0
    quiet = weighed(rows, np.random.default_rng(4).normal(size=N))
    assert quiet.tests(quiet.given(())).statistic[block] == 0.0


def test_special_cases_of_a_pair_are_its_single_equations(rows):
    tests = weighed(rows, np.zeros(N))
    assert tests.within([0], 0).tolist() == [N // 2, N // 2 + 1]
    assert tests.within([0, 3], 3).tolist() == []


def planted(rows, errors):
    residuals = 0.5 * np.random.default_rng(6).normal(size=N)
    for row, size in errors.items():
        residuals[row] += size
    return residuals


@pytest.mark.parametrize("first", [(), (0,), (5, 7)])
def test_selection_ends_at_what_is_wrong_wherever_it_begins(rows, first):
    tests = weighed(rows, planted(rows, {10: 30.0, 11: -25.0, 20: 40.0, 21: 35.0}))
    assert sorted(select(tests, first)) == [5, 10]


def test_one_equation_is_told_in_place_of_its_pair_where_the_other_is_right(rows):
    tests = weighed(rows, planted(rows, {2: 30.0}))
    assert select(tests) == [N // 2 + 2]
    both = weighed(rows, planted(rows, {2: 30.0, 3: 30.0}))
    assert select(both) == [1]
    assert select(both, rows_only=True) == [1]


def test_most_of_a_block_is_told_as_the_block(rows):
    errors = {k: 40.0 * (-1) ** (k // 3) for k in range(8)}
    tests = weighed(rows, planted(rows, errors))
    block = N // 2 + 4
    assert merged(tests, [0, 1, 2, 3]) == [block]
    assert merged(tests, [0, 1, 2, 3, 9]) == [9, block]
    assert merged(tests, [0, 1]) == [0, 1]  # half of it is no whole
    assert merged(tests, [0]) == [0]
    assert sorted(inside(tests, [0, 2, 7], block)) == [0, 2]


def test_what_is_not_worth_its_price_is_dropped_the_least_first(rows):
    tests = weighed(rows, planted(rows, {10: 30.0}))
    assert kept(tests, [5, 8, 9]) == [5]
    assert kept(tests, []) == []


def test_an_exchange_finds_the_right_one(rows):
    tests = weighed(rows, planted(rows, {10: 30.0, 11: 30.0}))
    assert exchanged(tests, [8]) == [5]
    assert exchanged(tests, [5]) == [5]


def test_equals_are_what_explains_as_much_and_nothing_that_holds_it(rows):
    tests = weighed(rows, planted(rows, {2: 30.0}))
    single, pair = N // 2 + 2, 1
    found = tests.tests(tests.given(()))
    assert equals(tests, found, single) == []  # its pair holds it and more
    assert equals(tests, found, pair)[0] == single
    gain = gains(tests, found)
    assert gain[single] == pytest.approx(found.statistic[single] - found.limit[single] - 1.0)
    is_low = found.statistic < found.limit
    assert is_low.any() and np.isneginf(gain[is_low]).all()


def test_sizes_and_their_deviations_are_those_of_the_enlarged_model(rows):
    residuals = planted(rows, {10: 30.0, 11: -25.0})
    tests = weighed(rows, residuals)
    sizes = tests.sizes([5])
    whole = np.hstack([rows, -np.eye(N)[:, 10:12]])
    wanted = -np.linalg.lstsq(whole, residuals, rcond=None)[0][U:]
    spread = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)))[U:]
    assert np.abs(sizes[5][0]) == pytest.approx(np.abs(wanted))
    assert sizes[5][1] == pytest.approx(spread)
    assert tests.sizes([]) == {}


def test_one_row_takes_the_place_of_several_that_hide_it(rows):
    own = np.zeros((N, 3))
    own[:6] = np.random.default_rng(8).normal(size=(6, 3))  # unknowns that six rows see: three spare ones
    rows = np.hstack([rows, own])
    hypotheses = Hypotheses([Family.alone("T1", np.arange(N), is_start=True)])
    columns = Columns(Sparse.of_dense(-np.eye(N)), np.ones(N, bool))
    linear = linear_of(rows, planted(rows, {4: 400.0, 15: 50.0}))
    tests = LinearTests(linear, columns, hypotheses, POLICY)
    assert sorted(tests.one_for_several([0, 1, 2, 15])) == [4, 15]
    assert tests.one_for_several([4, 15]) == [4, 15]
