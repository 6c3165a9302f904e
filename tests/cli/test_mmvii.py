"""`obseq mmvii`: the training as it is typed, and what is said of what is typed wrongly."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.project.options.spelling import IDLE, in_our_words
from obseq.project.options.spellings import BY_NAME, SPELLINGS
from obseq.project.points import read_control_points, read_definition, read_system
from obseq.project.topo import read_topo

TREE = Path("MMVII-PhgrProj")
FIXED = "#FIX\n5 HLLST0001  HLLPI0005  100 0.001\n#VERT\n"


@pytest.fixture
def typed(shared_data, tmp_path, monkeypatch, capsys):
    """Runs the lines of a script of the training; gives what each prints."""
    monkeypatch.chdir(tmp_path)

    def run(script: str) -> list[str]:
        printed = []
        for line in (shared_data / "mmvii-training" / script).read_text(encoding="utf-8").splitlines():
            if line.startswith("$MMVII"):
                assert main(["mmvii", *shlex.split(line)[1:]]) in (0, 1), line  # 1: what is wrong is told
                printed.append(capsys.readouterr().out)
        return printed

    return run


def sigmas(printed: str) -> list[float]:
    return [float(found) for found in re.findall(r"^Topo sigma0: (\S+) \(", printed, re.MULTILINE)]


def test_the_first_example_as_it_is_typed(shared_data, typed) -> None:
    given = shared_data / "mmvii-topomini"
    Path("inputs").mkdir()
    Path("inputs/coords.cor").write_bytes((given / "coords.txt").read_bytes())
    Path("inputs/meas.obs").write_bytes((given / "meas.obs").read_bytes())
    *_, adjusted, _, _, again = typed("example1.sh")
    assert "Topo sigma0: 5443.87 (12 obs)" in adjusted
    assert (sigmas(adjusted)[0], sigmas(adjusted)[-1]) == (5443.87, 1.76552)
    assert sigmas(again)[-1] == 1.76552
    found = read_control_points(TREE / "ObjCoordWorld" / "FinalL93")
    expected = json.loads((given / "expected.json").read_text(encoding="utf-8"))
    wanted = [expected["comp3d"]["points"][name]["L93"] for name in found.names]
    assert len(wanted) == 4
    np.testing.assert_allclose(found.coordinates, wanted, rtol=0, atol=1e-4)
    first, second = (
        read_control_points(TREE / "ObjCoordWorld" / name).coordinates for name in ("FinalRTL", "FinalRTL2")
    )
    np.testing.assert_allclose(second, first, rtol=0, atol=1e-6)
    assert read_system(TREE / "ObjCoordWorld" / "FinalMean") == read_definition(TREE / "SysCo" / "RTL.xml")


@pytest.mark.parametrize("first", ["", FIXED])
def test_the_second_example_as_it_is_typed(first, shared_data, typed) -> None:
    """As it is, and with its azimuth as a direction of a fixed circle: the file that is written has that."""
    given = shared_data / "comp3d-figure"
    text = (given / "figure.obs").read_text(encoding="latin-1")
    azimuth, rest = text.split("\n", 1)
    assert azimuth.startswith("8 HLLST0001")
    Path("figure.obs").write_text(first + rest if first else text, encoding="latin-1")
    Path("figure.cor").write_bytes((given / "figure.cor").read_bytes())
    adjusted = typed("example2.sh")[-1]
    assert sigmas(adjusted)[-1] == 0.896176
    assert "(533 obs)" in adjusted
    book = read_topo(TREE / "Topo" / "Obs1_out")
    assert len(book.observations) == 533
    assert main(["mmvii", "TopoAdj", "Obs1_out", "InitRTL", "Again", "AgainRTL"]) in (0, 1)


def test_every_command_has_a_counterpart_or_says_where_it_is(capsys) -> None:
    assert main(["mmvii"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == [spelling.name for spelling in SPELLINGS]
    for spelling in SPELLINGS:
        assert main(["mmvii", spelling.name, "-Help"]) == 0
        shown = capsys.readouterr().out
        assert spelling.example in shown and all(option.name in shown for option in spelling.options)
        if spelling.example:
            in_our_words(spelling, shlex.split(spelling.example)[1:])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("TopoAj a b", "has no counterpart here; did you mean TopoAdj?"),
        ("TopoAdj a", "TopoAdj: TOPO_OUT is missing. It is typed\nTopoAdj TOPO TOPO_OUT ["),
        ("TopoAdj a b c", "TopoAdj: a b c is too much"),
        ("ImportOBS a b c d", "ImportOBS: c d is too much"),
        ("TopoAdj a b NbIte=3", "TopoAdj has no option NbIte; did you mean NbIter?"),
        ("ClinoInit a b", "ClinoInit: ORIENTATION OUT is missing"),
        ("ImportGCP a NXYZ Out Sigma=[1,2]", "Sigma takes one value, not a list"),
        ("BlockCamInit a b c [1] d", "[1] is not [camera, exposure]"),
    ],
)
def test_what_is_typed_wrongly_is_told(line, said, capsys) -> None:
    assert main(["mmvii", *line.split()]) == 2
    assert said in capsys.readouterr().err


def test_options_without_effect_are_accepted_and_told(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("p.txt").write_text("code A 1 2 3 more\n", encoding="utf-8")
    assert main(["mmvii", "ImportGCP", "p.txt", "SNXYZ", "Out", "Sigma=-1", "Debug=1"]) == 0
    printed = capsys.readouterr()
    assert printed.err == f"Debug has no effect here: {IDLE['Debug']}\n"
    assert "1 points, 1 of them free" in printed.out


def test_the_tutorials_own_line(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [f"P.{k} {k} 0 0" for k in range(10)]
    Path("p.txt").write_text("a header\n" + "\n".join(lines) + "\n", encoding="utf-8")
    words = ["p.txt", "NXYZ", "Std", "NumL0=3", "NumLast=6", r"PatName=P\.(.*)", "NbDigName=4"]
    assert main(["mmvii", "ImportGCP", *words]) == 0
    assert read_control_points(TREE / "ObjCoordWorld" / "Std").names == ("0002", "0003", "0004")


def test_names_of_our_options_are_those_of_our_commands() -> None:
    """Each option of the table becomes words that our command takes."""
    from obseq.cli.main import parser

    values = {"Modif": "[.*,v,0]", "Degree": "[3,1,1]", "DegDist": "[3,1,1]", "SzImage": "[10,10]"}
    pairs = {"ValPPRel": "[0.5,0.5]", "PatName": "[a,b]", "ChSys": "[A,B]"}
    for name in ("ImportGCP", "EditCalcMTDI", "OriCreateCalib", "OriPoseEstim11P", "BlockCamInit"):
        spelling = BY_NAME[name]
        options = [f"{o.name}={(values | pairs).get(o.name, '1')}" for o in spelling.options]
        places = ["[1,2]" if "[" in place else "x" for place in spelling.forms[0].places]
        ours, _ = in_our_words(spelling, [*places, *options])
        parser(spelling.ours).parse_args([spelling.ours, *ours])
