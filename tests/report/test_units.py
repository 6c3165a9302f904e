"""Numbers of reports in the units of the files: metres and gon, feet and degrees."""

import csv
import json
import math
import re

import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.records.shown_units import ShownUnits, chosen_units
from obseq.report.head import shares
from obseq.report.tables import units
from obseq.survey import Network

FEET = units.Units(ShownUnits("us-ft", "dms"))
FOOT = 1200 / 3937


def test_angles_are_written_in_gon_and_their_residuals_in_milligon() -> None:
    assert units.METRIC.observed("rad", math.pi / 2) == "100.00000 gon"
    assert units.METRIC.small("rad", -math.pi / 200 * 0.0025) == "-2.500 mgon"


def test_lengths_are_written_in_metres_and_their_residuals_in_millimetres() -> None:
    assert units.METRIC.observed("m", -1.25) == "-1.2500 m"
    assert units.METRIC.small("m", 0.0123) == "12.30 mm"


def test_an_azimuth_is_within_a_turn() -> None:
    assert units.METRIC.angle.turned(-math.pi / 2) == "300.00000"
    assert units.METRIC.angle.turned(-1e-12) == "0.00000"
    assert FEET.angle.turned(-1e-12) == "0-00-00.00"
    assert FEET.angle.turned(math.radians(-0.5)) == "359-30-00.00"


def test_feet_and_degrees_minutes_seconds() -> None:
    assert FEET.observed("m", 100 * FOOT) == "100.0000 us-ft"
    assert FEET.small("m", -0.01 * FOOT) == "-0.01000 us-ft"
    assert FEET.observed("rad", math.radians(45 + 12 / 60 + 3.4 / 3600)) == "45-12-03.40 dms"
    assert FEET.observed("rad", math.radians(-(59 / 60 + 59.999 / 3600))) == "-1-00-00.00 dms"
    assert FEET.small("rad", math.radians(2.5 / 3600)) == "2.50 sec"
    assert units.Units(ShownUnits("ft", "degree")).observed("rad", math.pi) == "180.000000 deg"


def test_what_is_not_defined_is_a_dash() -> None:
    shown = units.METRIC
    assert shown.angle.turned(None) == shown.small("rad", None) == shown.small_length.number(None) == "-"
    assert units.fixed(math.nan, 2) == FEET.angle.number(None) == "-"
    assert units.significant(math.inf) == "-"


def test_no_negative_zero() -> None:
    assert units.fixed(-0.00001, 2) == "0.00"
    assert units.fixed(-0.01, 2) == "-0.01"


def test_units_are_chosen_by_words() -> None:
    assert chosen_units(["dms", "ft"], ShownUnits()) == ShownUnits("ft", "dms")
    assert chosen_units(["gon"], ShownUnits("ft", "dms")) == ShownUnits("ft", "gon")
    for words in (["inch"], ["m", "ft"], ["gon", "dms"]):
        with pytest.raises(InputError, match=r"--units .*: give one of m, ft, us-ft, or one of gon, degree"):
            chosen_units(words, ShownUnits())


SIDES = """.UNITS FeetUS DMS
.2D
C 1 5000 5000 ! !
C 2 5000 5300 ! !
C 3 5400 5000
M 1-2-3 -90-00-00 400.02 5 0.02
M 2-1-3 53-07-48 500.01 5 0.02
"""


@pytest.fixture
def feet(tmp_path):
    (tmp_path / "sides.dat").write_text(SIDES)
    return tmp_path / "sides.dat"


def test_reports_are_in_the_units_of_the_files(feet, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    assert main(["adjust", str(feet), "--out", str(out)]) == 0
    plain = json.loads((out / "adjustment.json").read_text())
    assert plain["units"] == {"length": "us-ft", "angle": "dms", "stored": "metres and radians"}
    third = plain["points"][2]
    listing = (out / "adjustment.txt").read_text()
    assert "units: us-ft; dms and sec" in listing
    row = next(line.split() for line in listing.splitlines() if line.startswith("  3  "))
    assert f"{third['x'] / FOOT:.4f}" in row
    assert f"{third['sx'] / FOOT:.5f}" in row
    assert '"units":{"length":"us-ft","angle":"dms"}' in (out / "adjustment.html").read_text()
    assert " us-ft " in capsys.readouterr().out


def test_a_stored_result_is_shown_in_other_units(feet, tmp_path, capsys) -> None:
    stored = tmp_path / "a.json"
    main(["adjust", str(feet), "--units", "m", "--json", str(stored)])
    assert "400.0200 us-ft" not in capsys.readouterr().out
    main(["report", str(stored), "--units", "us-ft", "degree", "--show", "observations"])
    shown = capsys.readouterr().out
    assert "400.0200 us-ft" in shown
    assert "53.130000 deg" in shown
    assert main(["report", str(stored), "--units", "chain"]) == 2
    assert "--units chain: give one of m, ft, us-ft" in capsys.readouterr().err


def test_plans_and_comparisons_are_in_the_units_of_the_files(feet, tmp_path, capsys) -> None:
    assert main(["plan", str(feet), "--no-gains", "--show", "weakest", "--out", str(tmp_path / "plan")]) == 0
    shown = capsys.readouterr().out
    assert ["us-ft", "deg", "deg"] in [line.split() for line in shown.splitlines()]
    (weakest,) = json.loads((tmp_path / "plan" / "plan.json").read_text())["weakest_points"]
    (row,) = [line.split() for line in shown.splitlines() if re.match("  3  +[0-9]", line)]
    assert float(row[1]) == pytest.approx(weakest["sigma"] / FOOT, abs=1e-5)
    second = tmp_path / "second.dat"
    second.write_text(SIDES.replace("400.02", "400.22"))
    main(
        [
            "compare",
            str(feet),
            "--project-2",
            str(second),
            "--show",
            "residuals",
            "--out",
            str(tmp_path / "moved"),
        ]
    )
    shown = capsys.readouterr().out
    assert ["us-ft"] * 7 in [line.split() for line in shown.splitlines()]
    record = json.loads((tmp_path / "moved" / "comparison.json").read_text())
    assert record["units"]["length"] == "us-ft"
    (moved,) = [item for item in record["displacements"] if item["point"] == "3"]
    row = next(line.split() for line in shown.splitlines() if re.match("  3  +[a-z]+ ", line))
    assert float(row[3]) == pytest.approx(moved["north"] / FOOT, abs=1e-5)


def test_plans_and_comparisons_are_in_the_units_asked_for(feet, tmp_path, capsys) -> None:
    out = tmp_path / "plan"
    assert (
        main(
            [
                "plan",
                str(feet),
                "--no-gains",
                "--show",
                "weakest",
                "--units",
                "m",
                "degree",
                "--out",
                str(out),
            ]
        )
        == 0
    )
    shown = capsys.readouterr().out
    assert ["mm", "deg", "deg"] in [line.split() for line in shown.splitlines()]
    assert "units: m and mm; deg" in (out / "plan.txt").read_text()
    second = tmp_path / "second.dat"
    second.write_text(SIDES.replace("400.02", "400.22"))
    compared = ["compare", str(feet), "--project-2", str(second)]
    main([*compared, "--units", "m", "--show", "displacements"])
    assert any(line.split()[:7] == ["mm"] * 7 for line in capsys.readouterr().out.splitlines())
    for command in (["plan", str(feet)], compared):
        assert main([*command, "--units", "m", "ft"]) == 2
        assert "--units ft: give one of m, ft, us-ft" in capsys.readouterr().err


def test_adjusted_points_come_back_from_a_table_in_feet(feet, tmp_path, capsys) -> None:
    stored, table = tmp_path / "a.json", tmp_path / "p.csv"
    main(["adjust", str(feet), "--json", str(stored)])
    assert main(["convert", str(stored), "--to", str(table)]) == 0
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert {row["unit"] for row in rows} == {"us-ft"}
    assert float(rows[1]["x"]) == pytest.approx(5300)
    (tmp_path / "o.csv").write_text("type,from,to,value,sigma,unit\nDistHz,1,3,400,0.01,us-ft\n")
    network = Network.read_project([table, tmp_path / "o.csv"])
    assert network.shown == ShownUnits("us-ft", "gon")
    assert network.points.coordinates[1, 0] == pytest.approx(5300 * FOOT, abs=1e-9)
    assert network.points.sigmas[2, 0] == pytest.approx(float(rows[2]["sx"]) * FOOT)
    capsys.readouterr()


def test_shares_are_counted_by_tenths() -> None:
    assert shares([0.0, 0.05, -0.1, 0.1, 0.95, 1.0, 1.2, None, math.nan])["values"] == [3, 1, *[0] * 7, 3]
