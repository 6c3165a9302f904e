"""One undetermined point does not stop the rest: it is left out, and said so."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network

FRAME = "RTL*657700*6860700*0*IGNF:LAMB93"
DEMO = files("obseq.survey") / "data"


def network(folder: Path, more: str, points: str = "") -> Network:
    """The demo with more observations and points."""
    (folder / "net.obs").write_text((DEMO / "demo.obs").read_text() + more)
    (folder / "net.cor").write_text((DEMO / "demo.cor").read_text() + points)
    return Network.read(folder / "net.obs", folder / "net.cor", FRAME, "IGNF:LAMB93")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return network(tmp_path_factory.mktemp("demo"), "").adjust()


def same_as_demo(adjusted, demo):
    assert adjusted.points.names == demo.points.names
    np.testing.assert_allclose(adjusted.points.coordinates, demo.points.coordinates, rtol=0, atol=1e-9)
    assert adjusted.sigma0 == pytest.approx(demo.sigma0, rel=1e-9)


def test_what_cannot_be_placed_is_left_out_with_its_station_and_observations(tmp_path, demo):
    adjusted = network(tmp_path, "#NEW\n5 PtA X 12 0.001\n7 X PtB 12 0.001\n5 X Y 20 0.001\n").adjust()
    same_as_demo(adjusted, demo)
    x, y = adjusted.left_out
    assert (x.name, y.name, len(x.observations), len(y.observations)) == ("X", "Y", 3, 1)
    assert "it has only one reading to PtB; a resection needs" in x.reason
    assert [label.split(" (")[0] for label in x.observations] == ["Hz PtA -> X", "Hz X -> PtB", "Hz X -> Y"]
    assert any("point X is left out" in warning for warning in adjusted.warnings)
    record = adjusted.to_dict()
    assert [item["name"] for item in record["left_out"]] == ["X", "Y"]
    unused = [row["line"] for row in record["observations"] if not row["active"]]
    assert unused == [17, 18, 19]


def test_leaving_one_out_leaves_out_those_that_depend_on_it(tmp_path, demo):
    points = "0 X 657800 6860700 10\n0 Y 657800 6860800 10\n"
    lines = "3 PtA X 100 0.01\n3 X Y 100 0.01\n3 PtA Y 141 0.01\n3 PtD Y 148 0.01\n"
    result = network(tmp_path, lines, points).adjust()
    same_as_demo(result, demo)
    assert {item.name for item in result.left_out} == {"X", "Y"}


def test_three_distances_to_one_known_line_leave_a_point_out(tmp_path, demo):
    points = "1 Z 657700 6860600 10 0.001\n0 X 657800 6860650 10\n"
    observations = "3 PtA X 111.8 0.01\n3 PtD X 107.7 0.01\n3 Z X 111.8 0.01\n"
    adjusted = network(tmp_path, observations, points).adjust()
    assert [item.name for item in adjusted.left_out] == ["X"]
    assert "singular" in adjusted.left_out[0].reason
    kept = dict(zip(adjusted.points.names, adjusted.points.coordinates, strict=True))
    for name, xyz in zip(demo.points.names, demo.points.coordinates, strict=True):
        np.testing.assert_allclose(kept[name], xyz, rtol=0, atol=1e-8)


def test_an_unused_point_of_the_file_is_named(tmp_path, demo):
    adjusted = network(tmp_path, "", "0 Unused 657800 6860700 10\n").adjust()
    same_as_demo(adjusted, demo)
    assert [item.what for item in adjusted.left_out] == ["point Unused"]


def test_strict_refuses(tmp_path):
    with pytest.raises(InputError, match="point X: "):
        network(tmp_path, "#NEW\n5 PtA X 12 0.001\n").adjust(strict=True)


def test_the_command_says_so_and_returns_1(tmp_path, capsys):
    network(tmp_path, "#NEW\n5 PtA X 12 0.001\n")
    command = ["adjust", "--obs", str(tmp_path / "net.obs"), "--cor", str(tmp_path / "net.cor")]
    command += ["--frame", FRAME, "--points-crs", "IGNF:LAMB93"]
    assert main([*command, "--json", str(tmp_path / "a.json"), "--text", str(tmp_path / "a.txt")]) == 1
    shown = capsys.readouterr().out
    assert "point X is left out: " in shown
    assert "point X is left out: " in (tmp_path / "a.txt").read_text()
    assert json.loads((tmp_path / "a.json").read_text())["left_out"][0]["what"] == "point X"
    assert main([*command, "--strict"]) == 2
    assert "point X" in capsys.readouterr().err


def test_a_levelling_whose_new_points_are_not_listed_is_told_how_to_list_them(tmp_path):
    (tmp_path / "l.cor").write_text("5 A 0 0 10 0.001\n")
    (tmp_path / "l.obs").write_text("4 A B 1.001 0.001\n4 B C 1.5 0.001\n4 C A -2.5 0.001\n")
    with pytest.raises(InputError, match=r"Plain levelling needs no plan: list each new point with flag 4"):
        Network.read(tmp_path / "l.obs", tmp_path / "l.cor").adjust()


def test_a_point_that_is_only_levelled_is_told_the_flag_it_needs(tmp_path):
    (tmp_path / "l.cor").write_text("1 A 0 0 10 0.001\n0 B 0 0 11\n")
    (tmp_path / "l.obs").write_text("4 A B 1.001 0.001\n4 B A -1.001 0.001\n")
    with pytest.raises(InputError, match="only levelled, give it flag 4"):
        Network.read(tmp_path / "l.obs", tmp_path / "l.cor").adjust()
