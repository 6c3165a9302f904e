"""The engine on a linear model: T against adjustments with the columns as unknowns, and what it accuses."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from linear_model import Array, Linearly, N, U, columns, rows_of

from obseq.diagnosis.engine import Search, diagnose
from obseq.diagnosis.judgement import noise
from obseq.diagnosis.linear_tests import LinearTests
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change
from obseq.diagnosis.verdict import Status
from obseq.records.diagnosis import DiagnosisRecord


def cost(matrix: Array, observed: Array) -> float:
    return float(np.sum((observed - matrix @ np.linalg.lstsq(matrix, observed, rcond=None)[0]) ** 2))


def linear_tests(model: Linearly, place: Array) -> LinearTests:
    return LinearTests(*model.linearised(place, ()), model.hypotheses, POLICY)


@pytest.mark.parametrize("chosen", [(), (3,), (3, 20), (N,), (N + 1,)])
def test_statistics_are_what_columns_as_unknowns_take(chosen: tuple[int, ...]) -> None:
    matrix, noise = rows_of(1)
    noise[:8] += 30.0
    model = Linearly(matrix, noise)
    tests = linear_tests(model, np.full(U, 5.0))  # anywhere: linear models are alike at all places
    given = tests.given(chosen)
    own = [model.hypotheses.of(i) for i in chosen]
    known = np.hstack([matrix, *(columns()[:, part] for part in own)])
    before = cost(known, noise)
    assert tests.cost - tests.took(chosen) == pytest.approx(before)
    found = tests.tests(given, chosen)
    for index in range(len(model.hypotheses)):
        if index in chosen or (chosen == (N + 1,) and index < 8):
            continue
        whole = np.hstack([known, columns()[:, model.hypotheses.of(index)]])
        if np.linalg.matrix_rank(whole) == whole.shape[1]:
            assert found.statistic[index] == pytest.approx(before - cost(whole, noise)), index


def test_sizes_are_those_of_the_adjustment_with_them_as_unknowns() -> None:
    matrix, noise = rows_of(2)
    noise[5] += 1e4
    model = Linearly(matrix, noise)
    sizes = linear_tests(model, np.zeros(U)).sizes([5, N])
    whole = np.hstack([matrix, columns()[:, [5, N]]])
    found = np.linalg.lstsq(whole, noise, rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)))
    for k, index in enumerate((5, N)):
        assert sizes[index][0] == pytest.approx([found[U + k]])
        assert sizes[index][1] == pytest.approx([spread[U + k]])


def test_large_models_are_tested_through_the_screen_alike() -> None:
    matrix, noise = rows_of(3)
    noise[:8] -= 20.0
    model = Linearly(matrix, noise)
    linear, of = model.linearised(np.zeros(U), ())
    plain = LinearTests(linear, of, model.hypotheses, POLICY)
    screened = LinearTests(linear, of, model.hypotheses, replace(POLICY, large=1))
    found = [one.tests(one.given(())).statistic[N] for one in (plain, screened)]
    assert found[0] == pytest.approx(found[1]) and found[0] > 100.0
    quiet = Linearly(*rows_of(4))
    screened = LinearTests(*quiet.linearised(np.zeros(U), ()), quiet.hypotheses, replace(POLICY, large=1))
    assert screened.tests(screened.given(())).statistic[N] == 0.0  # not looked at: nothing asks for it


def test_nothing_is_accused_where_nothing_is_wrong() -> None:
    for seed in range(20):
        model = Linearly(*rows_of(seed))
        verdict = diagnose(model)
        assert verdict.status is Status.ACCEPTED, seed
        assert not verdict.accused and model.adjustments == 0
        assert verdict.left == pytest.approx(cost(*rows_of(seed)))


@pytest.mark.parametrize("size", [12.0, 1e3, 1e7])
def test_wrong_rows_are_accused_with_their_sizes(size: float) -> None:
    matrix, noise = rows_of(5)
    noise[[11, 25, 33]] -= size, 1.1 * size, -size
    model = Linearly(matrix, noise)
    verdict = diagnose(model)
    assert verdict.status is Status.EXPLAINED
    assert sorted(one.change.index for one in verdict.accused) == [11, 25, 33]
    for one in verdict.accused:
        expected = {11: size, 25: 1.1 * size, 33: -size}[one.change.index]
        assert abs(one.change.size[0] - expected) < 5.0 * one.change.sigma[0]
        assert one.test > one.limit and not one.others
    assert verdict.redundancy == N - U - 3
    assert model.adjustments >= 1  # no accusation without an adjustment with it


def test_one_offset_is_told_in_place_of_its_rows() -> None:
    matrix, noise = rows_of(6)
    noise[:8] -= 2.0 * 40.0
    (one,) = diagnose(Linearly(matrix, noise)).accused
    assert one.change.index == N
    assert abs(one.change.size[0] - 40.0) < 5.0 * one.change.sigma[0]


def test_a_block_takes_the_place_of_its_rows_where_most_are_off() -> None:
    matrix, noise = rows_of(7)
    noise[:8] += np.array([50.0, -80.0, 30.0, -60.0, 90.0, -40.0, 70.0, 20.0])
    verdict = diagnose(Linearly(matrix, noise))
    assert [one.change.index for one in verdict.accused] == [N + 1]
    matrix, noise = rows_of(7)
    noise[:2] += np.array([50.0, -80.0])
    verdict = diagnose(Linearly(matrix, noise))
    assert sorted(one.change.index for one in verdict.accused) == [0, 1]


def test_what_nothing_tells_apart_is_told_together() -> None:
    matrix, noise = rows_of(8)
    matrix[:, 5] = 0.0
    matrix[[30, 31], 5] = 1.0  # an unknown that two rows alone see: each controls the other
    noise[30] += 1e3
    verdict = diagnose(Linearly(matrix, noise))
    (one,) = verdict.accused
    assert {one.change.index, *(other.change.index for other in one.others)} == {30, 31}


def test_noise_that_is_larger_than_announced_accuses_only_what_stands_out_of_it() -> None:
    matrix, noise = rows_of(9)
    verdict = diagnose(Linearly(matrix, 10.0 * noise))
    assert verdict.status is Status.UNEXPLAINED and not verdict.accused
    noise[17] += 30.0
    verdict = diagnose(Linearly(matrix, 10.0 * noise))
    assert verdict.status is Status.UNEXPLAINED
    assert [one.change.index for one in verdict.accused] == [17]


def test_an_effect_that_is_not_proved_to_exceed_a_sigma_is_a_remark_and_no_error() -> None:
    matrix, noise = rows_of(10)
    noise *= 0.3
    found = []
    for size in (1.0, 2.0, 4.0):  # sigmas by which each of eight rows is off
        changed = noise.copy()
        changed[:8] -= size
        verdict = diagnose(Linearly(matrix, changed))
        found.append([[one.change.index for one in some] for some in (verdict.remarks, verdict.accused)])
    assert found == [[[], []], [[N], []], [[], [N]]]


def test_an_effect_within_a_sigma_is_accused_where_the_overall_test_rejects_without_it() -> None:
    matrix, noise = rows_of(10)
    noise *= 1.2
    noise[:8] -= 2.0
    verdict = diagnose(Linearly(matrix, noise))
    assert verdict.status is Status.EXPLAINED and not verdict.remarks
    assert [one.change.index for one in verdict.accused] == [N]


@pytest.mark.parametrize("status", Status)
def test_only_an_accepted_diagnosis_is_quiet(status: Status) -> None:
    assert DiagnosisRecord(status.value, 1.0, 1).is_quiet == (status is Status.ACCEPTED)


class Counting(Linearly):
    """The same, robust starts counted."""

    def __init__(self, matrix: Array, noise: Array) -> None:
        super().__init__(matrix, noise)
        self.starts: list[int] = []

    def robust(self, without: Sequence[Change] = ()) -> Array:
        self.starts.append(len(without))
        return super().robust(without)


def test_one_error_is_proved_where_least_squares_ended_and_several_from_a_robust_start() -> None:
    matrix, noise = rows_of(7)
    noise[12] += 50.0
    model = Counting(matrix, noise)
    assert [one.change.index for one in diagnose(model).accused] == [12]
    assert model.starts == [] and model.adjustments == 1
    noise[20] -= 40.0
    model = Counting(matrix, noise)
    assert sorted(one.change.index for one in diagnose(model).accused) == [12, 20]
    assert model.starts[0] == 0


def everywhere(seed: int) -> tuple[Array, Array]:
    """Errors of all sizes in all observations."""
    matrix, _ = rows_of(seed)
    return matrix, 30.0 * np.random.default_rng(seed).standard_cauchy(N)


def test_all_of_many_errors_are_told_where_they_explain_everything() -> None:
    matrix, noise = rows_of(8)
    noise[8:24] += 60.0 * np.random.default_rng(1).choice([-1.0, 1.0], 16)
    verdict = diagnose(Linearly(matrix, noise))
    assert verdict.status is Status.EXPLAINED
    assert sorted(one.change.index for one in verdict.accused) == list(range(8, 24))


@pytest.mark.parametrize("seed", [0, 2])
def test_errors_everywhere_accuse_nobody(seed: int) -> None:
    verdict = diagnose(Linearly(*everywhere(seed)))
    assert verdict.status is Status.UNEXPLAINED and not verdict.accused


def test_large_models_stop_after_fewer_iterations_and_small_ones_say_when_theirs_are_spent() -> None:
    model = Counting(*everywhere(0))
    diagnose(model, replace(POLICY, large=1))
    assert model.starts == [0]  # too many: another start would not make them few
    verdict = diagnose(Counting(*everywhere(0)), replace(POLICY, steps=1))
    assert "the 1 iterations for that are spent" in verdict.reason


def test_what_a_search_listed_before_its_iterations_were_spent_is_not_accused() -> None:
    matrix, noise = rows_of(9)
    noise[17] += 30.0
    assert diagnose(Linearly(matrix, 10.0 * noise)).accused
    verdict = diagnose(Linearly(matrix, 10.0 * noise), replace(POLICY, steps=1))
    assert verdict.status is Status.UNDECIDED and not verdict.accused
    assert verdict.left > 0.0 and verdict.redundancy == N - U - 1


@pytest.mark.parametrize("size", [9.0, 1e4])
@pytest.mark.parametrize("seed", range(3))
def test_two_and_three_errors_are_named_with_their_sizes(seed: int, size: float) -> None:
    matrix, noise = rows_of(20 + seed)
    planted = {9: size, 17: -1.3 * size, 30: 1.7 * size}
    for row, error in planted.items():
        noise[row] -= error
    verdict = diagnose(Linearly(matrix, noise))
    assert verdict.status is Status.EXPLAINED
    found = {one.change.index: one.change for one in verdict.accused}
    assert sorted(found) == sorted(planted)
    for row, error in planted.items():
        assert abs(found[row].size[0] - error) < 5.0 * found[row].sigma[0]
    redundancy = N - U - 3
    assert verdict.redundancy == redundancy and verdict.left < 3.0 * redundancy
    tests = [one.test / one.limit for one in verdict.accused]
    assert tests == sorted(tests, reverse=True)


def test_more_than_a_few_errors_are_looked_for_with_patience_only() -> None:
    model = Counting(*everywhere(0))
    search = Search(model, POLICY)
    assert search.at_first() is None and search.count > (N - U) / 2
    hasty = model.adjustments
    assert search.patiently().status is Status.UNEXPLAINED and model.adjustments > hasty
    matrix, noise = rows_of(8)
    noise[[12, 20]] += 50.0
    few = Search(Linearly(matrix, noise), POLICY).at_first()
    assert few is not None and {one.change.index for one in few.accused} == {12, 20}
    noise[[3, 9, 30]] += 50.0
    more = Search(Linearly(matrix, noise), POLICY)
    assert more.at_first() is None and more.count == 5
    assert {one.change.index for one in more.patiently().accused} == {3, 9, 12, 20, 30}


def test_more_rows_are_off_than_are_told_one_by_one_where_a_group_explains_them() -> None:
    matrix, noise = rows_of(8)
    noise[:8] += 50.0 * np.arange(1, 9)
    found = Search(Linearly(matrix, noise), replace(POLICY, most=7)).at_first()
    assert found is not None and found.status is Status.EXPLAINED
    assert [one.change.index for one in found.accused] == [N + 1]


def test_each_of_some_errors_is_tested_with_the_others_given() -> None:
    matrix, noise = rows_of(13)
    noise[[5, 20]] += 40.0
    tests = linear_tests(Linearly(matrix, noise), np.zeros(U))
    alone = tests.each([5, 20, N])
    for k, index in enumerate((5, 20, N)):
        rest = [i for i in (5, 20, N) if i != index]
        assert alone[k] == pytest.approx(tests.tests(tests.given(rest)).statistic[index])
    assert tests.each([5, 20, N + 1])[0] == 0.0  # the block has that row
    of_block = tests.took([5, 20, N + 1]) - tests.took([5, 20])
    assert tests.each([5, 20, N + 1])[2] == pytest.approx(of_block)


def test_what_is_accepted_leaves_the_same_to_others_in_whatever_order_it_was() -> None:
    matrix, noise = rows_of(11)
    noise[[3, 12, 30]] += 40.0
    place = Linearly(matrix, noise).robust()
    chosen = (3, 12, 30, N)
    grown, shrunk = linear_tests(Linearly(matrix, noise), place), linear_tests(Linearly(matrix, noise), place)
    for count in range(1, len(chosen) + 1):
        grown.given(chosen[:count])
    shrunk.given(chosen)
    for gone in chosen:
        rest = [i for i in chosen if i != gone]
        alone = linear_tests(Linearly(matrix, noise), place)
        for tests in (grown, shrunk):
            np.testing.assert_allclose(tests.given(rest).shown, alone.given(rest).shown, atol=1e-9)
            ours, theirs = tests.tests(tests.given(rest), rest), alone.tests(alone.given(rest), rest)
            np.testing.assert_allclose(ours.statistic, theirs.statistic, atol=1e-8)


def test_a_variance_factor_scales_tests_and_standard_deviations_and_no_size() -> None:
    matrix, noise = rows_of(3)
    noise[12] += 30.0
    plain, loose = (
        diagnose(Linearly(matrix, noise), replace(POLICY, variance=variance)).accused[0]
        for variance in (1.0, 4.0)
    )
    assert plain.change.index == loose.change.index == 12
    assert loose.test == pytest.approx(plain.test / 4.0, rel=1e-9)
    np.testing.assert_allclose(loose.change.size, plain.change.size, rtol=1e-9)
    np.testing.assert_allclose(loose.change.sigma, 2.0 * plain.change.sigma, rtol=1e-9)
    assert not diagnose(Linearly(matrix, noise), replace(POLICY, variance=900.0)).accused


@pytest.mark.parametrize("factor", [0.1, 7.0])
def test_the_noise_of_most_equations_is_known_whatever_the_others_are(factor: float) -> None:
    matrix, errors = rows_of(3)
    errors *= factor
    errors[[4, 9]] += 1000.0 * factor
    found = noise(Linearly(matrix, errors))
    assert 0.3 * factor**2 < found < 3.0 * factor**2
