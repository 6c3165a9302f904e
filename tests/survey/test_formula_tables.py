"""Observations of any formula, named in tables."""

import importlib
import random
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.survey import Network

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
POINTS = "name,x,y,z,sx,sy,sz\nA,0,0,0,0,0,0\nB,10,0,0,0,0,0\nC,0,10,0,0,0,0\nP,3,4,5,,,\n"
# From A, B and C to (3, 4, 5): the roots of 50, 90 and 70. The second is 1 mm too long, in millimetres.
ROWS = [
    "formula,p1,p2,D,sigma,unit,station,active",
    f"Dist3D,A,P,{50**0.5!r},0.001,,,",
    f"Dist3D,B,P,{90**0.5 * 1e3!r},1,mm,,1",
    f"Dist3D,C,P,{70**0.5!r},0.001,m,,",
    "Dist3D,C,P,8,0.001,,,0",
]
OWN = '''
"""A formula of the user's."""
from obseq.formulas import Formula
from obseq.formulas.blocks import Length, Number, Point3
from obseq.formulas.functions import Scalar


class HeightOverLine(Formula):
    """Height of a point over the weighted mean of two others.

    Residual: `P_z - w A_z - (1 - w) B_z - h`. Defined everywhere.
    """

    source = "Definition"

    def residual(self, first: Point3, last: Point3, top: Point3, *, w: Number, h: Length) -> Scalar:
        """Height computed, minus that observed (m)."""
        return top.z - w * first.z - (1 - w) * last.z - h
'''


def network(folder, rows=ROWS, points=POINTS):
    paths = [folder / "f.csv", folder / "p.csv"]
    for path, text in zip(paths, ("\n".join(rows), points), strict=True):
        path.write_text(text)
    return Network.read_project(paths)


def test_a_formula_of_the_catalogue(tmp_path):
    given = network(tmp_path)
    assert given.book.label(1) == f"Dist3D B -> P ({tmp_path / 'f.csv'}:3)"
    adjusted = given.adjust()
    np.testing.assert_allclose(adjusted.points.coordinates[3], (3, 4, 5), rtol=0, atol=1e-8)
    records = adjusted.record().observations
    assert [(row.type, row.unit, row.active) for row in records[2:]] == [
        ("Dist3D", "m", True),
        ("Dist3D", "m", False),
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("Dist3D,B", "Dist3E,B"), "f.csv:3: no formula is named 'Dist3E'; nearest names: .*Dist3D"),
        (("Dist3D,B", "TopoAngle,B"), "f.csv:3: TopoAngle takes the points station, backsight, target and"),
        (("Dist3D,B", "Dist3DParam,B"), "f.csv:3: formula Dist3DParam: its unknown .* is no point"),
        (("unit,station", "unit,target"), "f.csv:2: Dist3D takes the points p1, p2 .* target is none"),
        (("p1,p2,D", "p1,p2,E"), "f.csv:2: .*the numbers D; column d is missing or empty"),
        (("C,P,8.3", "C,C,8.3"), "f.csv:4: Dist3D: it needs 2 different points"),
        (("1,mm", "1,gon"), "f.csv:3: unit 'gon' is none of m, mm, cm, km, ft, us-ft"),
        (("1,mm", "0,mm"), "f.csv:3: column sigma: it is not positive"),
        (("B,P,9", "B,P,x9"), "f.csv:3: column d: 'x9.*' is not a number"),
        (("formula,p1", "formulas,p1"), "column name is missing"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, change, message):
    rows = "\n".join(ROWS).replace(*change).split("\n")
    rows = [row + ("Q" if "target" in rows[0] and k == 1 else "") for k, row in enumerate(rows)]
    rows = [row.replace(",,,Q", ",,Q,") for row in rows]
    with pytest.raises(InputError, match=message):
        network(tmp_path, rows)


def test_a_formula_of_the_users_with_numbers_of_its_own(tmp_path, capsys):
    # B is at (10, 0, 8) and P at (3, 4, 12): 13 m from A, 9 m from B.
    # Its height 12 is 0 / 4 + 8 * 3 / 4 + 6, and 0 / 2 + 8 / 2 + 8.
    points = POINTS.replace("B,10,0,0", "B,10,0,8").replace("5,,,", "11,,,")
    rows = [f"Dist3D,{name},P,{d!r},0.001" for name, d in zip("ABC", (13.0, 9.0, 189**0.5), strict=True)]
    network(tmp_path, ["formula,p1,p2,D,sigma", *rows], points)
    (tmp_path / "g.csv").write_text(
        "formula,first,last,top,w,h,sigma\nHeightOverLine,A,B,P,0.25,6,0.001\nHeightOverLine,A,B,P,0.5,8,0.001\n"
    )
    (tmp_path / "own.py").write_text(OWN)
    files = [str(tmp_path / name) for name in ("p.csv", "f.csv", "g.csv")]
    own = ["--formulas", str(tmp_path / "own.py")]
    assert main(["adjust", *files, *own, "--out", str(tmp_path / "r")]) == 0
    points = Network.read_project(files).adjust().points
    np.testing.assert_allclose(points.coordinates[3], (3, 4, 12), rtol=0, atol=1e-7)
    assert main(["convert", *files, *own, "--to", str(tmp_path / "x.gkf")]) == 2
    assert "f.csv:2): Gama has no observation like this" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1", "defines no formula"),
        ("1 / 0", "ZeroDivisionError"),
        (None, "there is no such file; check the path"),
    ],
)
def test_files_without_formulas(tmp_path, capsys, text, message):
    network(tmp_path)
    if text is not None:
        (tmp_path / "own.py").write_text(text)
    files = [str(tmp_path / name) for name in ("p.csv", "f.csv")]
    assert main(["adjust", *files, "--formulas", str(tmp_path / "own.py"), "--out", str(tmp_path / "r")]) == 2
    assert message in capsys.readouterr().err


RETURN = "return top.z - w * first.z - (1 - w) * last.z - h"


@pytest.mark.parametrize(
    ("before", "after", "line", "message"),
    [
        (RETURN, "return top.x - first.w - h", 18, "no attribute 'w' in formula HeightOverLine; correct"),
        ("h: Length", "h", 16, "argument h has no annotation in formula HeightOverLine; say what it is"),
        (RETURN, "return h if top.x > first.x else top.z", 18, "write it without `if` on its values"),
        (
            RETURN,
            "return __import__('math').sqrt(top.z) - h",
            18,
            "sqrt and sin from obseq.formulas.functions",
        ),
        ("class HeightOverLine", "class Dist3D", 16, "a formula Dist3D already; give yours another name"),
        ("import Scalar", "import Scaler", 5, "cannot import name 'Scaler'"),
        (RETURN, "return top.z -", 18, "it is not Python: invalid syntax"),
    ],
)
def test_a_slip_in_a_formula_is_said_with_its_line(tmp_path, capsys, before, after, line, message):
    network(tmp_path)
    (tmp_path / "own.py").write_text(OWN.replace(before, after))
    files = [str(tmp_path / name) for name in ("p.csv", "f.csv")]
    assert main(["adjust", *files, "--formulas", str(tmp_path / "own.py"), "--out", str(tmp_path / "r")]) == 2
    said = capsys.readouterr().err
    assert f"own.py, line {line}: " in said
    assert message in said
    assert "defect of obseq" not in said


def test_two_files_may_not_define_formulas_of_one_name(tmp_path, capsys):
    network(tmp_path)
    for name in ("own.py", "other.py"):
        (tmp_path / name).write_text(OWN)
    files = [str(tmp_path / name) for name in ("p.csv", "f.csv")]
    own = ["--formulas", str(tmp_path / "own.py"), str(tmp_path / "other.py")]
    assert main(["adjust", *files, *own, "--out", str(tmp_path / "r")]) == 2
    said = capsys.readouterr().err
    assert "other.py, line 16: a formula HeightOverLine is defined at" in said
    assert "own.py, line 16 already; give one of them another name" in said


def test_mutated_tables_are_read_or_refused_by_name(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(TOOLS)
    mutated = importlib.import_module("fuzz_readers").mutated
    network(tmp_path)
    refused = 0
    for seed in range(400):
        (tmp_path / "f.csv").write_bytes(mutated("\n".join(ROWS), random.Random(seed)))
        try:
            Network.read_project([tmp_path / "f.csv", tmp_path / "p.csv"])
        except InputError as error:
            assert "f.csv" in str(error)
            refused += 1
    assert 100 < refused < 400
