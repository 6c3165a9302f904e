"""What the search tells of linear models, and when: slips, kinds that are off, iterations, small effects."""

from dataclasses import replace

import numpy as np
import pytest
from linear_model import BLOCK, DRIFT, Linearly, N, U, rows_of

from obseq.diagnosis.engine import Search, _stands_out, diagnose
from obseq.diagnosis.explanation import Explanation
from obseq.diagnosis.hypotheses import Family
from obseq.diagnosis.judgement import noise as variance
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Slip
from obseq.diagnosis.verdict import Status

ROWS = Family.alone("T1", np.arange(N), is_start=True)
RIGHT_NAME = Slip("W1", "point 7 instead of 8", 0.4, is_strong=True)


def named(count, **about):
    """Rows, and the first of them as a block that is told only with a slip."""
    about = {"rarity": 8.0, "is_block": True, "needs_slip": True} | about
    return ROWS, Family(BLOCK, np.array([0, count]), np.arange(count), **about)


@pytest.mark.parametrize("count", [2, 3, 8])
def test_a_wrong_name_is_told_in_place_of_its_rows_where_a_slip_explains_it(count):
    matrix, noise = rows_of(7)
    noise[:count] += 60.0 * (-1.0) ** np.arange(count)
    model = Linearly(matrix, noise, named(count))
    assert sorted(one.change.index for one in diagnose(model).accused) == list(range(count))
    model.known[N] = RIGHT_NAME
    (one,) = diagnose(model).accused
    assert one.change.index == N and one.slips == (RIGHT_NAME,)
    assert len(one.change.size) == count and one.test > one.limit


def test_a_slip_that_many_errors_would_fit_tells_no_name():
    matrix, noise = rows_of(7)
    noise[:3] += 60.0, -60.0, 60.0
    model = Linearly(matrix, noise, named(3))
    model.known[N] = replace(RIGHT_NAME, is_strong=False)
    assert sorted(one.change.index for one in diagnose(model).accused) == [0, 1, 2]


def test_a_wrong_name_leaves_errors_elsewhere_as_they_are():
    matrix, noise = rows_of(7)
    noise[[0, 1, 2, 30]] += 60.0, -60.0, 60.0, 45.0
    model = Linearly(matrix, noise, named(3))
    model.known[N] = RIGHT_NAME
    assert sorted(one.change.index for one in diagnose(model).accused) == [30, N]


def test_of_two_that_nothing_tells_apart_the_one_with_a_slip_is_first():
    matrix, noise = rows_of(8)
    matrix[:, 5] = 0.0
    matrix[[30, 31], 5] = 1.0  # an unknown that two rows alone see: each controls the other
    noise[30] += 1e3
    for first, other in ((30, 31), (31, 30)):
        for slip in (RIGHT_NAME, replace(RIGHT_NAME, is_strong=False)):
            model = Linearly(matrix, noise)
            model.known[first] = slip
            (one,) = diagnose(model).accused
            assert one.change.index == first and one.slips == (slip,)
            assert [same.change.index for same in one.others] == [other]


def test_a_strong_slip_goes_before_a_weak_one_and_of_two_the_better_fit():
    matrix, noise = rows_of(8)
    matrix[:, 5] = 0.0
    matrix[[30, 31], 5] = 1.0
    noise[30] += 1e3
    weak, close = replace(RIGHT_NAME, is_strong=False), replace(RIGHT_NAME, misfit=0.1)
    for known, wanted in (({30: weak, 31: close}, 31), ({31: weak, 30: close}, 30)):
        model = Linearly(matrix, noise)
        model.known = known
        (one,) = diagnose(model).accused
        assert one.change.index == wanted and one.slips == (close,)


def test_where_most_of_a_kind_is_off_it_is_said_how_many_before_anything_is_adjusted():
    matrix, noise = rows_of(9)
    noise[:5] += 80.0 * np.array([1.0, -1.5, 2.0, 1.2, -0.7])
    one_kind = Linearly(matrix, noise, [ROWS])
    assert Search(one_kind, POLICY).at_first() is None and one_kind.adjustments > 0
    apart = [
        Family.alone(code, np.arange(*part), is_start=True) for code, part in (("K", (0, 7)), ("L", (7, N)))
    ]
    two_kinds = Linearly(matrix, noise, apart)
    search = Search(two_kinds, POLICY)
    assert search.at_first() is None
    assert search.count == 5 and two_kinds.adjustments == 0


def test_few_errors_of_a_small_kind_are_told_at_once():
    matrix, noise = rows_of(9)
    noise[:3] += 80.0
    apart = [
        Family.alone(code, np.arange(*part), is_start=True) for code, part in (("K", (0, 4)), ("L", (4, N)))
    ]
    found = Search(Linearly(matrix, noise, apart), POLICY).at_first()
    assert found is not None and sorted(one.change.index for one in found.accused) == [0, 1, 2]


def test_what_the_search_has_spent_is_told_of_what_it_may_spend():
    matrix, noise = rows_of(7)
    noise[12] += 50.0
    said = []
    diagnose(Linearly(matrix, noise), told=said.append)
    assert said == ["search for errors: iteration 1 of 240"]
    noise[20] -= 40.0
    said.clear()
    diagnose(Linearly(matrix, noise), replace(POLICY, steps=27), said.append)
    assert said[0] == "search for errors: iteration 26 of 27"
    assert said[-1] == "search for errors: iteration 27 of 27"


def test_an_error_is_found_without_a_solution_of_least_squares():
    matrix, noise = rows_of(7)
    noise[12] += 50.0
    model = Linearly(matrix, noise)
    model.solution = lambda: None
    verdict = diagnose(model)
    assert verdict.status is Status.EXPLAINED
    assert [one.change.index for one in verdict.accused] == [12]


def test_what_is_not_linear_is_taken_off_by_the_model_and_told_with_its_size():
    matrix, noise = rows_of(6)
    noise[:8] -= 2.0 * 40.0
    bent = Family.alone(DRIFT, np.array([N]), rarity=4.0, is_bent=True)
    model = Linearly(matrix, noise, [ROWS, bent])
    applied = []
    linearised = model.linearised
    model.linearised = lambda place, changes: applied.extend(changes) or linearised(place, changes)
    (one,) = diagnose(model).accused
    assert one.change.index == N and abs(one.change.size[0] - 40.0) < 5.0 * one.change.sigma[0]
    assert {change.index for change in applied} == {N}
    assert abs(applied[-1].size[0] - one.change.size[0]) < 1e-6


def test_the_chance_of_a_false_accusation_is_shared_by_all_that_may_be_accused():
    def limit(*families):
        model = Linearly(*rows_of(1), families)
        return LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY).limit(1)

    few, block = Family.alone("T1", np.arange(4), is_start=True), named(8)[1]
    assert limit(ROWS) > limit(few)
    assert limit(few, block) == limit(few)  # it accuses what rows accuse


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e6])
def test_units_of_errors_change_sizes_and_no_test(factor):
    matrix, noise = rows_of(6)
    noise[:8] -= 80.0
    model = Linearly(matrix, noise)
    model.columns[:, N] *= factor
    tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
    plain = Linearly(matrix, noise)
    wanted = LinearTests(*plain.linearised(np.zeros(U), ()), plain.hypotheses, POLICY)
    found = [one.tests(one.given(())).statistic[N] for one in (tests, wanted)]
    assert found[0] == pytest.approx(found[1]) and found[0] > 100.0
    size, sigma = (part[0] * factor for part in tests.sizes([N])[N])
    assert [size, sigma] == pytest.approx([part[0] for part in wanted.sizes([N])[N]])


def test_a_small_effect_is_accused_only_where_nothing_else_accepts_the_model():
    matrix, noise = rows_of(2)
    found = []
    for factor in (0.6, 1.1):
        changed = factor * noise
        changed[:8] -= 1.4
        model = Linearly(matrix, changed)
        tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
        assert tests.is_small(N, [N])
        verdict = diagnose(model)
        found.append((tests.cost < 60.0, *(len(told) for told in (verdict.remarks, verdict.accused))))
    assert found == [(True, 1, 0), (False, 0, 1)]


def test_whether_an_effect_is_small_does_not_depend_on_what_else_is_wrong():
    matrix, noise = rows_of(2)
    noise *= 0.6
    noise[:8] -= 1.4
    for error in (0.0, 50.0):
        noise[20] += error
        model = Linearly(matrix, noise)
        tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
        assert tests.is_small(N, [20, N] if error else [N])
        assert not tests.is_small(20, [20, N])
    noise[:8] -= 3.0
    model = Linearly(matrix, noise)
    tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
    assert not tests.is_small(N, [20, N])


@pytest.mark.parametrize("factor", [0.1, 1.0, 7.0])
def test_the_noise_is_that_of_the_equations_without_those_that_stand_out(factor):
    matrix, errors = rows_of(3)
    errors *= factor
    errors[[4, 9]] += 1000.0 * factor
    rest = np.setdiff1d(np.arange(N), [4, 9])
    solved = np.linalg.lstsq(matrix[rest], errors[rest], rcond=None)[0]
    left = np.sum((errors[rest] - matrix[rest] @ solved) ** 2)
    assert variance(Linearly(matrix, errors)) == pytest.approx(left / (N - U - 2), rel=1e-6)


def test_something_stands_out_where_it_exceeds_what_the_noise_of_the_rest_explains():
    for seed in range(3):
        matrix, noise = rows_of(20 + seed)
        found = []
        for factor, error in ((1.0, 0.0), (10.0, 0.0), (1.0, 60.0), (10.0, 600.0)):
            changed = factor * noise
            changed[3] += 300.0 * factor
            changed[20] += error
            model = Linearly(matrix, changed)
            tests = LinearTests(*model.linearised(np.zeros(U), ()), model.hypotheses, POLICY)
            found.append(_stands_out(Explanation(0.0, tests, (3,), None)))
        assert found == [False, False, True, True]
