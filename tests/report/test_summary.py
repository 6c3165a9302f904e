import pytest

from obseq.errors import InputError
from obseq.report.summary import summary

LINES = 30


def line_with(text: str, *words: str) -> str:
    found = [line for line in text.splitlines() if all(word in line for word in words)]
    assert len(found) == 1, f"{len(found)} lines with {words} in\n{text}"
    return found[0]


def test_it_begins_with_what_there_is_and_the_verdict(record) -> None:
    first, second, *_ = summary(record).splitlines()
    assert first == "3 points; 3 observations, 1 not used; converged after 2 iterations; redundancy 4"
    assert second == "The network is sound: residuals fit the sigmas, and no error is suspected."


def test_figures_stand_beside_what_they_are_compared_with(record) -> None:
    text = summary(record)
    assert line_with(text, "sigma0").split()[:7] == "sigma0 1.25 expected 0.35 to 1.67 as".split()
    assert line_with(text, "redundancy ", "per equation").split()[1] == "4"
    assert line_with(text, "largest").endswith("Hz A -> C")
    assert line_with(text, "weakest").split()[2:5] == "4.00 mm B,".split()


def test_more_is_told_when_it_is_asked_for(record) -> None:
    text = summary(record, detail="verbose")
    assert line_with(text, "each iteration").split()[-2:] == ["120.5", "1.25"]
    assert line_with(text, "of the solution").endswith("1.25")
    assert "at 95 %: 1.25; between 0.348 and 1.669 is expected: accepted" in text
    assert "Seconds: read 0.25, adjust 1.50, summary 0." in text
    lines = text.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Observations. Residuals are"))
    row = "Hz A C site.obs:2 26.62000 gon 1.000 mgon -3.100 mgon -3.10"
    assert next(line.split() for line in lines[start:] if line.startswith("  Hz")) == row.split()
    assert "Seconds" not in summary(record)


def test_less_is_the_verdict_alone(record) -> None:
    text = summary(record, ["a.json"], detail="quiet")
    assert text.splitlines() == [
        "The network is sound: residuals fit the sigmas, and no error is suspected.",
        "Written: a.json",
    ]


def test_coordinates_are_shown_when_they_are_asked_for(record) -> None:
    assert "650100.0000" not in summary(record)
    text = summary(record, shown=["points"])
    row = "B point 650100.0000 6860050.0000 35.0000 100.0000 50.0000 0.0000 4.00 2.00 1.00"
    assert line_with(text, "B", "  100.0000").split() == row.split()
    with pytest.raises(InputError, match="no table 'stars' to show; there are points, observations, known"):
        summary(record, shown=["stars"])


def test_one_table_when_the_frame_is_the_system_of_the_points(plain, make) -> None:
    assert "650100.0000" not in summary(make(points_crs=plain["frame"]), shown=["points"])


def test_angular_systems_have_more_decimals(plain, make) -> None:
    plain["points"][1] |= {"crs_x": 2.3488, "crs_y": 48.8534}
    assert "  2.348800000       48.853400000" in summary(make(points_crs_unit="degree"), shown=["points"])


def test_precisions_in_the_input_system_when_known(plain, make) -> None:
    plain["points"][1] |= {"crs_sx": 0.0031, "crs_sy": 0.0022, "crs_sz": 0.0013}
    line = line_with(summary(make(), shown=["points"]), "B", "650100.0000")
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
    told = summary(make(iterations=plain["iterations"] * 20, diagnosis=found, warnings=text, notes=text))
    assert len(told.splitlines()) <= LINES
    assert line_with(told, "weakest").split()[4] == "P499,"


def test_a_solution_that_did_not_converge_cannot_be_overlooked(make) -> None:
    assert "NOT CONVERGED after 2 iterations" in summary(make(converged=False))


def test_no_redundancy_is_said(make) -> None:
    text = summary(make(redundancy=0, sigma0=None, global_test=None))
    assert "not tested" in text
    assert "nothing checks it" in text


def test_the_files_are_named(record) -> None:
    assert "Written: a.json, a.html" in summary(record, ["a.json", "a.html"])
    assert "Written: nothing" in summary(record)


def test_the_number_that_is_tested_is_shown_when_it_is_another(make, plain) -> None:
    text = summary(make(global_test=plain["global_test"] | {"sigma0": 1.4}), detail="verbose")
    assert line_with(text, "of the solution").endswith("1.25")
    told = (
        "at 95 %: 1.4, the residuals of known points included; between 0.348 and 1.669 is expected: accepted"
    )
    assert told in text
    assert "known points included" not in summary(make(), detail="verbose")


def test_warnings_are_shown_and_counted(make) -> None:
    text = summary(make(warnings=[f"w{k}" for k in range(5)], notes=[f"n{k}" for k in range(5)]))
    assert text.count("Warning: ") == 3
    assert "and 2 more warnings" in text
    assert "and 3 more notes (-v tells them)" in text


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
    assert line_with(summary(wrong), "weakest").split()[2:4] == ["3.20", "mm"]  # 4 mm over sigma0 of 1.25
    assert line_with(summary(make(precision="a posteriori")), "weakest").split()[2:4] == ["4.00", "mm"]
