import pytest

from obseq.report.verdict import Verdict, worst_first


@pytest.mark.parametrize(
    ("sigma0", "headline"),
    [(0.3, "rejected: too small"), (1.0, "accepted"), (1.66, "accepted"), (1.68, "rejected: too large")],
)
def test_what_the_test_found_in_words(make, plain, sigma0, headline) -> None:
    passed = 0.348 <= sigma0 <= 1.669
    verdict = Verdict(make(global_test=plain["global_test"] | {"sigma0": sigma0, "passed": passed}))
    assert verdict.headline == headline
    assert verdict.is_accepted == (headline == "accepted")


def test_an_explanation_says_what_a_rejection_means(make, plain) -> None:
    rejected = plain["global_test"] | {"passed": False}
    assert "blunder" in Verdict(make(global_test=rejected | {"sigma0": 9.0})).explanation
    assert "sigmas are too large" in Verdict(make(global_test=rejected | {"sigma0": 0.01})).explanation


def test_without_a_test_it_says_why(make) -> None:
    nothing = Verdict(make(global_test=None, redundancy=0))
    assert (nothing.headline, nothing.is_accepted) == ("not tested", False)
    assert "Nothing is redundant" in nothing.explanation
    assert "does not hold the test" in Verdict(make(global_test=None)).explanation


def test_the_worst_come_first_whatever_their_sign_and_unused_ones_do_not_count(record) -> None:
    assert [row.line for row in worst_first(record)] == [2, 1, 3]
