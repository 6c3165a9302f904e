import pytest

from obseq.errors import InputError
from obseq.report.adjusted import outcome
from obseq.report.summary import LINES, QUIET, VERBOSE, Detail, summary


def line_with(text: str, *words: str) -> str:
    found = [line for line in text.splitlines() if all(word in line for word in words)]
    assert len(found) == 1, f"{len(found)} lines with {words} in\n{text}"
    return found[0]


def test_it_begins_with_what_there_is_and_the_verdict(record) -> None:
    first, second, *_ = summary(outcome(record)).splitlines()
    assert first == "Survey network: 3 points; 3 observations, 1 not used; redundancy 4; 2 iterations"
    assert second == "The network is sound: residuals fit the sigmas, and no error is suspected."


def test_figures_stand_beside_what_they_are_compared_with(record) -> None:
    text = summary(outcome(record))
    assert line_with(text, "sigma0").split()[:7] == "sigma0 1.25 expected 0.35 to 1.67 as".split()
    assert line_with(text, "  redundancy ", "per equation").split()[1] == "4"
    assert line_with(text, "largest").endswith("Hz A -> C")
    assert line_with(text, "  weakest").split()[2:5] == "4.00 mm B,".split()


def test_more_is_told_when_it_is_asked_for(record) -> None:
    text = summary(outcome(record), [], VERBOSE, {"read": 0.25, "adjust": 1.5})
    assert line_with(text, "iteration 1:").endswith("sigma0 120.5 at its start, largest step 2.5")
    assert "Seconds: read 0.25, adjust 1.50, summary 0." in text and "seconds: " not in text
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Observations. Residuals are"))
    row = "Hz A C site.obs:2 yes 26.62000 gon 1.000 mgon 26.61690 gon -3.100 mgon -3.10"
    assert next(line.split() for line in lines[start:] if line.startswith("  Hz")) == row.split()
    assert "Seconds" not in summary(outcome(record), seconds={"read": 0.25})


def test_less_is_the_verdict_alone(record) -> None:
    text = summary(outcome(record), ["a.json"], detail=QUIET)
    assert text.splitlines() == [
        "The network is sound: residuals fit the sigmas, and no error is suspected.",
        "Written: a.json",
    ]


def test_coordinates_are_shown_when_they_are_asked_for(record) -> None:
    assert "650100.0000" not in summary(outcome(record))
    text = summary(outcome(record), detail=Detail(shown=("points",)))
    row = "B point 650100.0000 6860050.0000 35.0000 4.00 2.00 1.00 2"
    assert line_with(text, "B", "  650100.0000").split() == row.split()
    with pytest.raises(
        InputError, match="--show stars: there is no such table; there are residuals, observations"
    ):
        summary(outcome(record), detail=Detail(shown=("stars",)))


def test_one_table_when_the_frame_is_the_system_of_the_points(plain, make) -> None:
    assert "650100.0000" not in summary(
        outcome(make(points_crs=plain["frame"])), detail=Detail(shown=("points",))
    )


def test_angular_systems_have_more_decimals(plain, make) -> None:
    plain["points"][1] |= {"crs_x": 2.3488, "crs_y": 48.8534}
    assert "  2.348800000       48.853400000" in summary(
        outcome(make(points_crs_unit="degree")), detail=Detail(shown=("points",))
    )


def test_precisions_in_the_input_system_when_known(plain, make) -> None:
    plain["points"][1] |= {"crs_sx": 0.0031, "crs_sy": 0.0022, "crs_sz": 0.0013}
    line = line_with(summary(outcome(make()), detail=Detail(shown=("points",))), "B", "650100.0000")
    assert line.split()[-4:-1] == ["3.10", "2.20", "1.30"]


def test_it_is_thirty_lines_whatever_the_size(plain, make) -> None:
    first = plain["points"][0]
    plain["points"] = [first | {"name": f"P{k}", "sx": 0.001 * k} for k in range(500)]
    accused = {
        "code": "S100",
        "what": "Hz A -> C (site.obs:2)",
        "text": "is wrong",
        "test": 49.0,
        "limit": 9.0,
    }
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": [accused] * 40, "reason": ""}
    text = [f"w{k}" for k in range(50)]
    told = summary(
        outcome(make(iterations=plain["iterations"] * 20, diagnosis=found, warnings=text, notes=text))
    )
    assert len(told.splitlines()) <= LINES
    assert line_with(told, "  weakest").split()[4] == "P499,"


def test_a_solution_that_did_not_converge_cannot_be_overlooked(make) -> None:
    assert "NOT CONVERGED after 2 iterations" in summary(outcome(make(converged=False)))


def test_no_redundancy_is_said(make) -> None:
    text = summary(outcome(make(redundancy=0, sigma0=None, global_test=None)))
    assert "not tested" in text
    assert text.splitlines()[1] == "Adjusted, but nothing is checked: there is no redundancy."


def test_the_files_are_named(record) -> None:
    assert "Written: a.json, a.html" in summary(outcome(record), ["a.json", "a.html"])
    assert "Written: nothing" in summary(outcome(record), [])


def test_the_number_that_is_tested_is_shown_when_it_is_another(make, plain) -> None:
    other = make(global_test=plain["global_test"] | {"sigma0": 1.4})
    text = summary(outcome(other), detail=VERBOSE)
    assert line_with(text, "  sigma0: ").endswith("1.25; tested with the residuals of known points: 1.4")
    assert "known points: " not in summary(outcome(make()), detail=VERBOSE)


def test_what_has_no_room_is_counted_and_told_when_all_is_asked_for(make) -> None:
    many = outcome(make(warnings=[f"w{k}" for k in range(40)], notes=[f"n{k}" for k in range(5)]))
    text = summary(many)
    kept = text.count("Warning: ")
    assert len(text.splitlines()) <= LINES and kept > 10
    assert line_with(text, "(-v tells all)").split()[:3] == ["and", str(40 - kept + 5 + 1), "more"]
    assert summary(many, detail=VERBOSE).count("Warning: ") == 40


def test_the_same_step_is_told_once_with_all_that_goes_with_it(make) -> None:
    accused = [{"code": code, "what": f"Hz A -> {code}", "text": "is wrong"} for code in ("S100", "S110")]
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": accused, "reason": ""}
    text = " ".join(summary(outcome(make(diagnosis=found))).split())
    assert text.count("Next: ") == 1 and "obseq causes S100; obseq causes S110" in text


def test_precisions_that_errors_spoil_are_not_shown(make) -> None:
    accused = {
        "code": "S100",
        "what": "Hz A -> C (site.obs:2)",
        "text": "is wrong",
        "test": 49.0,
        "limit": 9.0,
    }
    found = {"status": "explained", "left": 1.0, "redundancy": 3, "accused": [accused], "reason": ""}
    wrong = make(diagnosis=found, precision="a posteriori")
    assert line_with(summary(outcome(wrong)), "  weakest").split()[2:4] == [
        "3.20",
        "mm",
    ]  # 4 mm over sigma0 of 1.25
    assert line_with(summary(outcome(make(precision="a posteriori"))), "  weakest").split()[2:4] == [
        "4.00",
        "mm",
    ]
