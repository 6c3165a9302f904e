"""Every line of MMVII's training as it is typed, from an empty folder, `obseq mmvii` in place of `MMVII`."""

import importlib
import json
import re
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from obseq import crs
from obseq.cli.main import main
from obseq.crs.transformer import Transformer
from obseq.images import Poses
from obseq.project import (
    read_block,
    read_control_points,
    read_system,
    read_topo,
)
from obseq.project.options.spellings import BY_NAME

ROOT = Path(__file__).parents[2]
TREE = Path("MMVII-PhgrProj")
LINE = re.compile(r"^    (\S.*)$", re.MULTILINE)
EXTRACTIONS = ("CodedTargetExtract", "CodedTargetCircExtract")
"""Whose place the measures take that the tool makes up."""
OLD_POINTS = "MMVII-PhgrProj/PointsMeasure"


@dataclass
class Typed:
    """A line, its exit code and what it printed."""

    line: str
    code: int
    said: str
    wrong: str


@pytest.fixture
def training(shared_data, tmp_path, monkeypatch, capsys) -> Callable[[str], list[Typed]]:
    """Types the lines of a section of the training; each must end with 0, or 1 where something is told."""
    monkeypatch.chdir(tmp_path)
    text = (shared_data / "../reference/training.md").read_text(encoding="utf-8")

    def type_all(title: str) -> list[Typed]:
        (section,) = [part for part in text.split("\n## ") if part.startswith(title)]
        typed = [_typed(line, capsys) for line in LINE.findall(section) if not line.startswith("(")]
        return [one for one in typed if one is not None]

    return type_all


def _typed(line: str, capsys) -> Typed | None:
    line = re.sub(r"\s+\((?:instead|or) .*\)$", "", line)
    line = line.replace(
        "; the same for TargetsC/", f"; cp {OLD_POINTS}/TargetsTopoRTL/* {OLD_POINTS}/TargetsC/"
    )
    program, _, rest = line.partition(" ")
    if program != "MMVII":
        subprocess.run(["sh", "-euc", line], check=True)
        return None
    words = subprocess.run(
        ["sh", "-c", f"printf '%s\\0' {rest}"], capture_output=True, text=True, check=True
    ).stdout.split("\0")[:-1]
    if words[0] in EXTRACTIONS:
        assert words[0] in BY_NAME
        return None
    code = main(["mmvii", *words])
    printed = capsys.readouterr()
    assert code in (0, 1), f"{line}\n{printed.err}"
    return Typed(line, code, printed.out, printed.err)


@pytest.fixture
def maker(monkeypatch):
    """The tool that makes projects up."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    return importlib.import_module("make_project")


def _offs(folder: str, truth: dict[str, list[float]]) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of the points of a folder, and (n,) squared distances from the truth by their covariances."""
    place = TREE / "PointsMeasure" / folder
    found = read_control_points(place)
    there = np.array([truth[name] for name in found.names])
    site = crs.parse("RTL*657700*6860700*0*IGNF:LAMB93")
    there = Transformer(site, crs.parse(read_system(place))).forward(there, found.names)
    off = found.coordinates - there
    return found.names, np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariances), off)


CHI_SQUARE = 16.3
"""Of three coordinates, at 99.9 %."""
CHI_SQUARE_OF_TEN = 29.6
"""Of the ten parameters of a camera, at 99.9 %."""


def test_the_first_example(shared_data, training) -> None:
    given = shared_data / "mmvii-topomini"
    Path("inputs").mkdir()
    Path("inputs/coords.cor").write_bytes((given / "coords.txt").read_bytes())
    Path("inputs/meas.obs").write_bytes((given / "meas.obs").read_bytes())
    typed = training("Example 1")
    assert len(typed) == 7
    said = typed[5].said
    assert "Topo sigma0: 5443.87 (12 obs)" in said and "Topo sigma0: 1.76552 (12 obs)" in said
    assert (TREE / "PointsMeasure/FinalL93").resolve() == (TREE / "ObjCoordWorld/FinalL93").resolve()


def _option_line(shared_data, pattern: str) -> list[str]:
    """Names of options that the training lists in its text."""
    text = (shared_data / "../reference/training.md").read_text(encoding="utf-8")
    (names,) = re.findall(pattern, text)
    return [name for name in names.split() if name.isidentifier()]


IMPORTING = {
    "NumL0": ("4", ("P.4", "P.5", "P.6")),
    "NumLast": ("3", ("P.1", "P.2")),
    "NbDigName": ("3", ("P.1", "P.2", "P.3", "P.4", "P.5", "P.6")),
    "PatName": (r"P\.(.*)", ("1", "2", "3", "4", "5", "6")),
    "ChSys": ("[L93,RTL]", None),
    "MulCoord": ("0.001", None),
    "Sigma": ("0.02", None),
    "AddInfoFree": ("0", None),
    "Comment": ("P", ()),
    "Sep": (";", None),
}


def test_every_option_of_the_import(shared_data, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [f"{k % 2} P.{k} {700000 + k} 6600000 {k}" for k in range(1, 7)]
    Path("p.txt").write_text("* a header\n" + "\n".join(lines) + "\n* the end\n", encoding="utf-8")
    Path("q.txt").write_text("\n".join(lines).replace(" ", ";") + "\n", encoding="utf-8")
    names = _option_line(shared_data, r"`ImportGCP FILE FORMAT OUT`, with `([^`]*)`")
    assert set(names) == set(IMPORTING)

    def points(*options: str, file: str = "p.txt"):
        assert main(["mmvii", "ImportGCP", file, "ANXYZ", file[0], "Comment=*", "Sigma=0.01", *options]) == 0
        return read_control_points(TREE / "PointsMeasure" / file[0])

    plain = points()
    assert plain.names == IMPORTING["NbDigName"][1]
    for name, (value, expected) in IMPORTING.items():
        if expected:
            assert points(f"{name}={value}").names == expected, name
    assert points("ChSys=[L93,RTL]").coordinates.max() < 10.0  # at the mean of the points
    np.testing.assert_allclose(points("MulCoord=0.001").coordinates * 1000, plain.coordinates)
    np.testing.assert_allclose(points("AddInfoFree=0").is_free[:, 0], [False, True] * 3)
    assert points("Sep=;", file="q.txt").names == plain.names


def test_the_imports_line_of_the_tutorial(shared_data, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (shared_data / "../reference/training.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"The tutorial's own line: `ImportGCP (\S+) ([^`]*)`", text)
    lines = ["header"] * 14 + [f"P.{k} {k} 0 0" for k in range(30)]
    Path(line[0]).write_text("\n".join(lines) + "\n", encoding="utf-8")
    assert main(["mmvii", "ImportGCP", line[0], *line[1].replace('"', "").split()]) == 0
    found = read_control_points(TREE / "PointsMeasure/Std").names
    assert found == tuple(f"{k:04d}" for k in range(20))  # the last line is not read


ADJUSTING = {
    "GCPW": "2",
    "DataDir": "Std",
    "NbIter": "3",
    "GCPFilter": "Pt.*",
    "GCPFilterAdd": "1",
    "GCPDirOut": "Out2",
    "LVM": "1",
}


def test_every_option_of_the_adjustment(shared_data, training, capsys) -> None:
    given = shared_data / "mmvii-topomini"
    Path("inputs").mkdir()
    Path("inputs/coords.cor").write_bytes((given / "coords.txt").read_bytes())
    text = (given / "meas.obs").read_text(encoding="utf-8")
    Path("inputs/meas.obs").write_text(text, encoding="utf-8")
    training("Example 1")
    assert set(_option_line(shared_data, r"Options of TopoAdj: `([^`]*)`")) == set(ADJUSTING)

    def adjusted(*words: str) -> tuple[str, str]:
        assert main(["mmvii", "TopoAdj", "Obs1", *words]) in (0, 1)
        printed = capsys.readouterr()
        return printed.out, printed.err

    for name, value in ADJUSTING.items():
        places = ["Obs1_out"] if name == "GCPDirOut" else ["InitRTL", "Obs1_out", "FinalRTL"]
        more = ["GCPDir=InitRTL"] if name == "GCPDirOut" else []
        said, told = adjusted(*places, *more, f"{name}={value}")
        assert "(12 obs)" in said, name
        assert told.startswith(f"{name} has no effect here") == (name in ("DataDir", "LVM")), told
    assert (TREE / "PointsMeasure/Out2/MesGCP-NewGCP.xml").is_file()
    for option in ("GCPFilter=PtA", "GCPFilterAdd=0"):  # the two known points are not both left
        assert main(["mmvii", "TopoAdj", "Obs1", "InitRTL", "Obs1_out", "FinalRTL", option]) == 2
        capsys.readouterr()
    first, second = text.split("\n\n", 1)
    Path("inputs/meas.obs").write_text(f"#BASC\n{first}\n#VERT\n{second}", encoding="utf-8")
    assert main(["mmvii", "ImportOBS", "inputs/meas.obs", "Basc"]) == 0
    words = ["TopoAdj", "Basc", "InitRTL", "BascOut", "BascRTL", "--json=basc.json"]
    assert main(["mmvii", *words[:-1]]) in (0, 1)
    capsys.readouterr()
    assert main(["topo-adjust", "Basc", "Again", "GCPDir=InitRTL", words[-1]]) in (0, 1)
    assert json.loads(Path("basc.json").read_text("utf-8"))["n_unknowns"] == 16


def test_the_second_example(shared_data, training) -> None:
    given = shared_data / "comp3d-figure"
    for name in ("figure.cor", "figure.obs"):
        Path(name).write_bytes((given / name).read_bytes())
    assert "Topo sigma0: 0.896176 (533 obs)" in training("Example 2")[-1].said


def test_the_third_example(maker, tmp_path, training) -> None:
    maker.training_project(tmp_path, example=3, exposures=0, targets=40, blunders=0, seed=1)
    typed = training("Example 3")
    assert [one.code for one in typed] == [0] * len(typed) and len(typed) == 14
    truth = json.loads(Path("truth.json").read_text("utf-8"))["points"]
    names, squares = _offs("CarOutL93", truth)
    assert names[-1] == "car" and len(names) == 11
    assert (squares < CHI_SQUARE).all() and 1.0 < squares.mean() < 6.0
    assert (TREE / "PointsMeasure/CarOutL93/MesGCP-NewGCP.xml").is_file()
    assert len(read_topo(TREE / "Topo/BlocCarOut").observations) == 30


@pytest.mark.slow  # two adjustments of a block with its survey
def test_the_fourth_example(maker, tmp_path, training) -> None:
    maker.training_project(tmp_path, example=4, exposures=8, targets=90, blunders=0, seed=1)
    typed = training("Example 4")
    assert len(typed) == 14
    told = [one.line for one in typed if one.code]
    assert [line.split()[1] for line in told] == ["TopoAdj", "OriPoseEstimSpaceResection"], told
    (report,) = [one for one in typed if "ReportGCP" in one.line]
    assert "IGNF:LAMB93" in report.said + report.wrong and "RTL*657700" in report.said + report.wrong
    truth = json.loads(Path("truth.json").read_text("utf-8"))
    for folder in ("FinalL93", "AllPtsOut"):
        _, squares = _offs(folder, truth["points"])
        assert (squares < CHI_SQUARE).mean() > 0.95 and 2.0 < squares.mean() < 4.0
    last = " ".join(typed[-1].line.replace('"', "").split()[2:]).replace(" BA ", " Again ").split()
    assert main(["bundle-adjust", *last, "--json=block.json"]) == 0
    block = json.loads(Path("block.json").read_text("utf-8"))
    images = block["images"]
    off = np.array([np.subtract(one["centre"], truth["centres"][one["name"]]) for one in images])
    squares = np.sum((off / [one["centre_sigmas"] for one in images]) ** 2, axis=1)
    assert len(images) == 16 and squares.max() < CHI_SQUARE and 0.5 < squares.mean() < 6.0
    names = [one["name"] for one in images]
    hidden = [[truth[part][name] for name in names] for part in ("centres", "rotations")]
    turns = [one["opk"] for one in images] - Poses.of(names, *hidden).attitudes("opk")
    turns = (turns + np.pi) % (2 * np.pi) - np.pi
    squares = (turns / [one["opk_sigmas"] for one in images]) ** 2
    assert squares.max() < CHI_SQUARE and 0.2 < squares.mean() < 3.0
    assert len(block["cameras"]) == 2
    for camera in block["cameras"]:
        found, sigmas = np.array([[one["value"], one["sigma"]] for one in camera["parameters"]]).T
        off = found - truth["cameras"][camera["name"]]
        covariance = camera["correlations"] * np.outer(sigmas, sigmas)
        assert (sigmas > 0.0).all() and off @ np.linalg.solve(covariance, off) < CHI_SQUARE_OF_TEN
    places = read_block(TREE / "RigBlock/RigInit/RigidBloc_TheBloc.xml").poses
    assert np.linalg.norm(places["C2"].centre) == pytest.approx(0.6, abs=0.1)
