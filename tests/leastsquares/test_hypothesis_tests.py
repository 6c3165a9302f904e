"""Tests of an adjustment: tabulated values, exact relations between distributions, rejection rates."""

import numpy as np
import pytest
from scipy import special

import obseq
from obseq.errors import InputError
from obseq.leastsquares.statistics.hypothesis_tests import (
    global_test,
    non_centrality,
    normal_critical,
    normal_p_values,
    overall_level,
    robust_spread,
    single_level,
    tau_critical,
    tau_p_values,
)


def one_mean(values, sigma):
    system = obseq.LeastSquares()
    (mean,) = system.add_scalars(["mean"], [0.0])
    n = len(values)
    return system, system.add_linear([[mean] * n], [np.ones((n, 1))], values, sigma)


def mean_of(values, sigma):
    return one_mean(values, sigma)[0].solve()


def test_global_test_by_hand():
    # values 1, 3: mean 2, residuals +1 and -1, over sigma 0.5: sum of squares 8, one degree of freedom
    test = global_test(mean_of([1.0, 3.0], 0.5), level=0.05)
    assert test.statistic == pytest.approx(8.0)
    assert test.redundancy == 1
    assert test.upper == pytest.approx(5.0239, abs=1e-4)  # tabulated chi-square 0.975, 1 degree of freedom
    assert not test.passed
    assert test.p_value == pytest.approx(2 * (1 - special.ndtr(np.sqrt(8.0))) * 2, rel=1e-12)
    assert test.sigma0 == pytest.approx(np.sqrt(8.0))
    assert test.to_dict()["passed"] is False


def test_two_sides_see_sigmas_that_are_too_large_and_one_does_not():
    result = mean_of([1.0, 1.001, 0.999, 1.0005], 1.0)
    assert not global_test(result).passed
    assert global_test(result, two_sided=False).passed
    assert global_test(result).sigma0_limits[0] > global_test(result).sigma0


@pytest.mark.slow
def test_rejection_rates_are_the_level():
    rng = np.random.default_rng(5)
    system, batch = one_mean(np.zeros(6), 1.0)

    def mean_of_six():
        batch.observations = np.column_stack([np.ones(6), rng.normal(size=6)])
        return system.solve()

    drawn = [mean_of_six() for _ in range(500)]
    for two_sided in (True, False):
        rejected = [not global_test(result, 0.1, two_sided).passed for result in drawn]
        assert abs(np.mean(rejected) - 0.1) < 3 * np.sqrt(0.09 / 500)


def test_no_redundancy_no_test():
    with pytest.raises(InputError, match="redundancy 0"):
        global_test(mean_of([1.0], 1.0))


def test_tau_is_a_function_of_student():
    for f in (2, 5, 30):
        t = special.stdtrit(f - 1, 1 - 0.01 / 2)
        expected = t * np.sqrt(f) / np.sqrt(f - 1 + t * t)
        assert tau_critical(0.01, f) == pytest.approx(expected, rel=1e-12)
        assert float(tau_p_values(expected, f)) == pytest.approx(0.01, rel=1e-9)
    assert np.isinf(tau_critical(0.05, 1))
    np.testing.assert_array_equal(tau_p_values([1.0, np.nan], 1), [1.0, np.nan])
    assert tau_critical(0.05, 100_000) == pytest.approx(normal_critical(0.05), rel=1e-4)


def test_non_centrality_gives_its_power():
    for level, power in ((0.001, 0.80), (0.05, 0.80), (0.05, 0.93), (0.01, 0.999), (0.05, 0.0501)):
        shift, limit = non_centrality(level, power), normal_critical(level)
        assert special.ndtr(shift - limit) + special.ndtr(-limit - shift) == pytest.approx(power, rel=1e-9)
    assert non_centrality(0.001, 0.80) == pytest.approx(4.13, abs=5e-3)  # Baarda's number
    with pytest.raises(InputError, match="must exceed its level"):
        non_centrality(0.05, 0.05)


def test_levels_of_many_tests():
    assert single_level(0.05, 1) == pytest.approx(0.05)
    single = single_level(0.05, 1000)
    assert 1 - (1 - single) ** 1000 == pytest.approx(0.05)
    assert float(overall_level(single, 1000)) == pytest.approx(0.05)
    assert float(normal_p_values(-normal_critical(1e-9))) == pytest.approx(1e-9)
    with pytest.raises(InputError, match="between 0 and 1"):
        single_level(5.0, 10)


def test_the_spread_of_most_is_not_moved_by_outliers():
    rng = np.random.default_rng(4)
    w = rng.normal(0.0, 3.0, 20_000)
    assert robust_spread(w) == pytest.approx(3.0, rel=0.02)
    w[:1000] = rng.uniform(50.0, 500.0, 1000)
    assert robust_spread(w) == pytest.approx(3.0, rel=0.05)
    assert robust_spread([]) == 0.0
