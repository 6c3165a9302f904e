"""Formats are known by one line: dispatch by name and content, help, errors, mixtures, the page."""

import json
import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats import catalogue
from obseq.formats.catalogue import FORMATS, Format, Role, format_of, listing
from obseq.formats.registry import reader_of
from obseq.survey import Network

DEMO = files("obseq.survey") / "data"
SYSTEM = ("--points-crs", "IGNF:LAMB93")


def test_every_format_has_its_reader() -> None:
    for known in FORMATS:
        if known.reader:
            assert callable(reader_of(known)), known
        assert known.holds
        assert known.reader or known.role in (Role.OBSERVATIONS, Role.POINTS)


def test_no_two_formats_share_a_suffix_or_a_root() -> None:
    for names in ([s for f in FORMATS for s in f.suffixes], [r for f in FORMATS for r in f.roots]):
        assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("!#=DNA 3.01 STN    05.05.2021       GDA2020    01.01.2020         2\n", "DynAdjust"),
        ("%=SNX 2.02 AUS\n", "SINEX"),
        ("# field data\n\n.UNITS METERS\n", "STAR*NET"),
        ("*STAR*NET 3\n", "STAR*NET"),
        ('<?xml version="1.0"?>\n<gama-local/>', "GNU Gama"),
        ("00NMSDR33 V04-04.02\n", "Sokkia SDR"),
        ("JB,NMjob,DT01-01-2020\n", "Carlson RW5"),
        ('<?xml version="1.0"?><JOBFile/>', "Trimble JobXML"),
        ("CO,Nikon RAW data format V2.00\n", "Nikon RAW"),
        ("For M5|Adr 00001|TI  KN STAT   |", "Zeiss and Trimble M5"),
        ("2=P100\n23=2112\n3=0\n5=F1\n", "Geodimeter"),
        ("_'110_(COVEK_)1.390_+111_ ?+00041951m", "Topcon GTS"),
        ("GTS-700 v3.0\nJOB     job,\n", "Topcon GTS"),
    ],
)
def test_content_tells_what_a_suffix_does_not(tmp_path: Path, text: str, name: str) -> None:
    for file in ("a.txt", "a.raw", *([] if text.startswith("<") else ["a.dat"])):
        (tmp_path / file).write_text(text)
        assert format_of(tmp_path / file).name == name


def test_what_nobody_knows_lists_what_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_text("hello\n")
    with pytest.raises(InputError, match=r"its format is not known; files that are read: Comp3D \(\.comp\)"):
        format_of(tmp_path / "a.raw")


def test_help_lists_all_of_them(capsys) -> None:
    with pytest.raises(SystemExit):
        main(["adjust", "--help-all"])
    assert " ".join(listing().split()) in " ".join(capsys.readouterr().out.split())


@pytest.fixture
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name in ("demo.obs", "demo.cor"):
        (tmp_path / name).write_text((DEMO / name).read_text())
    assert main(["adjust", "--obs", "demo.obs", "--cor", "demo.cor", *SYSTEM, "--json", "as-told.json"]) == 0
    return tmp_path


def found(folder: Path, *options: str) -> np.ndarray:
    assert main(["adjust", *options, *SYSTEM, "--json", "out.json"]) == 0
    named = [json.loads((folder / name).read_text())["points"] for name in ("as-told.json", "out.json")]
    told, own = ({p["name"]: (p["crs_x"], p["crs_y"], p["crs_z"]) for p in points} for points in named)
    assert told.keys() == own.keys()
    return np.array([np.subtract(told[name], own[name]) for name in told])


def test_observations_and_points_need_no_options(demo: Path) -> None:
    assert not found(demo, "demo.obs", "demo.cor").any()
    assert not found(demo, "demo.cor", "demo.obs").any()


def test_tables_and_files_of_comp3d_go_together(demo: Path) -> None:
    assert main(["convert", "demo.obs", "demo.cor", *SYSTEM, "--to", "points.csv", "rows.obs.csv"]) == 0
    assert np.abs(found(demo, "demo.obs", "points.csv")).max() < 1e-9
    assert np.abs(found(demo, "rows.obs.csv", "demo.cor")).max() < 1e-9


def test_points_of_another_file_complete_those_of_a_network(tmp_path: Path) -> None:
    lines = ".UNITS METERS\n.2D\nDB A\nDM B 90-00-00 100\nDM C 45-00-00 50\nDE\nDB B\nDM A 0-00-00 100\nDE\n"
    (tmp_path / "a.dat").write_text(lines)
    (tmp_path / "known.cor").write_text("1 A 0 0 0 0.001\n1 B 100 0 0 0.001\n")
    sigmas = ["direction=1sec", "distance=1mm"]
    network = Network.read_project(tmp_path / "a.dat", point_files=tmp_path / "known.cor", sigmas=sigmas)
    adjusted = network.adjust().record()
    places = {point.name: (point.x, point.y) for point in adjusted.points}
    assert places["C"] == pytest.approx((50 * np.sqrt(0.5), 50 * np.sqrt(0.5)), abs=1e-6)
    (tmp_path / "b.dat").write_text(lines.replace("DB A", "C A 1 1 ! !\nDB A", 1))
    with pytest.raises(InputError, match="point A is given twice"):
        Network.read_project(tmp_path / "b.dat", point_files=tmp_path / "known.cor", sigmas=sigmas)


def test_a_format_of_points_is_a_file_and_a_line(demo: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    """A made-up one, `name = x y z`, known: dispatch, help and errors know it from its line alone."""
    import sys
    from types import ModuleType

    from obseq.survey.model import make_points

    def read_made_up(path: Path, encoding: str) -> tuple[object, list[float]]:
        rows = [line.split("=") for line in path.read_text(encoding).splitlines()]
        places = [[float(word) for word in text.split()] for _, text in rows]
        names, sigmas = [name.strip() for name, _ in rows], np.full((len(rows), 3), 0.001)
        points = make_points(names, np.array(places), sigmas)
        return points, [np.nan] * len(rows)

    module = ModuleType("obseq.formats.made_up")
    module.read_made_up = read_made_up
    monkeypatch.setitem(sys.modules, "obseq.formats.made_up", module)
    line = Format("Made Up", (".mup",), "", Role.POINTS, "points", point_reader="made_up:read_made_up")
    monkeypatch.setattr(catalogue, "FORMATS", (*FORMATS, line))
    monkeypatch.setattr("obseq.formats.obs.point_lists.FORMATS", (*FORMATS, line))
    cor = [row.split() for row in (demo / "demo.cor").read_text().splitlines() if row.split()[:1] == ["1"]]
    (demo / "known.mup").write_text("".join(f"{name} = {x} {y} {z}\n" for _, name, x, y, z, *_ in cor))
    assert main(["adjust", "demo.obs", "known.mup", *SYSTEM]) == 0
    assert "Made Up (.mup)" in listing()
    assert main(["convert", "known.mup", "demo.obs", *SYSTEM, "--to", "again.cor"]) == 0
    assert (demo / "again.cor").exists()


def test_the_page_of_formats_is_that_of_the_catalogue() -> None:
    import importlib.util

    path = Path(__file__).parents[2] / "tools" / "formats.py"
    spec = importlib.util.spec_from_file_location("formats_page", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.PAGE.read_text("utf-8") == module.page(), "write it anew: python tools/formats.py"


def test_the_readers_of_blocks_that_the_page_names_are_there() -> None:
    from obseq import formats, project

    page = (Path(__file__).parents[2] / "docs" / "first-block.md").read_text("utf-8")
    table = page.partition("\n## Blocks of other programs")[2]
    named = set(re.findall(r"\| `(read_\w+)", table)) | {"read_bundler", "read_bal"}
    assert len(named) > 12
    assert {
        name for name in named if not callable(getattr(formats, name, getattr(project, name, None)))
    } == set()
