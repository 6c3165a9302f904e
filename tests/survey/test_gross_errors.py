"""Gross errors are announced with their likely cause; honest networks raise no alarm."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.records.shown_units import ShownUnits
from obseq.report.units import Units
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.lengths import DH, DIST
from obseq.survey.screening import search, trials
from obseq.survey.screening.findings import Cause
from obseq.survey.screening.values import COORDINATE, GON, explain, variants

SINGLE = ["one_in_degrees", "one_elevation", "one_in_millimetres", "one_digit", "exchanged_digits"]
SIGHTS = ["wrong_target", "exchanged_targets"]
OF_MANY = ["all_in_degrees", "station_in_degrees", "all_elevations", "all_elevations_in_degrees"]
OF_MANY += ["all_in_millimetres", "all_in_feet", "swapped_coordinates", "all_coordinates_swapped"]
OF_MANY += ["exchanged_known_points", "mistyped_coordinate"]


@pytest.mark.parametrize("seed", [2, 8, 11])
@pytest.mark.parametrize("mistake", SINGLE + SIGHTS)
def test_a_wrong_observation_is_named_with_its_cause(planted, mistake, seed):
    count = planted.counted(getattr(planted, mistake), range(seed, seed + 1))
    assert (count.named, count.first) == (1, 1)


@pytest.mark.slow(reason="dozens of causes are tried, each on the whole network")
@pytest.mark.parametrize("mistake", OF_MANY)
def test_one_cause_of_many_contradictions_is_named(planted, mistake):
    """In the two least of the first fifteen networks, which have the fewest observations to tell it by."""
    for seed in (8, 11):
        count = planted.counted(getattr(planted, mistake), range(seed, seed + 1))
        assert (count.named, count.first) == (1, 1)


def test_honest_networks_raise_no_alarm(planted):
    assert planted.counted(None, range(100, 105)).announced == 0


def spoilt(planted, folder, mistake, seed=11):
    random = np.random.default_rng(seed)
    site = planted.made_site(random)
    return site, getattr(planted, mistake)(site, random), site.write(folder)


def test_the_command_announces_adjusts_and_returns_1(planted, tmp_path, capsys):
    _, _, (obs, cor) = spoilt(planted, tmp_path, "one_digit")
    command = ["adjust", "--obs", str(obs), "--cor", str(cor)]
    command += ["--frame", planted.FRAME, "--points-crs", planted.PLANE]
    assert main([*command, "--json", str(tmp_path / "a.json")]) == 1
    shown = capsys.readouterr().out
    assert "GROSS ERRORS are suspected (1, the worst first):" in shown
    assert "one digit is wrong" in shown
    found = json.loads((tmp_path / "a.json").read_text())["gross_errors"]
    assert [(item["cause"], item["size"] > 10.0) for item in found] == [("mistyped", True)]
    assert main([*command, "--strict"]) == 2
    assert "one digit is wrong" in capsys.readouterr().err


def test_values_are_told_in_the_units_of_the_reports(planted, tmp_path, capsys):
    """The same networks in feet and degrees: what is suspected has no metres nor gon in it."""
    _, _, (obs, cor) = spoilt(planted, tmp_path, "one_digit")
    command = ["adjust", "--obs", str(obs), "--cor", str(cor), "--frame", planted.FRAME]
    texts = []
    for units in (["m", "gon"], ["ft", "degree"]):
        main([*command, "--points-crs", planted.PLANE, "--units", *units, "--json", str(tmp_path / "a.json")])
        (error,) = json.loads((tmp_path / "a.json").read_text())["gross_errors"]
        assert error["text"] in " ".join(capsys.readouterr().out.split())
        texts.append(re.fullmatch(r"the others give (\S+) (\S+), it is (\S+) (\S+) off; .*", error["text"]))
    metric, other = texts
    factor = {"m": 1 / 0.3048, "gon": 0.9}[metric[2]]
    assert other[2] == other[4] == {"m": "ft", "gon": "deg"}[metric[2]]
    for k in (1, 3):
        assert float(other[k]) == pytest.approx(factor * float(metric[k]), abs=2e-4)


def test_strict_refuses_gross_errors_and_the_rest_is_adjusted_without(planted, tmp_path):
    site, mistake, _ = spoilt(planted, tmp_path, "one_elevation")
    with pytest.raises(InputError, match="elevation instead of a zenith angle"):
        site.read(tmp_path).adjust(strict=True)
    adjustment = site.read(tmp_path).adjust()
    assert mistake.is_named_by(site.read(tmp_path).gross_errors()[0], site.read(tmp_path))
    assert adjustment.gross_errors[0].cause == "elevation for zenith angle"
    assert "elevation instead of a zenith angle" in adjustment.gross_errors[0].text
    assert not any("elevation instead" in text for text in adjustment.warnings)


def test_several_gross_errors_come_worst_first(planted, tmp_path):
    random = np.random.default_rng(11)
    site = planted.made_site(random)
    done = [planted.one_in_millimetres(site, random), planted.one_elevation(site, random)]
    network = site.read(tmp_path)
    errors = network.gross_errors()
    assert len(errors) == 2
    assert errors[0].size > errors[1].size
    assert all(any(mistake.is_named_by(error, network) for error in errors) for mistake in done)


def test_what_was_not_tried_on_a_large_network_is_said(planted, tmp_path, monkeypatch):
    site = planted.made_site(np.random.default_rng(11))
    site.write(tmp_path)
    network = site.read(tmp_path)
    middle = np.nanmean(network.points.coordinates, axis=0)
    wrong = middle + [1.37, 1.0, 1.0] * (network.points.coordinates - middle)
    network = replace(network, points=replace(network.points, coordinates=wrong))
    monkeypatch.setattr(trials, "_MOST_WORK", 1)
    (error,) = network.gross_errors()
    assert "no single cause explains them (not tried, since the network is large: " in error.text
    assert "more mistakes of known points" in error.text and "groups from all " in error.text


def test_only_the_worst_are_explained_one_by_one(planted, tmp_path, monkeypatch):
    random = np.random.default_rng(11)
    site = planted.made_site(random)
    planted.one_in_millimetres(site, random)
    planted.one_elevation(site, random)
    network = site.read(tmp_path)
    monkeypatch.setattr(search, "_MOST_SINGLES", 1)
    first, second = network.gross_errors()
    assert first.size > second.size
    assert second.what.startswith("1 of ") and "only the 1 worst are explained" in second.text


@pytest.mark.parametrize(
    ("kind", "read", "expected", "cause", "words"),
    [
        (HZ, 45.0, 50.0, Cause.UNITS, "degrees instead of gon"),
        (ZEN, 2.5, 97.5, Cause.ELEVATION, "elevation"),
        (ZEN, 302.5, 97.5, Cause.SENSE, "other face"),
        (HZ, 350.0, 50.0, Cause.SENSE, "anticlockwise"),
        (HZ, 250.0, 50.0, Cause.SENSE, "200 gon off"),
        (HZ, 123.4567, 123.4767, Cause.MISTYPED, "one digit"),
        (HZ, 312.4567, 321.4567, Cause.MISTYPED, "two digits are exchanged"),
        (DIST, 100250.0, 100.25, Cause.UNITS, "millimetres"),
        (DIST, 328.9, 328.9 * 0.3048, Cause.UNITS, "feet"),
        (DIST, 1002.5, 100.25, Cause.MISTYPED, "decimal point"),
        (DIST, 123.456, 132.456, Cause.MISTYPED, "two digits are exchanged"),
        (DH, -1.234, 1.234, Cause.SENSE, "the sign"),
        (DH, 1234.0, 1.234, Cause.UNITS, "millimetres"),
    ],
)
def test_slips_that_turn_one_value_into_another(kind, read, expected, cause, words):
    unit = GON if kind.is_angle else 1.0
    tolerance = 0.005 / GON if kind.is_angle else 0.003
    found = explain(kind, read / unit, expected / unit, tolerance)
    assert found is not None
    assert (found.cause, words in found.text) == (cause, True), found


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
