"""`obseq bundle-adjust` on the panel's project tree, in both spellings, and the options it refuses."""

import json
import re
import shutil

import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.project.cameras import read_orientation
from obseq.project.options.bundle_options import Set2D, Set3D, parse_options
from obseq.project.options.option_values import parse_value


@pytest.fixture
def panel(shared_data, tmp_path):
    shutil.copytree(shared_data / "mmvii-bundle-panel/MMVII-PhgrProj", tmp_path / "MMVII-PhgrProj")
    return tmp_path


@pytest.mark.parametrize(
    "spelling", [["GCP3D=[[Fil,1,New]]", "GCP2D=[[Fil,0.5]]"], ["GCPDir=Fil", "GCPW=[1,0.5]"]]
)
def test_the_panel_is_adjusted_as_on_paper(panel, shared_data, capsys, spelling):
    data = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    expected = data["independent_adjustments"]["gcp_sigma1_image05"]
    words = ["bundle-adjust", ".*", "Resec", "Mine", *spelling, f"--project={panel}"]
    assert main([*words, f"--json={panel / 'r.json'}", "-v", "--show", "images"]) == 0
    record = json.loads((panel / "r.json").read_text())
    assert record["sigma0"] == pytest.approx(expected["sigma0"], rel=1e-7)
    poses, cameras = read_orientation(panel / "MMVII-PhgrProj/Ori/Mine")
    for name, parameters in expected["calibrations"].items():
        assert cameras[name].focal == pytest.approx(parameters["F"]["value"], abs=1e-5)
    image = poses.images[0]
    assert poses[image].centre == pytest.approx(expected["centres"][image], abs=1e-6)
    assert (panel / "MMVII-PhgrProj/ObjCoordWorld/New/MesGCP-NewGCP.xml").is_file() == (
        "New" in str(spelling)
    )
    told = capsys.readouterr().out
    assert "NOT CONVERGED" not in told
    assert "\nImages\n" in told and "Seconds: read " in told
    assert main([*words, "--show", "stars"]) == 2  # nothing is read for a table that there is not
    assert "there is no such table; there are residuals, measures, points, images" in capsys.readouterr().err


def test_measures_weigh_by_the_covariances_of_their_files_when_asked(panel, capsys):
    words = ["bundle-adjust", ".*", "Resec", "Mine", "GCP3D=[[Fil,1]]", f"--project={panel}"]
    folder = panel / "MMVII-PhgrProj/PointsMeasure/Fil"
    half = re.compile(r"<Sigma2>[^<]*</Sigma2>")
    for path in folder.glob("MesIm*"):
        path.write_text(half.sub("<Sigma2>0.25 0 0.25</Sigma2>", path.read_text()))
    found = []
    for measures in ("GCP2D=[[Fil,0.5]]", "GCP2D=[[Fil,0]]"):
        assert main([*words, measures, f"--json={panel / 'r.json'}"]) == 0
        found.append(json.loads((panel / "r.json").read_text())["sigma0"])
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    path = min(folder.glob("MesIm*"))
    path.write_text(half.sub("<Sigma2>0.25 0.2 0.25</Sigma2>", path.read_text()))
    assert main([*words, "GCP2D=[[Fil,0]]", f"--json={panel / 'r.json'}"]) in (0, 1)
    assert json.loads((panel / "r.json").read_text())["sigma0"] != pytest.approx(found[0], rel=1e-4)
    assert main([*words, "GCP2D=[[Fil,0,2]]"]) == 2
    assert "SI 0 takes the covariances" in capsys.readouterr().err


def test_a_rigid_block_of_the_tree_joins(panel, shared_data, capsys):
    data = json.loads((shared_data / "mmvii-bundle-panel/expected.json").read_text())
    expected = data["independent_adjustments"]["rigid_block_from_BA"]
    project = f"--project={panel}"
    main(["block-init", "BA", "(.*)_(.*)_Scaled.tif", "Rig", "--master=043", project])
    words = ["GCP3D=[[Fil,1]]", "GCP2D=[[Fil,1]]", "BRDirIn=Rig", "BRW=[1e-2,1e-5]", "OutRigBlock=Rig2"]
    code = main(["bundle-adjust", ".*", "BA", "Mine", *words, project, f"--json={panel / 'r.json'}"])
    assert code == 0  # an exposure with one image is no fault, but it is said
    record = json.loads((panel / "r.json").read_text())
    (alone,) = record["unpaired"]
    assert "has no image that is adjusted" in alone["reason"]
    out = capsys.readouterr().out
    assert "Not in pairs" in out
    assert alone["name"] in out
    # MMVII counts twelve equations where a pair has six: 19 pairs here
    redundancy = expected["n_equations"] - expected["n_unknowns"]
    sigma0 = expected["sigma0"] * (redundancy / (redundancy - 6 * 19)) ** 0.5
    assert record["sigma0"] == pytest.approx(sigma0, rel=1e-6)
    assert (panel / "MMVII-PhgrProj/RigBlock/Rig2/RigidBloc_TheBloc.xml").is_file()


def test_lists_are_read_as_mmvii_writes_them():
    assert parse_value("[[a,1],[b,[2,3]]]", "X") == [["a", "1"], ["b", ["2", "3"]]]
    assert parse_value("word", "X") == "word"
    options = parse_options(["GCPDir=T", "GCPW=[0,0.5,1,3,2]", "AddGCPW=[[U,-1,2]]", "GCPDirOut=N"])
    assert options.points == (Set3D("T", 0.0, "N", True), Set3D("U", -1.0, None, True))
    assert options.measures == (Set2D("T", 0.5, 1.0, 3.0, 2.0), Set2D("U", 2.0))
    assert parse_options(["GCP2D=[F,1,-1,5]"]).measures == (Set2D("F", 1.0, None, 5.0),)
    assert parse_options(["PoseVisc=[0.1,-1]"]).viscosity == (0.1, None)
    assert parse_options(["PPFreeCal=[[cam,F,4]]"]).freed == (("cam", "F", 0.5),)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["ThrRej=3"], "'ThrRej=3' is no option"),
        (["NbIter=x"], "NbIter=x is not a whole number"),
        (["BRW=[1]"], "BRW takes 2 numbers"),
        (["BRW=[1,a]"], "BRW: 'a' is not a number"),
        (["BRDirIn=R"], "have no effect without BRW"),
        (["TPDir=R"], "TPDir has no effect"),
        (["GCP2D=[[F,nan]]"], "GCP2D: 'nan' is not a number"),
        (["GCP3D=[[F,1]", "NbIter=1"], "a bracket is not closed"),
        (["GCP3D=[[F,1]]]"], "is left over"),
        (["GCP3D=[[F]]"], "each element takes 2 to 3 values"),
        (["GCPDir=F"], "go together"),
        (["GCPDir=F", "GCPW=[1,1]", "GCP2D=[[F,1]]"], "the spelling of 2024"),
        (["NbIter=1", "NbIter=2"], "given twice"),
    ],
)
def test_options_that_mean_nothing_are_refused(words, message):
    with pytest.raises(InputError, match=message):
        parse_options(words)
