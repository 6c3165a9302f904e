from obseq.report import summary
from obseq.report.summary import MOST_POINTS, WIDTH


def line_with(text: str, *words: str) -> str:
    found = [line for line in text.splitlines() if all(word in line for word in words)]
    assert len(found) == 1, f"{len(found)} lines with {words} in\n{text}"
    return found[0]


def test_counts_and_sigma0(record) -> None:
    text = summary(record)
    assert line_with(text, "  observations ").split() == "observations 3 1 Dist, 2 Hz; 1 not used".split()
    assert line_with(text, "redundancy").split() == ["redundancy", "4"]
    assert line_with(text, "each iteration").split()[-2:] == ["120.5", "1.25"]
    assert line_with(text, "of the solution").endswith("1.25")
    assert "at 95 %: 1.25; between 0.348 and 1.669 is expected: accepted" in text


def test_the_worst_residual_is_the_first_of_its_table(record) -> None:
    lines = summary(record).splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("Observations by normalised residual"))
    assert lines[start + 2].split() == "Hz A C site.obs:2 26.62000 gon 1.000 mgon -3.100 mgon -3.10".split()


def test_coordinates_in_both_systems(record) -> None:
    text = summary(record)
    assert line_with(text, "B", "  100.0000").split() == "B 100.0000 50.0000 0.0000 4.00 2.00 1.00".split()
    assert line_with(text, "B", "650100.0000").split() == "B 650100.0000 6860050.0000 35.0000".split()


def test_one_table_when_the_frame_is_the_system_of_the_points(plain, make) -> None:
    text = summary(make(points_crs=plain["frame"]))
    assert "650100.0000" not in text


def test_angular_systems_have_more_decimals(plain, make) -> None:
    plain["points"][1] |= {"crs_x": 2.3488, "crs_y": 48.8534}
    assert "  2.348800000       48.853400000" in summary(make(points_crs_unit="degree"))


def test_precisions_in_the_input_system_when_known(plain, make) -> None:
    plain["points"][1] |= {"crs_sx": 0.0031, "crs_sy": 0.0022, "crs_sz": 0.0013}
    assert line_with(summary(make()), "B", "650100.0000").split()[-3:] == ["3.10", "2.20", "1.30"]


def test_a_large_network_fits_on_a_screen_and_shows_its_worst_points(plain, make) -> None:
    first = plain["points"][0]
    plain["points"] = [first | {"name": f"P{k}", "sx": 0.001 * k} for k in range(500)]
    plain["iterations"] = plain["iterations"] * 20
    lines = summary(make(), ["out/adjustment.json"]).splitlines()
    assert len(lines) < 50
    assert max(len(line) for line in lines) <= WIDTH + 10
    assert f"  and {500 - MOST_POINTS} more points, all with better precisions; the files have them" in lines
    assert sum(line.startswith("  P499 ") for line in lines) == 2


def test_a_solution_that_did_not_converge_cannot_be_overlooked(make) -> None:
    assert "NOT CONVERGED after 2 iterations" in summary(make(converged=False))


def test_no_redundancy_is_said(make) -> None:
    text = summary(make(redundancy=0, sigma0=None, global_test=None))
    assert "not tested" in text
    assert "nothing checks it" in text


def test_time_and_files(record) -> None:
    text = summary(record, ["a.json", "a.html"])
    assert "Seconds: read 0.25, adjust 1.50; 1.75 in all" in text
    assert "Written: a.json, a.html" in text


def test_the_number_that_is_tested_is_shown_when_it_is_another(make, plain) -> None:
    text = summary(make(global_test=plain["global_test"] | {"sigma0": 1.4}))
    assert line_with(text, "of the solution").endswith("1.25")
    told = (
        "at 95 %: 1.4, the residuals of known points included; between 0.348 and 1.669 is expected: accepted"
    )
    assert told in text
    assert "known points included" not in summary(make())


def test_warnings_are_shown_and_counted(make) -> None:
    text = summary(make(warnings=[f"w{k}" for k in range(5)]))
    assert text.count("Warning: ") == 3
    assert "and 2 more warnings" in text


def test_it_says_how_precisions_are_scaled(make) -> None:
    assert text_of_title(make(precision="a priori")).endswith("precisions a priori (mm)")


def text_of_title(record) -> str:
    return line_with(summary(record), "Coordinates in the computation frame")
