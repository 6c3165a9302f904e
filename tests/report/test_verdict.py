import pytest

from obseq.report.adjusted import verdict
from obseq.report.findings import findings
from obseq.report.tables.content import numbers_of, tables
from obseq.report.tables.named import ellipse_level, short_names
from obseq.report.verdict import Verdict
from obseq.report.writer import worst


@pytest.mark.parametrize(
    ("sigma0", "level", "words"),
    [
        (0.3, "warn", "residuals are too small for their sigmas: sigma0 is 0.3"),
        (1.0, "ok", "The network is sound"),
        (1.66, "ok", "The network is sound"),
        (1.68, "warn", "residuals are too large for their sigmas: sigma0 is 1.68"),
    ],
)
def test_what_the_test_found_in_words(make, plain, sigma0, level, words) -> None:
    passed = 0.348 <= sigma0 <= 1.669
    found = verdict(make(global_test=plain["global_test"] | {"sigma0": sigma0, "passed": passed}))
    assert found.level == level and words in found.text


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
    nothing = verdict(make(global_test=None, redundancy=0))
    assert (nothing.level, nothing.text) == (
        "warn",
        "Adjusted, but nothing is checked: there is no redundancy.",
    )
    lost = verdict(make(global_test=None, redundancy=0, converged=False))
    assert lost.level == "bad" and "not converged" in lost.text


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
    record = make(types=[type_row("Dist", 0.001), type_row("Hz", 1.1)])
    assert verdict(record).level == "warn" and "sigmas of Dist are too large" in verdict(record).text
    (told,) = [one for one in findings(record, {"B": 1})[0].items if one.title.startswith("Sigmas of")]
    assert told.title == "Sigmas of Dist" and "are 0.001 of what their sigmas announce" in told.text
    assert verdict(make(types=[type_row("Dist", 0.7), type_row("Hz", 1.1)])).level == "ok"


def diagnosis(*names: str) -> dict[str, object]:
    """The plain form of a diagnosis that accuses observations."""
    accused = [{"code": "S100", "what": name, "text": "wrong"} for name in names]
    return {"status": "explained", "left": 5.0, "redundancy": 6, "accused": accused}


def test_the_worst_type_comes_first_and_gross_errors_before_all(make, plain) -> None:
    rows = [type_row("Dist", 1.8), type_row("Hz", 0.01), type_row("Zen", 40.0)]
    assert [row.name for row in Verdict(make(types=rows)).types_beyond] == ["Hz", "Zen"]
    spoilt = Verdict(make(types=rows, diagnosis=diagnosis("Hz A -> B")))
    assert spoilt.types_beyond == [] and spoilt.explanation == ""


def test_small_residuals_say_something_with_enough_redundancy_only_and_no_more_than_rounding_allows(
    make,
) -> None:
    barely = type_row("Azim", 1.4e-11, 0.01) | {"redundancy": 1.0}
    assert Verdict(make(types=[barely])).types_beyond == []
    record = make(types=[barely | {"redundancy": 6.0}])
    (told,) = [one for one in findings(record, {"B": 1})[0].items if one.title == "Sigmas of Azim"]
    assert "multiply these sigmas by 0.001" in told.step


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
    clean = make(diagnosis=diagnosis(gross), snooping=snooping)
    assert Verdict(clean).spoilt == 0 and not clean.is_complete
    (told,) = [one for part in findings(clean, {"B": 1}) for one in part.items if "Left out: " in one.text]
    assert told.title == gross
    other = Verdict(make(diagnosis=diagnosis(gross, "Zen A -> B (l.obs:3)"), snooping=snooping))
    assert other.spoilt == 1


def test_tables_say_at_which_level_ellipses_are(make) -> None:
    assert ellipse_level(make(ellipse_level=0.95, precision="a priori")) == "95 %, a priori"
    assert ellipse_level(make(ellipse_level=None, precision="")) == "39 % (standard)"
    assert ellipse_level(make(ellipse_level=None, precision=""), "ellipsoid") == "20 % (standard)"


def test_files_of_one_name_keep_their_folders() -> None:
    assert short_names(["a/x.obs", "b/x.obs", "b/y.obs"]) == {
        "a/x.obs": "a/x.obs",
        "b/x.obs": "b/x.obs",
        "b/y.obs": "y.obs",
    }
