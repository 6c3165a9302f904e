"""A result that is none is not made known points of, and one in which something is wrong is told as that."""

import csv
from importlib.resources import files
from pathlib import Path

import pytest

from obseq.cli.main import main
from obseq.report.result_file import read_json

DATA = files("obseq.survey") / "data"


@pytest.fixture
def result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The result of the demo, in which nothing is wrong."""
    path = tmp_path / "result.json"
    known = ["--cor", str(DATA / "demo.cor"), "--points-crs", "IGNF:LAMB93"]
    assert main(["adjust", "--obs", str(DATA / "demo.obs"), *known, "--json", str(path)]) == 0
    capsys.readouterr()
    return path


def test_a_good_result_becomes_points(result, capsys):
    assert main(["convert", str(result), "--to", str(result.with_suffix(".cor"))]) == 0
    assert capsys.readouterr().out.startswith("Written: ")


def test_what_did_not_converge_is_refused(result, capsys):
    result.write_text(result.read_text().replace('"converged": true', '"converged": false'))
    assert main(["convert", str(result), "--to", str(result.with_suffix(".cor"))]) == 2
    assert "did not converge, and its coordinates are no result" in capsys.readouterr().err
    assert not result.with_suffix(".cor").exists()


def test_a_suspected_error_is_told(tmp_path, capsys):
    observations, path = tmp_path / "n.obs", tmp_path / "result.json"
    observations.write_text((DATA / "demo.obs").read_text().replace("22.82", "22.32"))
    known = ["--cor", str(DATA / "demo.cor"), "--points-crs", "IGNF:LAMB93"]
    assert main(["adjust", "--obs", str(observations), *known, "--json", str(path)]) == 1
    capsys.readouterr()
    assert main(["convert", str(path), "--to", str(tmp_path / "n.cor")]) == 1
    assert "gross errors are suspected, which spoil these coordinates" in capsys.readouterr().out


def test_a_table_of_observations_holds_the_observations_of_a_result(result, capsys):
    record, path = read_json(result), result.with_name("x.obs.csv")
    assert main(["convert", str(result), "--to", str(path)]) == 0
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [(row["type"], row["from"], row["to"]) for row in rows] == [
        (row.type, row.origin, row.target) for row in record.observations
    ]
    assert [float(row["residual"]) for row in rows] == [row.residual for row in record.observations]
    assert [row["active"] for row in rows] == [str(int(row.active)) for row in record.observations]
    capsys.readouterr()
    assert main(["adjust", str(path)]) == 2  # set-ups and heights of instruments are not in a result
    assert "column rejected is unknown" in capsys.readouterr().err
