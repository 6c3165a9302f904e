"""Blocks of other programs that came out wrong once, with the values of their own programs."""

import json
import shutil

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.formats import read_dbat, read_opk


@pytest.fixture
def case(shared_data, tmp_path, monkeypatch):
    """Goes into a copy of a case, and runs `obseq bundle` there: the code, the result, what was printed."""

    def run(name, *options):
        folder = tmp_path / name
        if not folder.exists():
            shutil.copytree(shared_data / f"image-cases/{name}", folder)
        monkeypatch.chdir(folder)
        code = main(["bundle", *options, "--json", "out.json"])
        return code, json.loads((folder / "out.json").read_text())

    return run


def frozen(result):
    (camera,) = result["cameras"]
    return {one["name"] for one in camera["parameters"] if one["sigma"] == 0.0}


def test_control_of_photomodeler_is_given_a_priori(case):
    """DBAT 0.9.2: sigma0 0.984904, redundancy 64; without it the lines of the export are no observations."""
    options = ("--photomodeler", "export.txt", "--freeze", ".*")
    _, result = case("pm-posterior-control", *options, "--control", "control_a_priori.csv")
    assert result["sigma0"] == pytest.approx(0.984904, abs=5e-6)
    assert result["redundancy"] == 64
    assert any("16 control points are no observations" in note for note in result["notes"])
    assert any("5 poses and 16 points are moved" in note for note in result["notes"])
    _, alone = case("pm-posterior-control", *options)
    assert alone["redundancy"] < 64 - 3 * 13


def test_the_camera_of_photomodeler_is_the_exact_one(case):
    """123.9392 mm of 77.976 mm for 12996 lines: the lines of the photos have 123.939."""
    _, result = case("pm-posterior-control", "--photomodeler", "export.txt", "--freeze", ".*")
    (focal,) = (one["value"] for one in result["cameras"][0]["parameters"] if one["name"] == "F")
    assert focal == pytest.approx(123.9392 * 12996 / 77.976, abs=1e-6)


@pytest.mark.parametrize(("sigma", "told"), [((), True), (("--image-sigma", "0.5"), False)])
def test_a_mark_without_sigma_is_left_out_by_name_or_gets_the_one_asked_for(case, sigma, told):
    options = ("--photomodeler", "export.txt", "--freeze", ".*")
    _, result = case("pm-one-mark-without-sigma", *options, *sigma)
    found = [
        note for note in result["notes"] if "1 marks have no sigma" in note and "999 in p9111.jpg" in note
    ]
    assert bool(found) == told


def test_second_features_of_colmap_are_counted(case):
    _, result = case("colmap-duplicate-feature", "--colmap", ".", "--datum", "centres", "--freeze", "PP.|K2")
    assert result["n_observations"] == 2400
    assert any(note.startswith("30 features are left out") for note in result["notes"])


def squares(result):
    return result["sigma0"] ** 2 * result["redundancy"]


def test_a_pinhole_of_colmap_gets_no_distortion(case):
    """pycolmap 4.2.1 ends at 173.962."""
    options = ("--colmap", ".", "--datum", "centres", "--image-sigma", "1")
    _, result = case("colmap-pinhole-gets-distortion", *options)
    assert squares(result) == pytest.approx(173.962, abs=6e-4)
    assert frozen(result) == {"K1", "K2", "K3", "p1", "p2", "b2"}


def test_a_fisheye_of_colmap_may_have_two_focal_lengths(case):
    """pycolmap 4.2.1 ends at 173.700."""
    _, result = case("colmap-fisheye-fx-fy", "--colmap", ".", "--datum", "centres")
    assert squares(result) == pytest.approx(173.700, abs=2e-3)


def solved_of_dbat(shared_data, script):
    """Its solution; nobody asks what is wrong with it, which takes fifty times as long."""
    block = read_dbat(shared_data / "image-cases/dbat-camera-in-a-file" / script)
    block.initialise()
    return block.solve()


def test_a_camera_of_dbat_may_be_in_a_file(shared_data):
    whole, apart = (solved_of_dbat(shared_data, f"{name}.xml") for name in ("camcaldemo", "camera_in_a_file"))
    assert apart.sigma0 == whole.sigma0 == pytest.approx(1.6148, abs=5e-5)


def test_single_parameters_of_dbat_are_held(shared_data):
    solution = solved_of_dbat(shared_data, "k3_named.xml")
    (camera,) = solution.cameras
    held = {name for name, sigma in solution.camera_precisions(camera).items() if sigma == 0.0}
    assert held == {"K3", "b2"}


def test_a_fixed_sensor_of_metashape_stays_fixed(case):
    """DBAT estimates no parameter of it, and has the images 1907 to 1937 m high."""
    _, result = case("metashape-fixed-sensor", "--metashape", "doc.xml")
    heights = [image["centre"][2] for image in result["images"]]
    assert min(heights) > 1906 and max(heights) < 1938
    assert len(frozen(result)) == len(result["cameras"][0]["parameters"])


def test_what_files_hold_or_free_is_overridden_with_a_note(case):
    _, freed = case("metashape-fixed-sensor", "--metashape", "doc.xml", "--free", "F", "--freeze", "K1")
    assert "F" not in frozen(freed) and "K1" in frozen(freed)
    said = " ".join(freed["notes"])
    assert "1 parameters are unknown by --free: F of unknown 0" in said
    assert "1 cameras are fixed in the file: unknown 0" in said and "--freeze:" not in said


def test_four_radial_terms_of_micmac_are_exact(shared_data):
    from obseq.project.micmac_v1 import read_v1_orientation

    folder = shared_data / "image-cases/micmac-v1-four-radial/Ori-Ground_mm3d"
    _, camera = read_v1_orientation(folder / "Orientation-IMGP4167.JPG.xml")
    terms = (
        -2.13187449928481487e-08,
        1.7226374299904674e-15,
        5.49746079672967297e-21,
        -2.41801731114306416e-27,
    )
    centre, focal = np.array([856.865441648138244, 577.614006671525772]), 2112.04115765381403
    corner = np.array([1728.0, 1152.0])
    square = np.sum((corner - centre) ** 2)
    ideal = centre + (corner - centre) * (1 + sum(term * square ** (k + 1) for k, term in enumerate(terms)))
    direction = [*(corner - centre) / focal, 1.0]
    np.testing.assert_allclose(camera.project([direction])[0], ideal, atol=1e-9)


def test_a_loose_block_of_micmac_arrives(case):
    """Four images and control good to a metre hardly determine a camera: it takes many small steps."""
    options = ("--micmac", "Ori-Ground_mm3d", "--micmac-measures", "GroundMeasure.xml")
    options += ("--micmac-points", "Ground-Pts3D.xml", "--image-sigma", "1")
    _, loose = case("micmac-v1-four-radial", *options)
    _, held = case("micmac-v1-four-radial", *options, "--freeze", ".*")
    assert loose["converged"] and held["converged"]
    assert loose["redundancy"] == held["redundancy"] - 7
    assert loose["sigma0"] < held["sigma0"]
    kinds = [point["kind"] for point in held["points"]]
    assert (kinds.count("control"), kinds.count("tie")) == (6, 1)


def test_a_title_of_pix4d_is_no_pose(case, tmp_path):
    options = ("--opk", "ext.txt", "--cameras", "cam.csv", "--measures", "mes.csv", "--control", "ctl.csv")
    code, result = case("pix4d-header", *options, "--image-sigma", "0.3", "--freeze", ".*")
    assert code == 0
    assert 0.7 < result["sigma0"] < 1.2
    path = tmp_path / "other.txt"
    path.write_text("image X Y Z Phi Omega Kappa\na 1 2 3 4 5 6\n")
    with pytest.raises(InputError, match=r"other\.txt:1: the title names the columns image X Y Z Phi Omega"):
        read_opk(path)
    assert read_opk(path, "NXYZPOK").images == ("a",)
