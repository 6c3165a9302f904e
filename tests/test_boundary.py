"""A result is written, and the failure told, when what explains it or shows it fails."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import obseq.images.diagnosing.diagnosis as causes
import obseq.images.output.page as block_page
import obseq.images.output.record as block_record
import obseq.report.formats as formats
import obseq.survey.fieldwork as fieldwork
from obseq.boundary import Boundary, interruptions_end_searches
from obseq.cli.main import main
from obseq.images.output.clouds import pose_table
from obseq.report.findings import NOT_JUDGED

sys.path.insert(0, str(Path(__file__).parent / "images"))
import scenes


def _fails(*_, **__):
    raise ZeroDivisionError("a defect that was planted")


def test_an_interruption_goes_through_and_a_failure_says_where_it_was():
    boundary = Boundary()

    def interrupted():
        raise KeyboardInterrupt

    assert boundary.attempt("this", lambda: 3, 4) == 3
    assert boundary.attempt("this", _fails, 4) == 4
    assert (
        "this failed: ZeroDivisionError: a defect that was planted (test_boundary.py:" in boundary.failures[0]
    )
    with pytest.raises(KeyboardInterrupt):
        boundary.attempt("this", interrupted, 4)
    with pytest.raises(KeyboardInterrupt):
        boundary.attempt("the search", interrupted, 4, ends=True)
    with interruptions_end_searches():
        assert boundary.attempt("the search", interrupted, 4, ends=True) == 4
        with pytest.raises(KeyboardInterrupt):
            boundary.attempt("this", interrupted, 4)
    assert boundary.failures[-1].startswith("the search was interrupted")


@pytest.fixture
def network(tmp_path):
    """A quadrilateral with a distance that is off by 5 cm: all searches are run."""
    places = {"A": (0, 0, 0), "B": (100, 0, 0), "C": (100, 80, 1), "D": (0, 80, 2), "E": (50, 120, 1)}
    known, names = "ABC", list(places)
    cor = [f"{1 if name in known else 0} {name} {x} {y} {z} 0.001" for name, (x, y, z) in places.items()]
    lines = []
    for k, a in enumerate(names):
        for b in names[k + 1 :]:
            length = np.linalg.norm(np.subtract(places[a], places[b])) + 0.05 * (a + b == "DE")
            lines.append(f"3 {a} {b} {length:.5f} 0.001")
            lines.append(f"4 {a} {b} {places[b][2] - places[a][2]:.5f} 0.001")
    (tmp_path / "n.cor").write_text("\n".join(cor) + "\n")
    (tmp_path / "n.obs").write_text("\n".join(lines) + "\n")
    return ["adjust", f"--obs={tmp_path / 'n.obs'}", f"--cor={tmp_path / 'n.cor'}"], tmp_path


def _points(path):
    record = json.loads(path.read_text())
    return {point["name"]: (point["x"], point["y"], point["z"]) for point in record["points"]}, record


@pytest.mark.parametrize(
    ("module", "name", "what"),
    [
        (fieldwork, "record_of", "the diagnosis"),
    ],
)
def test_a_network_is_written_when_its_diagnosis_fails(network, monkeypatch, capsys, module, name, what):
    command, folder = network
    main([*command, f"--json={folder / 'right.json'}"])
    capsys.readouterr()
    monkeypatch.setattr(module, name, _fails)
    assert main([*command, f"--json={folder / 'found.json'}", f"--html={folder / 'found.html'}"]) == 1
    right, found = _points(folder / "right.json")[0], _points(folder / "found.json")[0]
    assert right == found
    (failure, *_) = _points(folder / "found.json")[1]["failures"]
    assert what in failure and "a defect that was planted" in failure
    _is_told_first(capsys.readouterr().out, what)
    assert "a defect that was planted" in (folder / "found.html").read_text()


def _is_told_first(summary, what):
    """The verdict says that something was not judged, and the first finding what."""
    lines = [" ".join(line.split()) for line in summary.splitlines()]
    assert lines[1] == NOT_JUDGED
    first = next(k for k, line in enumerate(lines) if line.startswith("Look at first")) + 1
    assert lines[first].startswith(f"Not judged: {what} failed: ZeroDivisionError")
    assert summary.count("a defect that was planted") == 1


def test_a_network_is_written_when_a_page_fails(network, monkeypatch, capsys):
    command, folder = network
    broken = tuple(
        formats.Format(form.name, form.suffix, form.purpose, _fails) if form.name == "html" else form
        for form in formats.FORMATS
    )
    monkeypatch.setattr("obseq.cli.results.FORMATS", broken)
    assert main([*command, f"--out={folder / 'out'}"]) == 1
    assert {path.name for path in (folder / "out").iterdir()} == {"adjustment.json", "adjustment.txt"}
    assert "adjustment.html failed: ZeroDivisionError" in " ".join(capsys.readouterr().out.split())


@pytest.fixture
def block(tmp_path):
    """A block as tables, of poses that are given, with a gross error."""
    made, _, truth = scenes.block(n_images=5, n_points=16, n_control=7)
    made.sets[0].measures.xy[20] += [40.0, 10.0]
    measures = made.sets[0].measures
    rows = [
        f"{measures.image_names[i]},{measures.point_names[p]},{x},{y}"
        for i, p, (x, y) in zip(measures.image, measures.point, measures.xy, strict=True)
    ]
    control = [f"{name},{','.join(map(str, truth[name]))},0.002" for name in list(truth)[:7]]
    texts = {
        "cameras": ["name,width,height,focal,K1,K2,p1", "c,2000,1500,1800,-0.08,0.02,0.001"],
        "control": ["point,x,y,z,sigma", *control],
        "measures": ["image,point,x,y", *rows],
    }
    for name, lines in texts.items():
        (tmp_path / f"{name}.csv").write_text("\n".join(lines) + "\n")
    poses = type("Found", (), {"poses": made.poses})
    (tmp_path / "images.csv").write_text(pose_table(poses))
    names = ("cameras", "images", "control", "measures")
    options = [f"--{name}={tmp_path / name}.csv" for name in names]
    return ["bundle", *options, "--image-sigma=0.5", "--freeze=K.|p.|b."], tmp_path


@pytest.mark.parametrize(
    ("module", "name", "what"),
    [
        (causes, "diagnosed", "the search for errors"),
        (block_record, "reliability_of", "the tests of image points"),
        (block_page, "page", "block.html"),
    ],
)
def test_a_block_is_written_when_what_explains_it_fails(block, monkeypatch, capsys, module, name, what):
    command, folder = block
    main([*command, f"--json={folder / 'right.json'}"])
    capsys.readouterr()
    monkeypatch.setattr(module, name, _fails)
    reports = [f"--json={folder / 'found.json'}", f"--html={folder / 'block.html'}"]
    assert (
        main([*command, *reports, f"--points={folder / 'points.csv'}", f"--opk-out={folder / 'o.txt'}"]) == 1
    )
    assert _points(folder / "right.json")[0] == _points(folder / "found.json")[0]
    assert (folder / "points.csv").exists()
    shown = capsys.readouterr().out
    told = " ".join(shown.split()).replace(f"{folder}/", "")
    assert f"{what} failed: ZeroDivisionError: a defect that was planted" in told
    if name == "diagnosed":
        _is_told_first(shown, what)
    assert (folder / "block.html").exists() == (name != "page")
