import json
from pathlib import Path

import pytest

from obseq.cli.main import main
from obseq.kernels import awkward, derivatives
from obseq.kernels.awkward import AwkwardCheck
from obseq.kernels.derivatives import DerivativeCheck


def test_right_derivatives_are_exit_code_0(tmp_path: Path, capsys) -> None:
    assert main(["check-derivatives", "TopoDist", "Dist3D", "--json", str(tmp_path / "d.json")]) == 0
    out = capsys.readouterr().out
    assert "all 2 passed" in out and "all 2 are their formulas" in out
    assert "TopoDist has no derivative: one point" in out
    table = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    assert table["format"] == "obseq-derivative-checks"
    assert {row["name"] for row in table["formulas"]} == {"TopoDist", "Dist3D"}
    assert all(row["slope_error"] < 1e-12 and row["singular"] == ["one point"] for row in table["formulas"])
    assert all(row["passed"] and 0.0 < row["worst_relative_error"] < 1e-9 for row in table["formulas"])


@pytest.mark.parametrize("error", [3.4e-5, float("inf")])
def test_a_wrong_derivative_is_exit_code_1(error, tmp_path: Path, monkeypatch, capsys) -> None:
    wrong = DerivativeCheck("TopoHz", error, "val", "Wi_y", False)
    monkeypatch.setattr(derivatives, "check", lambda *_, **__: [wrong])
    monkeypatch.setattr(awkward, "check", lambda *_, **__: [])
    assert main(["check-derivatives", "--json", str(tmp_path / "d.json")]) == 1
    out = capsys.readouterr().out
    assert "val by Wi_y  FAILED" in out
    assert "1 of 1 failed" in out
    json.loads((tmp_path / "d.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)


def test_an_unknown_formula_is_exit_code_2(capsys) -> None:
    assert main(["check-derivatives", "TopoHs"]) == 2
    assert "TopoHz" in capsys.readouterr().err


def test_a_kernel_that_is_not_its_formula_is_exit_code_1(monkeypatch, capsys) -> None:
    wrong = AwkwardCheck("Dist3D", float("inf"), "half turn", 0.0, "anywhere", ())
    monkeypatch.setattr(awkward, "check", lambda *_, **__: [wrong])
    assert main(["check-derivatives", "Dist3D", "--samples", "2"]) == 1
    assert "inf  half turn" in (out := capsys.readouterr().out) and "1 of 1 failed" in out


def test_without_the_generator_it_says_what_is_not_compared(monkeypatch, capsys) -> None:
    monkeypatch.setattr("obseq.cli.check_derivatives.missing", lambda *_: ["sympy"])
    assert main(["check-derivatives", "Dist3D", "--samples", "2"]) == 0
    assert 'that needs pip install "obseq[gencode]"' in capsys.readouterr().out
