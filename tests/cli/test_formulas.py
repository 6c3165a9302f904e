import subprocess
import sys

import pytest

import obseq
from obseq.cli.main import main
from obseq.kernels import load


def test_every_formula_is_listed_with_its_meaning(capsys) -> None:
    assert main(["formulas"]) == 0
    rows = [line.split(maxsplit=3) for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows[1:]] == list(obseq.formula_names())
    assert ["TopoHz", "9", "1"] in [row[:3] for row in rows]
    assert all(len(row) == 4 for row in rows[1:])


def test_one_formula_is_shown_in_full(capsys) -> None:
    assert main(["formulas", "TopoHz"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("TopoHz: Horizontal direction of a target")
    assert "  sight = R_station^T (P_to - Ci)\n  v_val = wrap(atan2(sight_x, sight_y) - val)\n" in text
    assert "station.rotation     Rotation   rad              Wi_x, Wi_y, Wi_z" in text
    assert "observations\n  hz                   Scalar     rad              val\n" in text
    assert "source: MMVII Formulas_Topo.h" in text


def test_every_formula_has_an_equation_and_a_source() -> None:
    for name in obseq.formula_names():
        formula = load(name)
        assert " = " in formula.equation or not formula.residuals, name
        assert formula.source, f"{name}: its class has no source"


def test_an_unknown_name_gives_close_ones(capsys) -> None:
    assert main(["formulas", "TopoHs"]) == 2
    assert "TopoHz" in capsys.readouterr().err


def test_equations_are_shown_without_sympy() -> None:
    script = (
        "import sys\nsys.modules['sympy'] = None\n"
        "from obseq.cli.main import main\nsys.exit(main(['formulas', 'TopoZen']))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "atan2(horizontal, sight_z)" in done.stdout


@pytest.mark.parametrize("degree", ["99999999", "9" * 5000])
@pytest.mark.parametrize("program", [["formulas"], ["check-derivatives"]])
def test_a_degree_that_no_machine_could_build_is_refused_shortly(program, degree: str, capsys) -> None:
    assert main([*program, f"EqColinearityCamPPC_Stenope_Dist_Rad{degree}_Dec1_XY1"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("obseq: ")
    assert "Traceback" not in err
    assert len(err) < 400
