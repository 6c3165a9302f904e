import json
from pathlib import Path

import pytest

from obseq.cli.main import main
from obseq.kernels import derivatives
from obseq.kernels.derivatives import DerivativeCheck


def test_right_derivatives_are_exit_code_0(tmp_path: Path, capsys) -> None:
    assert main(["check-derivatives", "TopoDist", "Dist3D", "--json", str(tmp_path / "d.json")]) == 0
    assert "all 2 passed" in capsys.readouterr().out
    table = json.loads((tmp_path / "d.json").read_text(encoding="utf-8"))
    assert table["format"] == "obseq-derivative-checks"
    assert {row["name"] for row in table["formulas"]} == {"TopoDist", "Dist3D"}
    assert all(row["passed"] and 0.0 < row["worst_relative_error"] < 1e-9 for row in table["formulas"])


@pytest.mark.parametrize("error", [3.4e-5, float("inf")])
def test_a_wrong_derivative_is_exit_code_1(error, tmp_path: Path, monkeypatch, capsys) -> None:
    wrong = DerivativeCheck("TopoHz", error, "val", "Wi_y", False)
    monkeypatch.setattr(derivatives, "check", lambda *_, **__: [wrong])
    assert main(["check-derivatives", "--json", str(tmp_path / "d.json")]) == 1
    out = capsys.readouterr().out
    assert "val by Wi_y  FAILED" in out
    assert "1 of 1 failed" in out
    json.loads((tmp_path / "d.json").read_text(encoding="utf-8"), parse_constant=pytest.fail)


def test_an_unknown_formula_is_exit_code_2(capsys) -> None:
    assert main(["check-derivatives", "TopoHs"]) == 2
    assert "TopoHz" in capsys.readouterr().err
