"""A large result goes into its folder as columns and a page; everything else is made of the columns."""

import json
from importlib.resources import files

import pytest

import obseq
from obseq.cli.main import main
from obseq.cli.open_page import page_of
from obseq.report import formats
from obseq.report.result_file import read_json, to_json
from obseq.survey import Network

DATA = files("obseq.survey") / "data"
NETWORK = [str(DATA / "demo.obs"), str(DATA / "demo.cor"), "--points-crs", "IGNF:LAMB93"]
RUNS = ("run", "phases")


@pytest.fixture
def large(monkeypatch) -> None:
    """The demo is large."""
    monkeypatch.setattr(formats, "LARGE", 3)


def plain(path):
    """The content of a result file, without what each run has for itself."""
    return {key: value for key, value in read_json(path).to_dict().items() if key not in RUNS}


def test_a_large_result_is_columns_and_a_page_and_says_so(large, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "adjustment.json").write_text("of an earlier run")
    assert main(["adjust", *NETWORK, "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["adjustment.html", "adjustment.npz"]
    told = capsys.readouterr().out
    assert f"Written: {out / 'adjustment.html'}, {out / 'adjustment.npz'}" in told
    assert "Not written, as there are more than 3 observations: adjustment.json and adjustment.txt" in told
    assert page_of(out) == out / "adjustment.html"


def test_what_is_asked_for_by_name_is_written_whatever_the_size(large, tmp_path, capsys) -> None:
    json_file, out = tmp_path / "a.json", tmp_path / "out"
    assert main(["adjust", *NETWORK, "--out", str(out), "--json", str(json_file)]) == 0
    assert plain(json_file) == plain(out / "adjustment.npz")
    assert "Not written, as there are more than 3 observations: adjustment.txt," in capsys.readouterr().out


def test_what_a_program_reads_from_standard_output_is_json_alone(large, tmp_path, capsys) -> None:
    assert main(["adjust", *NETWORK, "--out", str(tmp_path), "--json", "-"]) == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["format"] == "obseq-adjustment"
    assert "Not written, as there are more than 3 observations: adjustment.txt" in told.err


def test_a_small_result_is_what_it_was(tmp_path, capsys) -> None:
    assert main(["adjust", *NETWORK, "--out", str(tmp_path)]) == 0
    names = ["adjustment.html", "adjustment.json", "adjustment.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert "Not written" not in capsys.readouterr().out


def test_reports_points_and_pages_come_from_columns(tmp_path, capsys) -> None:
    columns, again = tmp_path / "a.npz", tmp_path / "again"
    assert main(["adjust", *NETWORK, "--npz", str(columns), "--out", str(tmp_path / "out")]) == 0
    assert main(["report", str(columns), "--out", str(again), "--show", "points"]) == 0
    for name in ("adjustment.json", "adjustment.txt", "adjustment.html"):
        assert (again / name).read_text() == (tmp_path / "out" / name).read_text()
    for source in (columns, tmp_path / "out" / "adjustment.json"):
        assert main(["convert", str(source), "--to", str(tmp_path / f"{source.stem}.csv")]) == 0
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "adjustment.csv").read_text()
    assert page_of(columns).read_text() == (again / "adjustment.html").read_text()


def test_python_saves_and_loads_columns(tmp_path) -> None:
    adjustment = Network.read(DATA / "demo.obs", DATA / "demo.cor", points_crs="IGNF:LAMB93").adjust()
    adjustment.save(tmp_path / "a.npz")
    assert json.loads(to_json(obseq.load(tmp_path / "a.npz"))) == json.loads(to_json(adjustment.record()))


def test_a_page_that_fails_costs_no_result_and_columns_that_fail_no_page(
    tmp_path, monkeypatch, capsys
) -> None:
    def broken(*_, **__):
        raise ZeroDivisionError("oh")

    monkeypatch.setattr("obseq.report.result_columns.write_columns", broken)
    out = [f"--{kind}={tmp_path / 'a'}.{kind}" for kind in ("npz", "json")]
    assert main(["adjust", *NETWORK, *out]) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    assert "a.npz failed: ZeroDivisionError: oh" in " ".join(capsys.readouterr().out.split())


def test_a_plan_is_not_columns(tmp_path, capsys) -> None:
    main(["plan", *NETWORK, "--out", str(tmp_path)])
    assert main(["report", str(tmp_path / "plan.json"), "--npz", str(tmp_path / "p.npz")]) == 2
    assert "only networks and blocks are written as columns" in capsys.readouterr().err
