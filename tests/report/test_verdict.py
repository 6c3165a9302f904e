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


def type_row(name: str, factor: float, lower: float = 0.6, upper: float = 1.5) -> dict[str, object]:
    return {
        "name": name,
        "count": 9,
        "unused": 0,
        "redundancy": 6.0,
        "rms": factor,
        "mean": 0.0,
        "largest": 1.0,
        "sigma_factor": factor,
        "lower": lower,
        "upper": upper,
        "level": 0.005,
    }


def test_sigmas_of_one_type_are_judged_apart(make) -> None:
    verdict = Verdict(make(types=[type_row("Dist", 0.001), type_row("Hz", 1.1)]))
    assert (verdict.headline, verdict.is_accepted) == ("accepted as a whole, NOT by type", False)
    assert "the sigmas of Dist look at least 1000 times too large" in verdict.explanation
    assert "at 0.5 %" in verdict.explanation and "Hz" not in verdict.explanation
    assert Verdict(make(types=[type_row("Dist", 0.7), type_row("Hz", 1.1)])).is_accepted


def test_the_worst_type_comes_first_and_gross_errors_before_all(make, plain) -> None:
    rows = [type_row("Dist", 1.8), type_row("Hz", 0.01), type_row("Zen", 40.0)]
    assert [row.name for row in Verdict(make(types=rows)).types_beyond] == ["Hz", "Zen"]
    gross = {"what": "Hz A -> B", "cause": "mistyped", "text": "a digit", "size": 900.0, "points": []}
    spoilt = Verdict(make(types=rows, gross_errors=[gross]))
    assert spoilt.types_beyond == [] and "gross errors named above" in spoilt.explanation
