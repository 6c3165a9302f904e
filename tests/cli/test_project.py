import json
import shutil

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.images import ControlPoints
from obseq.project import (
    points_text,
    read_block,
    read_calibration,
    read_control_points,
    read_orientation,
    system_text,
)
from obseq.project.points import read_entries


@pytest.fixture
def panel(shared_data, tmp_path, monkeypatch):
    """A copy of the panel's project."""
    shutil.copytree(shared_data / "mmvii-bundle-panel" / "MMVII-PhgrProj", tmp_path / "MMVII-PhgrProj")
    for path in tmp_path.rglob("*"):
        path.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def expected(shared_data):
    return json.loads((shared_data / "mmvii-bundle-panel" / "expected.json").read_text())


def test_calibrations_from_metadata(panel, capsys):
    assert main("create-calib 043_.* Fil New --size 2000 1333".split()) == 0
    assert "CalibIntr_CamNIKON_D5600_Add043_Foc24000: F 2051.1" in capsys.readouterr().out
    assert (panel / "MMVII-PhgrProj/Ori/New/CalibIntr_CamNIKON_D5600_Add043_Foc24000.xml").is_file()


def test_the_distribution_of_control_points(panel, capsys):
    assert main("check-gcp-distribution 043_00.* Fil Fil --lists OK".split()) == 0
    rows = capsys.readouterr().out.splitlines()
    assert rows[0] == "image,n,linearity,planarity,resection,eleven_parameters"
    assert len(rows) == 21
    assert main("check-gcp-distribution OK_OK_Resec.xml Fil Fil".split()) == 0


@pytest.mark.slow  # thousands of triplets
def test_poses_from_nothing_but_measures(panel, capsys):
    code = main("resection 043_000[57].* Fil Fil Calib Mine --triplets 100".split())
    assert code == 0
    assert "50 of 50 points" in capsys.readouterr().out
    found, cameras = read_orientation(panel / "MMVII-PhgrProj/Ori/Mine")
    theirs, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/Resec", found.images)
    np.testing.assert_allclose(found.centres, theirs.centres, rtol=0.0, atol=1e-8)
    assert list(cameras) == ["CalibIntr_CamNIKON_D5600_Add043_Foc24"]


def test_poses_and_calibrations_from_control_points_alone(panel, capsys):
    code = main("resection-11p 043_00(0.|1.|25).* Fil Fil Alone --size 2000 1333 --degree 3 1 1".split())
    out = capsys.readouterr().out
    assert code == 1
    assert "left out: image 043_0025_Scaled.tif: its 34 control points are in a plane" in out
    found, cameras = read_orientation(panel / "MMVII-PhgrProj/Ori/Alone")
    assert len(found) == len(cameras) == 8
    assert found.cameras[0] == f"Calib-PerspCentral-{found.images[0]}"
    theirs, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/Resec", found.images)
    np.testing.assert_allclose(found.centres, theirs.centres, atol=3.0)
    folder = panel / "MMVII-PhgrProj/Ori/Alone"
    shared = read_calibration(folder / "CalibIntr_CamNIKON_D5600_Add043_Foc24000.xml")
    each = [camera.parameters for camera in cameras.values()]
    np.testing.assert_allclose(shared.parameters, np.median(each, axis=0), rtol=1e-14)
    assert shared.focal == pytest.approx(2095.47, abs=1.5)


def test_the_rigid_block(panel, capsys, expected):
    main(["block-init", "BA", "(.*)_(.*)_Scaled.tif", "Block"])
    out = capsys.readouterr().out
    assert "043 -> 671: 19 exposures, translation 586.893700 -0.082228 70.455691" in out
    assert "SigmaTr 0.13286, SigmaRot 0.000148876" in out
    poses, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/BA")
    taken = [image.split("_")[1] for image in poses.images]
    (alone,) = (exposure for exposure in taken if taken.count(exposure) == 1)
    assert f"exposure {alone} has no image of camera" in out
    block = read_block(panel / "MMVII-PhgrProj/RigBlock/Block/RigidBloc_TheBloc.xml")
    np.testing.assert_allclose(block.poses["671"].centre, [586.893700, -0.082228, 70.455691], atol=5e-7)
    assert block.exposures(["043_0005_Scaled.tif"]) == {"0005": {"043": "043_0005_Scaled.tif"}}


def test_the_report_on_control_points(panel, capsys):
    assert main("report-gcp 043_.* Fil Fil BA".split()) == 0
    folder = panel / "MMVII-PhgrProj/Reports/ReportGCP/BA_Mes-Fil-Fil"
    assert sorted(path.name for path in folder.iterdir()) == [
        "ByCam.csv",
        "ByGCP.csv",
        "ByGCP_3D.csv",
        "ByImage.csv",
        "Detail.csv",
    ]
    detail = (folder / "Detail.csv").read_text().splitlines()
    norms = [float(line.split(",")[2]) for line in detail[1:]]
    camera = (folder / "ByCam.csv").read_text().splitlines()[1].split(",")
    assert int(camera[1]) == len(norms)
    assert float(camera[2]) == pytest.approx(np.mean(norms), abs=1e-6)
    assert float(camera[4]) == pytest.approx(np.sqrt(np.mean(np.square(norms))), abs=1e-6)


def test_points_in_another_system_keep_their_covariances(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "MMVII-PhgrProj/ObjCoordWorld/In"
    folder.mkdir(parents=True)
    frame = "RTL*657700*6860700*0*IGNF:LAMB93"
    given = ControlPoints.of(["A", "B"], [[10.0, 20, 30], [1000, -500, 5]], [[0.01, 0.02, 0.03]] * 2)
    (folder / "MesGCP-In.xml").write_text(points_text(given, "In", {"B": {"AdditionalInfo": "nail"}}))
    (folder / "CurSysCo.xml").write_text(system_text(frame))
    monkeypatch.chdir(tmp_path)
    assert main("change-sysco GeoC In There".split()) == 0
    assert main(["change-sysco", frame, "There", "Back"]) == 0
    back = read_control_points(tmp_path / "MMVII-PhgrProj/ObjCoordWorld/Back")
    there = read_control_points(tmp_path / "MMVII-PhgrProj/ObjCoordWorld/There")
    np.testing.assert_allclose(back.coordinates, given.coordinates, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(back.covariances, given.covariances, rtol=0.0, atol=1e-9)
    assert np.abs(there.covariances[0] - given.covariances[0]).max() > 1e-4
    entries = read_entries(tmp_path / "MMVII-PhgrProj/ObjCoordWorld/Back")
    assert [entries[name]["AdditionalInfo"] for name in "AB"] == ["", "nail"]


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("report-gcp x.* Fil Fil BA", "no image with measures"),
        ("report-gcp [ Fil Fil BA", "no regular expression"),
        ("report-gcp .* Fil Fil Nowhere", "there are 11P, BA, BA2, Calib, Resec"),
        ("resection .* Fil Fil 11P Out", "needs the calibration"),
        ("create-calib .* Fil Out --project nowhere", "holds no project"),
    ],
)
def test_what_cannot_run_says_why(panel, capsys, command, reason):
    assert main(command.split()) == 2
    assert reason in capsys.readouterr().err


@pytest.fixture
def far_away(panel):
    """The panel's points and orientation, said to be in a frame; the points in geocentric coordinates too."""
    frame, tree = "RTL*2*48*0*EPSG:4326", panel / "MMVII-PhgrProj"
    for folder in (tree / "PointsMeasure/Fil", tree / "Ori/BA"):
        (folder / "CurSysCo.xml").write_text(system_text(frame))
    assert main("change-sysco GeoC Fil Geo".split()) == 0
    return tree


def test_a_report_brings_points_in_the_system_of_the_orientation(far_away, capsys):
    details = []
    for points in ("Fil", "Geo"):
        assert main(f"report-gcp 043_.* {points} Fil BA".split()) == 0
        told = capsys.readouterr().err
        assert ("points converted from GeoC to RTL*2*48*0*EPSG:4326" in told) == (points == "Geo")
        details.append(
            (far_away / f"Reports/ReportGCP/BA_Mes-{points}-Fil/Detail.csv").read_text().splitlines()
        )
    first, second = (np.array([line.split(",")[2:] for line in lines[1:]], dtype=float) for lines in details)
    np.testing.assert_allclose(second, first, rtol=0.0, atol=2e-6)


def test_an_orientation_of_reference_in_another_system_is_refused(far_away, capsys):
    shutil.copytree(far_away / "Ori/BA", far_away / "Ori/Other")
    (far_away / "Ori/Other/CurSysCo.xml").write_text(system_text("GeoC"))
    command = "bundle-adjust 043_00.* BA Out GCP3D=[[Fil,1]] GCP2D=[[Fil,0.5]] RefOri=[Other,1,1]"
    assert main(command.split()) == 2
    assert "Ori/Other in GeoC: convert one of them" in capsys.readouterr().err
