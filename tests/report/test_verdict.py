import pytest

from obseq.report.content import numbers_of, tables
from obseq.report.verdict import Verdict
from obseq.report.writer import worst


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


def test_one_condition_that_fails_names_all_that_it_checks(make, plain) -> None:
    rejected = plain["global_test"] | {"passed": False, "sigma0": 4.25, "upper": 2.241}
    seen = [row | {"standardised_residual": 4.25} for row in plain["observations"][:2]]
    unseen = plain["observations"][2] | {"standardised_residual": None}
    said = Verdict(make(global_test=rejected, redundancy=1, observations=[*seen, unseen])).explanation
    first, second = (f"{row['from']} -> {row['to']} (site.obs:{row['line']})" for row in seen)
    assert "misclosure is 4.25 times" in said and "nothing tells these apart" in said
    assert first in said and second in said and f"site.obs:{unseen['line']}" not in said
    assert "blunder" in Verdict(make(global_test=rejected, redundancy=1)).explanation


def test_without_a_test_it_says_why(make) -> None:
    nothing = Verdict(make(global_test=None, redundancy=0))
    assert (nothing.headline, nothing.is_accepted) == ("not tested", False)
    assert "Nothing is redundant" in nothing.explanation
    assert "does not hold the test" in Verdict(make(global_test=None)).explanation
    lost = Verdict(make(global_test=None, redundancy=0, converged=False)).explanation
    assert "did not converge" in lost and "fits exactly" not in lost


def test_the_worst_come_first_whatever_their_sign_and_unused_ones_do_not_count(record) -> None:
    observations = tables(record, numbers_of(record))[0]
    assert worst(observations, "w") == [1, 0, 2, 3]


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


def diagnosis(*names: str) -> dict[str, object]:
    """The plain form of a diagnosis that accuses observations."""
    accused = [{"code": "S100", "what": name, "text": "wrong"} for name in names]
    return {"status": "explained", "left": 5.0, "redundancy": 6, "accused": accused}


def test_the_worst_type_comes_first_and_gross_errors_before_all(make, plain) -> None:
    rows = [type_row("Dist", 1.8), type_row("Hz", 0.01), type_row("Zen", 40.0)]
    assert [row.name for row in Verdict(make(types=rows)).types_beyond] == ["Hz", "Zen"]
    spoilt = Verdict(make(types=rows, diagnosis=diagnosis("Hz A -> B")))
    assert spoilt.types_beyond == [] and "gross errors named above" in spoilt.explanation


def test_small_residuals_say_something_with_enough_redundancy_only_and_no_more_than_rounding_allows(
    make,
) -> None:
    barely = type_row("Azim", 1.4e-11, 0.01) | {"redundancy": 1.0}
    assert Verdict(make(types=[barely])).is_accepted
    told = Verdict(make(types=[barely | {"redundancy": 6.0}])).explanation
    assert "look at least 1000 times too large" in told


def test_the_worst_observation_comes_before_sigmas_where_the_rest_is_accepted_without_it(make, plain) -> None:
    test = plain["global_test"] | {"passed": False, "sigma0": 2.0, "upper": 1.6}
    reliability = {"level": 0.001, "power": 0.8, "non_centrality": 4.13, "critical": 3.29}
    reliability |= {"tau_critical": None, "uncontrolled": 0, "tests": 9}

    def judged(w: float) -> Verdict:
        first = plain["observations"][0] | {"standardised_residual": w, "active": True}
        seen = [first, *plain["observations"][1:]]
        types = [type_row("DH", 1.8)]
        given = {"global_test": test, "redundancy": 5, "observations": seen, "types": types}
        return Verdict(make(reliability=reliability, **given))

    row = plain["observations"][0]
    name = f"{row['type']} {row['from']} -> {row['to']} ({row['file']}:{row['line']})"
    assert judged(-3.7).types_beyond == []
    assert (
        f"Without {name} the test would pass (its standardised residual is -3.70" in judged(-3.7).explanation
    )
    assert [one.name for one in judged(3.2).types_beyond] == ["DH"]
    assert "check it first" not in judged(3.2).explanation


def test_what_is_said_of_gross_errors_agrees_with_what_snooping_left_out(make) -> None:
    gross = "Hz A -> B (l.obs:2)"
    gone = {"observation": gross, "row": 1, "statistic": 900.0, "p_value": 0.0, "blunder": 1.0}
    gone |= {"detectable": None}
    snooping = {"statistic": "w", "level": 0.05, "end": "", "suspects": [], "rejections": [gone]}
    clean = Verdict(make(diagnosis=diagnosis(gross), snooping=snooping))
    assert "they take no part" in clean.explanation and not clean.record.is_complete
    other = Verdict(make(diagnosis=diagnosis(gross, "Zen A -> B (l.obs:3)"), snooping=snooping))
    assert "may still take part" in other.explanation and other.spoilt == 1
