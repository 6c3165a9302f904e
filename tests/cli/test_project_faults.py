"""What goes wrong on a project tree: one clear message with the file and the name, nothing half-written."""

import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.images import BundleAdjustment, ControlPoints
from obseq.project import (
    ProjectTree,
    measures_text,
    points_text,
    read_calibration,
    read_control_points,
    read_orientation,
    system_text,
    write_orientation,
)
from obseq.project.cameras import calibration_text

ROOT = Path(__file__).parents[2]
ADJUST = ["bundle-adjust", ".*", "Start", "Out", "GCP3D=[[Gnd,1]]", "GCP2D=[[Gnd,0.3]]", "PPFzCal=.*"]
CALIBRATION = "CalibIntr_CamBFS-PGE-161S7M-C_Add125_Foc8000"
UP = np.array([0.0, 0.0, 5000.0])
IMAGE = "IGN2_p-cam-22340125-1.jpg"


@pytest.fixture
def garage(monkeypatch, tmp_path):
    """Six images with known poses, control points and measures."""
    monkeypatch.syspath_prepend(ROOT / "tools")
    maker = importlib.import_module("make_project")
    site = maker.car_project(tmp_path, targets=20, blunders=0, seed=4)
    tree = tmp_path / "MMVII-PhgrProj"
    names = [name for name in site.points if name.startswith("G")]
    known = ControlPoints.of(names, [site.points[name] for name in names], 0.001)
    (tree / "ObjCoordWorld/Gnd").mkdir(parents=True)
    (tree / "ObjCoordWorld/Gnd/MesGCP-Gnd.xml").write_text(points_text(known, "Gnd"))
    write_orientation(tree / "Ori/Start", site.poses, site.cameras)
    monkeypatch.chdir(tmp_path)
    return tree


def _points(tree: Path, change) -> None:
    folder = tree / "ObjCoordWorld/Gnd"
    given = read_control_points(folder)
    (folder / "MesGCP-Gnd.xml").write_text(points_text(change(given), "Gnd"))


def _replace(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def _no_calibration(tree):
    (tree / f"Ori/Start/{CALIBRATION}.xml").unlink()


def _no_pose(tree):
    (tree / f"Ori/Start/Ori-PerspCentral-{IMAGE}.xml").unlink()


def _one_line(tree):
    """The same images of points that are on a line."""
    maker = importlib.import_module("make_project")
    poses, cameras = read_orientation(tree / "Ori/Start")
    names = read_control_points(tree / "ObjCoordWorld/Gnd").names
    line = np.linspace(-3, 3, len(names))[:, None] * np.array([1.0, 0.5, 0.1])
    points = dict(zip(names, line, strict=True))
    measures = maker.Site(poses, cameras, points, np.random.default_rng(0)).measured(list(names), 0.3, 0)
    for image in measures.image_names:
        (tree / f"ObjMesInstr/Gnd/MesIm-{image}.xml").write_text(measures_text(image, measures))
    _points(tree, lambda given: ControlPoints.of(given.names, line, 0.001))


def _no_datum(tree):
    _points(tree, lambda given: ControlPoints.of(given.names, given.coordinates, np.inf))


def _behind(tree):
    _points(tree, lambda given: ControlPoints.of(given.names, given.coordinates + UP, 0.001))


def _twice(tree):
    _replace(tree / "ObjCoordWorld/Gnd/MesGCP-Gnd.xml", '<Name>"G01"', '<Name>"G00"')


def _measured_twice(tree):
    _replace(tree / f"ObjMesInstr/Gnd/MesIm-{IMAGE}.xml", '<Name>"G01"', '<Name>"G00"')


def _broken(tree):
    path = tree / f"ObjMesInstr/Gnd/MesIm-{IMAGE}.xml"
    path.write_text(path.read_text()[:300])


def _entities(tree):
    path = tree / "ObjCoordWorld/Gnd/MesGCP-Gnd.xml"
    path.write_text(
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]>' + path.read_text().split("?>", 1)[1]
    )


def _millimetres(tree):
    path = tree / f"Ori/Start/{CALIBRATION}.xml"
    camera = read_calibration(path)
    path.write_text(calibration_text(camera.with_parameters([8.0, *camera.parameters[1:]])))


def _outside(tree):
    path = tree / f"ObjMesInstr/Gnd/MesIm-{IMAGE}.xml"
    text = path.read_text()
    start = text.index("<Pt>") + 4
    path.write_text(text[:start] + "9000 " + text[start:].split(" ", 1)[1])


def _other_system(tree):
    for folder, word in (("Ori/Start", "GeoC"), ("ObjCoordWorld/Gnd", "RTL*2*48*0*EPSG:4326")):
        (tree / folder / "CurSysCo.xml").write_text(system_text(word))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_no_calibration, [CALIBRATION, IMAGE, "Ori/Start"]),
        (_no_pose, [IMAGE, "there is no pose"]),
        (_one_line, ["ObjCoordWorld/Gnd: the block: its 20 control points (G00, ", "are on a line"]),
        (_no_datum, ["ObjCoordWorld/Gnd: the block has no datum"]),
        (_behind, ["behind the camera", "ObjMesInstr/Gnd: image IGN2"]),
        (_twice, ["'G00' is given twice"]),
        (_measured_twice, [IMAGE, "G00", "measured twice"]),
        (_broken, [f"MesIm-{IMAGE}.xml", "the XML is broken"]),
        (_entities, ["MesGCP-Gnd.xml", "entities"]),
        (_millimetres, [CALIBRATION, "8 pixels", "multiply millimetres"]),
        (_outside, [IMAGE, "outside the image"]),
        (_other_system, ["GeoC", "change-sysco"]),
    ],
)
def test_one_message_and_nothing_is_written(garage, capsys, spoil, said):
    spoil(garage)
    before = sorted(garage.rglob("*"))
    assert main(ADJUST) == 2
    message = capsys.readouterr().err
    assert "Traceback" not in message
    assert all(word in message for word in said), message
    assert sorted(garage.rglob("*")) == before


def test_points_and_images_that_take_no_part_are_named(garage, capsys):
    path = garage / f"ObjMesInstr/Gnd/MesIm-{IMAGE}.xml"
    _replace(path, '<Name>"G03"', '<Name>"once"')
    assert main(ADJUST) == 1
    assert "once" in capsys.readouterr().out
    assert (garage / "Ori/Out").is_dir()


@pytest.mark.parametrize("command", ["bundle-adjust", "topo-adjust"])
def test_an_interruption_leaves_nothing_behind(garage, monkeypatch, capsys, command):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(BundleAdjustment, "solve", stopped)
    monkeypatch.setattr("obseq.survey.Network.adjust", stopped)
    (garage / "Topo/Car").mkdir(parents=True)
    (garage / "Topo/Car/c.obs").write_text("3 G00 G01 5 0.001\n")
    words = {"bundle-adjust": ADJUST, "topo-adjust": ["topo-adjust", "Car", "Out", "GCP3D=[[Gnd,1,Out]]"]}[
        command
    ]
    before = sorted(garage.parent.rglob("*"))
    assert main([*words, "--json", "r.json", "--html", "r.html"]) == 130
    assert "no file is half-written" in capsys.readouterr().err
    assert sorted(garage.parent.rglob("*")) == before


def test_a_folder_that_cannot_be_written_is_known_before_the_work(garage, capsys, monkeypatch):
    monkeypatch.setattr(BundleAdjustment, "solve", lambda *_, **__: pytest.fail("it was computed"))
    assert main([*ADJUST, "--json", "."]) == 2
    assert "is a folder" in capsys.readouterr().err


def test_the_result_file_is_that_of_the_block(garage):
    assert main([*ADJUST, "--json", "r.json", "--ply", "r.ply"]) == 0
    record = json.loads((garage.parent / "r.json").read_text())
    assert (record["format"], len(record["images"]), record["converged"]) == ("obseq-bundle", 6, True)
    assert len(record["measures"]) == sum(image["n_measures"] for image in record["images"])
    assert (garage.parent / "r.ply").read_text().startswith("ply")


@pytest.mark.parametrize("out", ["../../out", "Elsewhere/Out", "..", "MMVII-PhgrProj/MetaData/Out"])
def test_a_path_that_leads_elsewhere_is_refused(garage, capsys, out):
    assert main([*ADJUST[:3], out, *ADJUST[4:]]) == 2
    assert f"{out}: not in " in capsys.readouterr().err
    assert not (garage / "Ori/Out").exists()


def test_the_path_of_a_folder_is_as_good_as_its_name(garage):
    assert ProjectTree.at(garage).folder("Ori", "MMVII-PhgrProj/Ori/Out/") == garage / "Ori/Out"
