"""What is in a tree, and that nothing of it is lost: files of 2023 and of 2026, and what nobody knows."""

import shutil

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.images import Camera
from obseq.project import (
    ProjectTree,
    calibration_text,
    read_calibration,
    read_tree,
    tree_text,
    write_orientation,
)
from obseq.project.cameras import calibration_source, read_orientation
from obseq.project.contents import contents


@pytest.fixture
def panel(shared_data, tmp_path):
    """The project of 2023."""
    shutil.copytree(shared_data / "mmvii-bundle-panel/MMVII-PhgrProj", tmp_path / "MMVII-PhgrProj")
    for path in tmp_path.rglob("*"):
        path.chmod(0o755)
    return tmp_path


def test_every_file_of_a_project_of_2023_is_understood_and_comes_back_as_it_was(panel, tmp_path):
    found = list(contents(ProjectTree.at(panel)))
    assert len(found) > 150
    assert not [item for item in found if item.unknown]
    for item in found:
        tree = read_tree(item.path)
        for as_json, ending in ((False, "xml"), (True, "json")):
            (name,) = tree
            again = tmp_path / f"again.{ending}"
            again.write_text(tree_text(name, tree[name], as_json=as_json))
            assert read_tree(again) == tree


def test_what_is_not_understood_is_named(panel, capsys):
    folder = panel / "MMVII-PhgrProj/Ori/BA"
    pose = next(folder.glob("Ori-*"))
    pose.write_text(pose.read_text().replace("<Center>", "<Weather>2</Weather><Center>", 1))
    (folder / "photo.tif").write_bytes(b"II*")
    (folder / "Odd.xml").write_text(tree_text("LidarThing", {"A": (1,)}))
    assert main(["project-contents", "--project", str(panel)]) == 1
    out = capsys.readouterr().out
    assert f"not understood in {pose}: Weather" in out
    assert "photo.tif: files that end in .tif are not read" in out
    assert "Odd.xml: LidarThing" in out
    assert "MMVII-PhgrProj/Ori/BA: 39 CameraPose" in out


def test_an_adjustment_keeps_what_a_calibration_says_besides(panel):
    """Settings of the original's inverse, information, and fields that nobody here knows."""
    folder = panel / "MMVII-PhgrProj/Ori/Resec"
    path = next(folder.glob("CalibIntr*043*"))
    text = path.read_text().replace("<DegreeApproxInv>3 1 1", "<DegreeApproxInv>5 1 1")
    text = text.replace("</InternalCalibration>", '<Serial>"77"</Serial></InternalCalibration>')
    path.write_text(text)
    words = ["bundle-adjust", "043_000.*", "Resec", "Out", "GCP3D=[[Fil,1]]", "GCP2D=[[Fil,1]]"]
    assert main([*words, f"--project={panel}"]) == 0
    given = calibration_source(folder, path.stem)
    out = calibration_source(panel / "MMVII-PhgrProj/Ori/Out", path.stem)
    assert out["Serial"] == "77"
    assert out["Auxiliary"]["DegreeApproxInv"] == (5, 1, 1)
    assert list(out) == [*given, *(key for key in out if key not in given)]
    assert out["PerfectProj"]["F"] != given["PerfectProj"]["F"]


def _marked(path, before, after):
    """Writes something that nobody here knows into a file."""
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))


@pytest.mark.parametrize("ending", [(), ("--json-files",)])
def test_what_nobody_knows_stays_in_files_that_are_written_again(panel, ending):
    """Poses, blocks and points are read, adjusted and written with what they hold besides."""
    tree = panel / "MMVII-PhgrProj"
    _marked(next((tree / "Ori/BA").glob("Ori-*043_0005*")), "<Center>", '<Weather>"rain"</Weather><Center>')
    points = next((tree / "PointsMeasure/Fil").glob("MesGCP*"))
    points.write_text(points.read_text().replace("<Sigma2>", '<Wall>"west"</Wall><Sigma2>'))
    project = f"--project={panel}"
    main(["block-init", "BA", "(.*)_(.*)_Scaled.tif", "Rig", "--master=043", project])
    block = tree / "RigBlock/Rig/RigidBloc_TheBloc.xml"
    _marked(block, "<Center>", "<Bolts>4</Bolts><Center>")
    _marked(block, "<Master>", '<Maker>"Smith"</Maker><Master>')
    words = ["GCP3D=[[Fil,1,New]]", "GCP2D=[[Fil,1]]", "BRDirIn=Rig", "BRW=[1e-2,1e-5]", "OutRigBlock=Out"]
    assert main(["bundle-adjust", ".*", "BA", "Out", *words, project, *ending]) == 0
    found = {path.stem: read_tree(path) for path in tree.rglob("Out/*")}
    assert found["Ori-PerspCentral-043_0005_Scaled.tif"]["CameraPose"]["Weather"] == "rain"
    rigid = found["RigidBloc_TheBloc"]["CalibBlocCam"]
    assert rigid["Maker"] == "Smith"
    assert rigid["PoseRel"][0]["V"]["Bolts"] == (4,)
    (adjusted,) = (tree / "ObjCoordWorld/New").glob("MesGCP*")
    entries = read_tree(adjusted)["SetGCP"]["Measures"]
    assert {entry.get("Wall") for entry in entries} == {"west"}
    assert all(sum("Sigma2" in key for key in entry) == 1 for entry in entries)


def test_rules_keep_what_nobody_knows(panel):
    folder = panel / "MMVII-PhgrProj/MetaData/Std"
    rule = {"Pat": ".*", "Val": "8", "By": "me"}
    other = {"Pat": "no", "Val": "9"}
    tree = [{"Mode": "Focalmm", "Tries": [other, rule], "Since": (2026,)}]
    (folder / "CalcMTD.xml").write_text(tree_text("MetaData", tree))
    words = ["--modify", "C1.*", "12", "0", "--save", f"--project={panel}"]
    assert main(["edit-metadata", "Std", "Focalmm", *words]) == 0
    (entry,) = read_tree(folder / "CalcMTD.xml")["MetaData"]
    assert entry == {"Mode": "Focalmm", "Tries": [{"Pat": "C1.*", "Val": "12"}, rule], "Since": (2026,)}


@pytest.mark.parametrize("as_json", [False, True])
def test_numbers_of_an_orientation_come_back_to_the_last_bit(tmp_path, as_json):
    rng = np.random.default_rng(3)
    camera = Camera(
        "c", 2000, 1333, 2000.0 + rng.normal(), rng.normal(1000, 1, 2), (3, 1, 1), rng.normal(0, 1e-9, 7)
    )
    poses, _ = _poses(rng)
    write_orientation(tmp_path, poses, {"c": camera}, as_json=as_json)
    again, cameras = read_orientation(tmp_path)
    np.testing.assert_array_equal(again.centres, poses.centres)
    np.testing.assert_array_equal(again.rotations, poses.rotations)
    np.testing.assert_array_equal(cameras["c"].parameters, camera.parameters)


def _poses(rng):
    from obseq.geometry import exponential
    from obseq.images import Poses

    names = [f"i{k}" for k in range(5)]
    return Poses.of(
        names, rng.normal(0, 1e6, (5, 3)), exponential(rng.normal(0, 1, (5, 3))), cameras="c"
    ), names


def test_a_calibration_of_2026_and_of_2023(tmp_path):
    path = tmp_path / "c.xml"
    path.write_text(calibration_text(Camera("c", 200, 100, 300.0, fraser=False)))
    assert not read_calibration(path).fraser
    text = calibration_text(Camera("c", 200, 100, 300.0))
    start = text.index("<IsFraserMode>")
    path.write_text(text[:start] + text[text.index("</IsFraserMode>") + 15 :])
    assert read_calibration(path).fraser
