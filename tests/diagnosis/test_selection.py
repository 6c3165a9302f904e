"""What explains a model best, against the dearest way to find it: trying everything."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from linear_model import BLOCK, Linearly, N, U, rows_of

from obseq.diagnosis.explanation import Explanation, better, with_equals
from obseq.diagnosis.hypotheses import Family
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.selection import for_a_slip, gains, is_less, merged, select

ROWS = Family.alone("T1", np.arange(N), is_start=True)
PAIRS = Family("T2", 2 * np.arange(11), np.arange(20))


def weighed(matrix, noise, *families, policy=POLICY):
    model = Linearly(matrix, noise, families)
    return LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, policy)


def block(count, first=0, **about):
    return Family(BLOCK, np.array([0, count]), np.arange(first, first + count), is_block=True, **about)


@pytest.mark.parametrize("seed", range(6))
def test_no_two_hypotheses_cost_less_than_those_that_are_selected(seed):
    rng = np.random.default_rng(seed)
    matrix, noise = rows_of(30 + seed)
    noise[rng.choice(N, 2, replace=False)] += rng.choice([-1.0, 1.0], 2) * rng.uniform(7.0, 30.0, 2)
    if seed % 2:
        noise[4:6] += rng.uniform(8.0, 20.0, 2)  # a pair
    tests = weighed(matrix, noise, ROWS, PAIRS)
    found = select(tests)
    some = [i for i in range(N + 10) if np.abs(tests.off[tests.hypotheses.of(i)]).max() > 3.0]
    dearest = [c for k in range(4) for c in combinations(some, k)]
    assert tests.price(found) <= min(tests.price(list(c)) for c in dearest) + 1e-6


def test_a_block_that_costs_more_than_its_rows_does_not_take_their_place():
    matrix, noise = rows_of(7)
    noise[:3] += 60.0, -60.0, 60.0
    cheap, dear = (weighed(matrix, noise, ROWS, block(4, rarity=rarity)) for rarity in (5.0, 60.0))
    assert merged(cheap, [0, 1, 2]) == [N] and merged(dear, [0, 1, 2]) == [0, 1, 2]
    assert merged(weighed(matrix, noise, ROWS, block(4, needs_slip=True)), [0, 1, 2]) == [0, 1, 2]


def test_blocks_are_tested_only_where_their_own_rows_are_off():
    matrix, noise = rows_of(7)
    noise[20:28] += 15.0 * (-1.0) ** np.arange(8)
    tests = weighed(matrix, noise, ROWS, block(8), block(8, first=20))
    statistic = tests.tests(tests.given(())).statistic
    assert statistic[N] == 0.0 and statistic[N + 1] > 100.0


def test_a_slip_is_looked_for_where_a_block_makes_others_needless_and_costs_less():
    matrix, noise = rows_of(7)
    noise[:3] += 60.0, -60.0, 60.0
    noise[30] += 50.0
    tests = weighed(matrix, noise, ROWS, block(3, needs_slip=True), block(3, first=20), block(1, first=1))
    assert for_a_slip(tests, [0, 1, 2, 30]) == [[30, N]]
    assert for_a_slip(tests, [N, 30]) == []
    assert for_a_slip(tests, [30]) == [] == for_a_slip(tests, [])


def test_prices_that_differ_by_rounding_are_equal():
    assert is_less(1.0, 1.1) and not is_less(1.1, 1.0) and not is_less(1.0, 1.0)
    for price in (1e12, -1e12):
        assert not is_less(price - 1e-4 * abs(price) ** 0.5, price) and is_less(
            price - 1e-3 * abs(price), price
        )


def explanation(price, tests=None, chosen=()):
    return Explanation(price, tests, chosen, None)


def test_the_better_of_two_explanations_is_the_cheaper_and_of_equals_the_first():
    first, other = explanation(100.0), explanation(90.0)
    assert better(first, other) is other and better(other, first) is other
    assert better(None, other) is other and better(other, None) is other and better(None, None) is None
    for price, step in ((1e6, 0.5), (-1e6, 0.5), (0.0, 5e-7)):
        first, other = explanation(price), explanation(price - step)
        assert better(first, other) is first
        assert better(first, explanation(price - 10.0 * step)) is not first


def test_explanations_by_one_error_that_cost_nearly_the_same_are_told_together():
    matrix, noise = rows_of(8)
    matrix[:, 5] = 0.0
    matrix[[30, 31], 5] = 1.0  # an unknown that two rows alone see: each controls the other
    noise[30] += 1e3
    tests = weighed(matrix, noise, ROWS)
    price = tests.price([30])
    found = [
        explanation(price, tests, (30,)),
        explanation(price + 0.5 * POLICY.margin, tests, (31,)),
        explanation(price + 0.5 * POLICY.margin, tests, (30,)),  # the same again
        explanation(price, tests, (31, 4)),
        explanation(price + 1.5 * POLICY.margin, tests, (12,)),
    ]
    best = with_equals(found, POLICY)
    assert best.chosen == (30,) and best.price == price
    ((change, took),) = best.same
    assert change.index == 31 and took == pytest.approx(tests.took([31]))
    assert change.size == pytest.approx(tests.sizes([31])[31][0])
    assert with_equals(found[3:] + found[:1], POLICY).same == ()


def test_no_more_are_selected_than_may_be_told():
    matrix, noise = rows_of(7)
    noise[[3, 9, 14, 22, 35]] += 60.0
    tests = weighed(matrix, noise, ROWS, policy=replace(POLICY, most=4))
    assert len(select(tests)) == 4 and len(select(tests, most=2)) == 2
    assert sorted(select(tests, [3, 9, 14, 22, 35])) == [3, 9, 14, 22, 35]


def test_what_a_hypothesis_gains_is_what_it_takes_beyond_what_is_due_for_it():
    matrix, noise = rows_of(7)
    noise[:8] -= 80.0
    model = Linearly(matrix, noise)
    tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
    for scale in (1.0, 2.0):
        tests.scale = scale
        gain = gains(tests, tests.tests(tests.given(())))
        assert gain[N] == pytest.approx(tests.price([]) - tests.price([N]))
