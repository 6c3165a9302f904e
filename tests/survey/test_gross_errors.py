"""Gross errors are named where they are, with the slip behind them; honest networks raise no alarm."""

import json
import math

import numpy as np
import pytest
from verdicts import MISTYPED, codes, lines

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.records.shown_units import ShownUnits
from obseq.report.tables.units import Units
from obseq.survey.causes.values import COORDINATE, GON, explain, variants
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.lengths import DH, DIST

SINGLE = ["one_in_degrees", "one_elevation", "one_in_millimetres", "one_digit", "exchanged_digits"]
SIGHTS = ["wrong_target", "exchanged_targets"]
OF_MANY = [
    "all_in_degrees",
    "all_in_millimetres",
    "all_in_feet",
    "all_elevations",
    "all_elevations_in_degrees",
    "station_anticlockwise",
    "exchanged_known_points",
    "mistyped_coordinate",
]


@pytest.mark.parametrize("mistake", SINGLE + SIGHTS)
def test_a_wrong_observation_is_named_with_its_cause(planted, mistakes, mistake):
    """Of one network; `bench_gross_errors` counts those of many."""
    count = planted.counted(getattr(mistakes, mistake), range(8, 9))
    assert (count.named, count.first) == (1, 1)


@pytest.mark.slow(reason="a dozen rewritings are tried, each on the whole network")
@pytest.mark.parametrize("mistake", OF_MANY)
def test_one_cause_of_many_contradictions_is_named(planted, mistakes, mistake):
    """Of one network; `bench_gross_errors` counts those of many."""
    count = planted.counted(getattr(mistakes, mistake), range(11, 12))
    assert (count.named, count.first) == (1, 1)


def test_honest_networks_raise_no_alarm(planted):
    assert planted.counted(None, range(100, 102)).announced == 0


def spoilt(planted, mistakes, folder, mistake, seed=11):
    random = np.random.default_rng(seed)
    site = planted.made_site(random)
    return site, getattr(mistakes, mistake)(site, random), site.write(folder)


def test_the_command_announces_adjusts_and_returns_1(planted, mistakes, tmp_path, capsys):
    _, mistake, (obs, cor) = spoilt(planted, mistakes, tmp_path, "one_digit")
    command = ["adjust", "--obs", str(obs), "--cor", str(cor)]
    command += ["--frame", mistakes.FRAME, "--points-crs", mistakes.PLANE]
    assert main([*command, "--json", str(tmp_path / "a.json")]) == 1
    shown = capsys.readouterr().out
    found = json.loads((tmp_path / "a.json").read_text())["diagnosis"]
    (one,) = found["accused"]
    assert found["status"] == "explained" and one["code"] == "S100"
    assert {row["line"] for row in one["observations"]} == mistake.lines
    assert {slip["code"] for slip in one["slips"]} & MISTYPED and one["test"] > one["limit"]
    assert one["text"][1:] in " ".join(shown.split())
    assert main([*command, "--strict"]) == 2
    assert one["text"] in capsys.readouterr().err


def test_sizes_are_told_in_the_units_of_the_reports(planted, mistakes, tmp_path):
    """The same network in feet and degrees: what is suspected has no metres nor gon in it."""
    _, _, (obs, cor) = spoilt(planted, mistakes, tmp_path, "one_digit")
    command = ["adjust", "--obs", str(obs), "--cor", str(cor), "--frame", mistakes.FRAME]
    told = []
    for units in (["m", "gon"], ["ft", "degree"]):
        main(
            [*command, "--points-crs", mistakes.PLANE, "--units", *units, "--json", str(tmp_path / "a.json")]
        )
        (error,) = json.loads((tmp_path / "a.json").read_text())["diagnosis"]["accused"]
        told.append((error["size"], error["text"].split()[3].strip(":;")))
    assert told[0][0] == pytest.approx(told[1][0])
    assert {told[0][1]: told[1][1]}.items() <= {("m", "ft"), ("gon", "deg"), ("mgon", "sec"), ("mm", "ft")}


def test_strict_refuses_gross_errors_and_the_rest_is_adjusted_without(planted, mistakes, tmp_path):
    site, mistake, _ = spoilt(planted, mistakes, tmp_path, "one_elevation")
    with pytest.raises(InputError, match="elevation"):
        site.read(tmp_path).adjust(strict=True)
    adjustment = site.read(tmp_path).adjust()
    (error,) = adjustment.gross_errors
    assert lines(error) == mistake.lines and "W103" in codes(error)
    assert adjustment.residuals.shape == (len(adjustment.book.observations),)  # all take part all the same


def test_several_gross_errors_come_clearest_first(planted, mistakes, tmp_path):
    random = np.random.default_rng(11)
    site = planted.made_site(random)
    done = [mistakes.one_in_millimetres(site, random), mistakes.one_elevation(site, random)]
    errors = site.read(tmp_path).gross_errors()
    assert len(errors) == 2
    assert errors[0].test / errors[0].limit > errors[1].test / errors[1].limit
    assert all(any(mistake.is_named_by(error) for error in errors) for mistake in done)


def test_a_failing_diagnosis_takes_no_result_away(planted, mistakes, tmp_path, monkeypatch):
    from obseq.survey import fieldwork

    def failing(*_):
        raise ZeroDivisionError

    site, _, _ = spoilt(planted, mistakes, tmp_path, "one_digit")
    monkeypatch.setattr(fieldwork, "record_of", failing)
    adjustment = site.read(tmp_path).adjust()
    assert adjustment.converged and np.isfinite(adjustment.sigma0)
    assert adjustment.diagnosis.status == "undecided" and not adjustment.is_complete
    assert any("the diagnosis failed" in text for text in adjustment.warnings)


@pytest.mark.parametrize(
    ("kind", "read", "expected", "code", "words"),
    [
        (HZ, 45.0, 50.0, "W100", "degrees read as gon"),
        (ZEN, 2.5, 97.5, "W103", "elevation"),
        (ZEN, 302.5, 97.5, "W102", "other face"),
        (HZ, 350.0, 50.0, "W131", "anticlockwise"),
        (HZ, 250.0, 50.0, "W102", "other face"),
        (HZ, 123.4567, 123.9567, "W109", "one digit"),
        (HZ, 312.4567, 321.4567, "W110", "two digits are exchanged"),
        (DIST, 100250.0, 100.25, "W126", "millimetres"),
        (DIST, 328.9, 328.9 * 0.3048, "W106", "feet"),
        (DIST, 1002.5, 100.25, "W129", "decimal point"),
        (DIST, 123.456, 132.456, "W110", "two digits are exchanged"),
        (DH, -1.234, 1.234, "W105", "the sign, or the order"),
        (COORDINATE, -1.234, 1.234, "W105", "its sign is wrong"),
        (DH, 1234.0, 1.234, "W126", "millimetres"),
    ],
)
def test_slips_that_turn_one_value_into_another(kind, read, expected, code, words):
    unit = GON if kind.is_angle else 1.0
    tolerance = 0.005 / GON if kind.is_angle else 0.003
    found = explain(kind, read / unit, expected / unit, tolerance)
    assert found is not None
    assert (found.code, words in found.text) == (code, True), found


def test_noise_and_accidents_are_not_explained():
    assert explain(HZ, 1.0, 1.2345, 1e-4) is None
    # with a tolerance of metres, every digit would do
    assert explain(DIST, 100.0, 137.0, 5.0) is None


def test_variants_leave_out_what_noise_would_do():
    assert all(abs(right - 12.34) > 0.2 for _, right in variants(12.34, 2, 0.1))
    assert ("two digits are exchanged", 21.34) in list(variants(12.34, 2, 0.1))
    assert ("one digit is wrong", -12.94) in list(variants(-12.34, 2, 0.1))


@pytest.mark.parametrize(
    ("unit", "kind", "read", "right", "text"),
    [
        ("dms", HZ, 105.5, 195.5, "one digit is wrong"),
        ("dms", HZ, 95.0 + 42.0 / 60.0, 95.0 + 32.0 / 60.0, "one digit is wrong"),
        ("dms", HZ, 95.0 + 23.0 / 60.0, 95.0 + 32.0 / 60.0, "two digits are exchanged"),
        ("dms", HZ, 185.5, 95.5, None),  # 100 gon, and 815 is no reading
        ("degree", HZ, 195.544395, 95.544395, "one digit is wrong"),
        ("ft", DIST, 789.9485, 689.9485, "one digit is wrong"),
        ("ft", COORDINATE, 3817.3922, 3871.3922, "two digits are exchanged"),
    ],
)
def test_digits_are_those_that_were_written(unit, kind, read, right, text):
    """Whatever the units of the report are."""
    is_ft, size = unit == "ft", 0.3048 if unit == "ft" else math.pi / 180.0
    units = Units(ShownUnits(), ShownUnits("ft") if is_ft else ShownUnits(angle=unit))
    found = explain(kind, read * size, right * size, 0.002 if is_ft else 3e-5, units)
    assert (found and found.text) == text
