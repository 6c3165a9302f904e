import math

import pytest
from scipy.stats import chi2

from obseq.report.statistics import verdict, worst_first


@pytest.mark.parametrize("redundancy", [1, 4, 533, 50_000])
def test_bounds_are_the_quantiles_of_chi_square(record, redundancy) -> None:
    test = verdict(record | {"redundancy": redundancy})
    low, high = chi2.ppf([0.025, 0.975], redundancy)
    assert test.lower == pytest.approx(math.sqrt(low / redundancy), rel=1e-12)
    assert test.upper == pytest.approx(math.sqrt(high / redundancy), rel=1e-12)


@pytest.mark.parametrize(
    ("sigma0", "headline"),
    [(0.3, "rejected: too small"), (1.0, "accepted"), (1.66, "accepted"), (1.68, "rejected: too large")],
)
def test_both_sides_are_tested(record, sigma0, headline) -> None:
    test = verdict(record | {"sigma0": sigma0})  # 4 degrees of freedom: 0.348 to 1.669
    assert test.headline == headline
    assert test.is_accepted == (headline == "accepted")


def test_residuals_of_known_points_count_when_the_record_has_them(record) -> None:
    test = verdict(record | {"sigma0": 1.25, "variance_factor": 4.0})
    assert (test.sigma0, test.headline) == (2.0, "rejected: too large")


def test_an_explanation_says_what_a_rejection_means(record) -> None:
    assert "blunder" in verdict(record | {"sigma0": 9.0}).explanation
    assert "sigmas are too large" in verdict(record | {"sigma0": 0.01}).explanation


@pytest.mark.parametrize("case", [{"redundancy": 0}, {"sigma0": None}, {"sigma0": math.inf}])
def test_without_redundancy_nothing_is_tested(record, case) -> None:
    test = verdict(record | case)
    assert (test.sigma0, test.headline, test.is_accepted) == (None, "not tested", False)


def test_the_worst_come_first_whatever_their_sign_and_unused_ones_do_not_count(record) -> None:
    assert [row["line"] for row in worst_first(record)] == [2, 1, 3]
