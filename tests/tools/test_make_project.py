"""The projects that are made up, and the commands that the documentation runs on them."""

import importlib
import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.project import read_control_points
from obseq.project.topo import read_topo

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```sh (\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def _commands(example: str) -> list[list[str]]:
    text = (ROOT / "docs" / "survey-and-images.md").read_text()
    lines = [line for name, body in BLOCK.findall(text) if name == example for line in body.splitlines()]
    return [shlex.split(line)[1:] for line in lines if line]


@pytest.fixture
def maker(monkeypatch, tmp_path):
    """The tool; commands run in the folder of the project."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    monkeypatch.chdir(tmp_path)
    return importlib.import_module("make_project")


def _run(example: str, capsys) -> dict[str, list[tuple[int, str]]]:
    """Exit code and output of each command."""
    found: dict[str, list[tuple[int, str]]] = {}
    for words in _commands(example):
        code = main(words)
        said = capsys.readouterr()
        assert code in (0, 1), said.err
        found.setdefault(words[0], []).append((code, said.out))
    return found


def _normalised(record, truth):
    """What was found minus the truth, in sigmas: centres, points, calibrations."""
    upper = [0, 3, 5]
    centres = [
        (np.array(image["centre"]) - truth["centres"][image["name"]]) / image["centre_sigmas"]
        for image in record["images"]
    ]
    points = [
        (np.array([point[axis] for axis in "xyz"]) - truth["points"][point["name"]])
        / np.sqrt([point["covariance"][k] for k in upper])
        for point in record["points"]
    ]
    cameras = [
        (parameter["value"] - value) / parameter["sigma"]
        for camera in record["cameras"]
        for parameter, value in zip(camera["parameters"], truth["cameras"][camera["name"]], strict=True)
    ]
    return np.ravel(centres), np.ravel(points), np.array(cameras)


@pytest.mark.slow  # a whole project, from rules to results
def test_two_cameras_on_a_bar_are_adjusted_by_the_documented_commands(maker, tmp_path, capsys):
    maker.bar_project(tmp_path, exposures=8, targets=40, blunders=2, seed=1)
    found = _run("example4", capsys)
    assert [code for code, _ in found["bundle-adjust"]] == [1, 1]  # the blunders are named
    record = json.loads((tmp_path / "result.json").read_text())
    truth = json.loads((tmp_path / "truth.json").read_text())
    assert record["sigma0"] == pytest.approx(1.0, abs=0.15)
    for off in _normalised(record, truth):
        assert np.abs(off).max() < 4.5
        assert np.sqrt(np.mean(off**2)) < 1.6
    assert sum(measure.get("weight", 1.0) < 0.01 for measure in record["measures"]) == 2
    assert len(read_control_points(tmp_path / "MMVII-PhgrProj/ObjCoordWorld/Adjusted")) == 43
    adjusted, given = (read_topo(tmp_path / "MMVII-PhgrProj/Topo" / name) for name in ("FieldOut2", "Field"))
    assert len(adjusted.observations) == len(given.observations)


def test_a_car_is_found_by_the_documented_commands(maker, tmp_path, capsys):
    maker.car_project(tmp_path, targets=24, blunders=1, seed=2)
    found = _run("example3", capsys)
    assert [code for code, _ in found["bundle-adjust"]] == [1, 0]  # the blunder is named
    truth = json.loads((tmp_path / "truth.json").read_text())["points"]
    points = read_control_points(tmp_path / "MMVII-PhgrProj/ObjCoordWorld/CarOut")
    assert points.names[-1] == "car"
    off = points.coordinates - [truth[name] for name in points.names]
    assert np.abs(off).max() < 0.003
    # the cameras are held: what they are off by is not in the covariances
    assert np.abs(off / points.sigmas).max() < 8.0
    shapes = [
        np.linalg.norm(np.diff(xyz, axis=0), axis=1) for xyz in (points.coordinates, points.coordinates - off)
    ]
    np.testing.assert_allclose(*shapes, atol=0.0012)


def test_an_observation_of_the_survey_that_has_no_place_is_named(maker, tmp_path, capsys):
    maker.car_project(tmp_path, targets=12, blunders=0, seed=3)
    for words in _commands("example3"):
        if words[0] == "bundle-adjust" and "TopoDirIn=Car" in words:
            (tmp_path / "MMVII-PhgrProj/Topo/Car/more.obs").write_text("3 nobody nowhere 12.5 0.001\n")
            capsys.readouterr()
            assert main(words) == 2
            assert "nobody" in capsys.readouterr().err
            assert not (tmp_path / "MMVII-PhgrProj/Ori/BA2").exists()
            return
        main(words)
