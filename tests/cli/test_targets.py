"""The commands of coded targets, from a set to measures."""

import contextlib
import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from obseq.cli.main import main

SPEC = "IGNIndoor_Nbb12_Freq2_Hamm3_Run2_3_FullSpecif.xml"
SMALL = "--size 420 320 --focal 900 --targets 4 --sizes 50 70"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a set and two images of it."""
    folder = tmp_path_factory.mktemp("site")
    with contextlib.chdir(folder):
        assert main("targets generate IGNIndoor".split()) == 0
        command = f"targets simulate --spec {SPEC} --images 2 {SMALL}"
        assert main([*command.split(), "--out", "photos"]) == 0
    return folder


@pytest.fixture
def site(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with what was made once."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_what_is_simulated_is_found(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = f"targets find photos/image_001.png photos/image_002.png --spec {SPEC} --csv m.csv --why w.csv"
    assert main([*command.split(), "--mmvii", "2D", "--overlay", "over", "--page", "page.html"]) == 0
    assert "image_002.png: 4 targets" in capsys.readouterr().out
    truth = {(row["image"], row["point"]): row for row in rows(site / "photos" / "truth.csv")}
    found = rows(site / "m.csv")
    assert {(row["image"], row["point"]) for row in found} == truth.keys()
    for row in found:
        wanted = truth[row["image"], row["point"]]
        error = np.hypot(float(row["x"]) - float(wanted["x"]), float(row["y"]) - float(wanted["y"]))
        assert error < 6.0 * np.sqrt(float(row["sxx"]) + float(row["syy"]))
    page = (site / "page.html").read_text(encoding="utf-8")
    assert page.count("<figure>") == 8
    assert np.asarray(Image.open(site / "over" / "image_001.png.png")).shape == (320, 420, 3)
    from obseq.project import read_image_measures

    measures = read_image_measures(site / "2D")
    assert len(measures) == 8
    assert measures.sigmas.max() < 0.05


def test_an_image_that_cannot_be_read_is_named_and_the_others_measured(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (site / "bad.jpg").write_bytes(b"none")
    command = f"targets find photos/image_001.png bad.jpg --spec {SPEC} --csv m.csv"
    assert main(command.split()) == 1
    assert "not read: bad.jpg: is no image" in capsys.readouterr().out
    assert len(rows(site / "m.csv")) == 4


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (f"find bad.jpg --spec {SPEC}", "bad.jpg: there is no such file"),
        (f"find photos/image_001.png photos/image_001.png --spec {SPEC}", "two images have this name"),
        ("find photos/image_001.png --spec photos/truth.csv", "neither XML nor JSON"),
        (f"simulate --spec {SPEC}", "give --out DIR"),
        (f"draw {SPEC} --names XX", "no target of"),
        (f"draw {SPEC} --width 9000", "1 to 5000 mm"),
        ("generate CERN --bits 13", "must be even"),
    ],
)
def test_what_cannot_be_done_is_said(
    site: Path, capsys: pytest.CaptureFixture[str], command: str, said: str
) -> None:
    assert main(["targets", *command.split()]) == 2
    assert said in capsys.readouterr().err


def test_sheets_are_drawn(site: Path) -> None:
    assert (
        main(f"targets draw {SPEC} --names 0[12] --format pdf svg png --width 120 --out sheets".split()) == 0
    )
    names = sorted(path.suffix for path in (site / "sheets").iterdir())
    assert names == [".pdf", ".png", ".png", ".svg", ".svg"]


def test_statistics_are_printed(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(f"targets simulate --spec {SPEC} {SMALL} --measure".split()) == 0
    last = capsys.readouterr().out.splitlines()[-1].split()
    assert last[:4] == ["all", "4", "4", "0"]


def test_sheets_have_other_widths_and_their_own_specification(site: Path) -> None:
    from obseq.targets import read_specification

    encoding = SPEC.replace("FullSpecif", "SpecEncoding")
    options = ["ThW0=0.4", "ThCod=0.3", "ThSepCar=0.2", "ThBExt=0.1", "Theta=0.5", "PatIm=00"]
    assert main(["mmvii", "CodedTargetGenerate", encoding, *options]) == 0
    geometry = read_specification(Path(SPEC)).geometry
    assert geometry.radii == pytest.approx((1.4, 1.7, 1.9, 2.0)) and geometry.angle == pytest.approx(0.5)
    words = ["--inside", "0.2", "--angle=45", "--names=00"]
    assert main(["targets", "draw", SPEC, *words, "--out=drawn"]) == 0
    geometry = read_specification(Path("drawn") / SPEC).geometry
    assert geometry.radii == pytest.approx((1.2, 1.5, 1.7, 1.8)) and geometry.angle == pytest.approx(
        np.pi / 4
    )
    assert main(["targets", "draw", SPEC, "--inside=-1", "--out=drawn"]) == 2
