"""`BOI` and `ClinoBOI` of `obseq bundle-adjust`, with block files as MMVII writes them."""

import json
import shutil

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.errors import InputError
from obseq.project.cameras import read_orientation
from obseq.project.contents import contents
from obseq.project.instruments.blocks import read_instrument_block
from obseq.project.instruments.making import axis_of
from obseq.project.instruments.rigid_blocks import pose_tree, read_block
from obseq.project.layout import ProjectTree
from obseq.project.options.bundle_options import ClinometerOptions, parse_options
from obseq.project.tree import data_text, read_tree, tree_text

CAMERA = """\
            <el>
               <Num>{number}</Num>
               <NameCalib>"{name}"</NameCalib>
               <PatTimeStamp>".*_(.*)_Scaled.tif"</PatTimeStamp>
               <SelIsPat>1</SelIsPat>
               <ImSelect>".*"</ImSelect>
               <IsInit>1</IsInit>
{pose}            </el> <!--Kth={number}-->
"""
SIGMA = (
    "<Tr><SumW>4</SumW><SumVW>{}</SumVW><Nb>5</Nb></Tr> <Rot><SumW>4</SumW><SumVW>{}</SumVW><Nb>5</Nb></Rot>"
)
SIGMAS = SIGMA.format(4e-3, 4e-6)
"""Means of 1e-3 and 1e-6."""
DESCRIPTION = (
    '<Pair><K>"{0}"</K><V><Type>"{1}"</Type><NameInstr>"{0}"</NameInstr><Sigma>{2}</Sigma></V></Pair>'
)
WORDS = ["bundle-adjust", ".*", "BA", "Mine", "GCP3D=[[Fil,1]]", "GCP2D=[[Fil,1]]", "InInstrBlock=In"]


@pytest.fixture(scope="module")
def prepared(shared_data, tmp_path_factory):
    """Some exposures of the panel, one of a single camera, with its rigid block in the older form."""
    folder = tmp_path_factory.mktemp("panel")
    project = shared_data / "mmvii-bundle-panel/MMVII-PhgrProj"
    left_out = "11P", "BA2", "Calib", "Resec", "*_001[3579]_*", "*_002?_*", "*_003[135689]_*"
    shutil.copytree(project, folder / "MMVII-PhgrProj", ignore=shutil.ignore_patterns(*left_out))
    main(["block-init", "BA", "(.*)_(.*)_Scaled.tif", "Rig", "--master=043", f"--project={folder}"])
    return folder


@pytest.fixture
def panel(prepared, tmp_path):
    """A copy for the block in the newer form, in `InstrBlock/In`."""
    shutil.copytree(prepared, tmp_path, dirs_exist_ok=True)
    return tmp_path


def _file(panel, clinometers="", described="", pairs=True, changes=()):
    """Writes the block as MMVII does: no name for the whole, pairs of names, means with their weights."""
    tree = panel / "MMVII-PhgrProj"
    old = read_block(tree / "RigBlock/Rig/RigidBloc_TheBloc.xml")
    poses, _ = read_orientation(tree / "Ori/BA")
    owner = {image.split("_")[0]: camera for image, camera in zip(poses.images, poses.cameras, strict=True)}
    names = [owner[name] for name in old.poses]
    cameras = "".join(
        CAMERA.format(number=k, name=owner[name], pose=_pose(old.poses[name]))
        for k, name in enumerate(old.poses)
    )
    pair = f'<Pair><K>"{names[0]}" "{names[1]}"</K><V>{SIGMAS}</V></Pair>' if pairs else ""
    own = "".join(DESCRIPTION.format(name, "Camera", SIGMAS) for name in names) + described
    text = (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<Root><Type>"MMVII_Serialization"</Type>'
        '<Version>"0.0.0"</Version><Data><Cams><NumMaster>0</NumMaster>'
        f"<NumPoseInstr><el>-1</el> <!--Kth=0--></NumPoseInstr><Set_Cams>{cameras}</Set_Cams></Cams>"
        f"<Clinos><Set_Clinos>{clinometers}</Set_Clinos></Clinos><SigmasPairs>{pair}</SigmasPairs>"
        f"<DescrIndiv>{own}</DescrIndiv><CstrRelRot></CstrRelRot><CstrOrthog></CstrOrthog></Data></Root>\n"
    )
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path = tree / "InstrBlock/In/FileRB_B.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def _pose(pose):
    lines = tree_text("Pose", pose_tree(pose)).splitlines()
    return "\n".join(lines[5:-2]) + "\n"


def _run(panel, *words, code=0):
    """The result of an adjustment."""
    assert main([*WORDS, *words, f"--project={panel}", f"--json={panel / 'r.json'}"]) == code
    return json.loads((panel / "r.json").read_text())


def test_an_instrument_block_is_as_the_old_form_with_the_same_sigmas(panel, capsys):
    path = _file(panel)
    new = _run(panel, "BOI=[[B,10,10],[]]", "OutInstrBlock=Out")
    words = [word for word in WORDS if word != "InInstrBlock=In"]
    assert (
        main([*words, "BRDirIn=Rig", "BRW=[1e-2,1e-5]", f"--project={panel}", f"--json={panel}/o.json"]) == 0
    )
    old = json.loads((panel / "o.json").read_text())
    assert new["sigma0"] == pytest.approx(old["sigma0"], rel=1e-9)
    assert len(new["unpaired"]) == 1
    written = read_instrument_block(panel / "MMVII-PhgrProj/InstrBlock/Out/FileRB_B.xml")
    place = new["rigid_blocks"][0]["places"][1]
    np.testing.assert_array_equal(written.cameras[1].pose.centre, place["centre"])
    shifts = [np.linalg.norm(item["translation"]) for item in new["rigid_blocks"][0]["exposures"]]
    assert next(iter(written.pairs.values()))[0] == pytest.approx(np.mean(shifts), rel=1e-12)
    assert written.instruments[written.master] == next(iter(written.pairs.values()))
    assert list(written.data) == list(read_tree(path))
    assert _run(panel, "BOI=[[B,1e-2,1e-5,0,false]]")["sigma0"] == pytest.approx(old["sigma0"], rel=1e-9)


def test_a_block_file_comes_back_as_it_was_and_is_understood(panel, tmp_path):
    path = _file(panel, described=DESCRIPTION.format("tilt", "Clino", SIGMAS))
    tree = read_tree(path)
    assert tree["SigmasPairs"][0]["K"] == (*read_instrument_block(path).pairs,)[0]
    for as_json, ending in ((False, "xml"), (True, "json")):
        again = tmp_path / f"FileRB_B.{ending}"
        again.write_text(data_text(tree, as_json=as_json))
        found = read_instrument_block(again)
        assert (found.pairs, found.instruments) == (
            read_instrument_block(path).pairs,
            read_instrument_block(path).instruments,
        )
    assert read_tree(tmp_path / "FileRB_B.xml") == tree
    known = [item for item in contents(ProjectTree.at(panel)) if item.path == path]
    assert (known[0].kind, known[0].unknown) == ("instrument block", ())


def test_a_soft_gauge_changes_no_fit_and_an_attachment_does(panel):
    _file(panel)
    hard = _run(panel, "BOI=[[B,10,10],[]]")
    for gauge in ("[1,1]", "[1,0]", "[0,1]"):
        soft = _run(panel, f"BOI=[[B,10,10],{gauge}]")
        assert soft["redundancy"] == hard["redundancy"]
        assert soft["sigma0"] == pytest.approx(hard["sigma0"], rel=1e-6)
        held = [sigma == 0.0 for sigma in soft["rigid_blocks"][0]["places"][0]["sigmas"]]
        assert held == [gauge[1] == "0"] * 3 + [gauge[3] == "0"] * 3
    # the second place becomes six observations, of weights n pairs over 2 cameras
    attached = _run(panel, "BOI=[[B,10,10],[],[1,1]]")
    assert attached["redundancy"] == hard["redundancy"] + 6
    given = read_instrument_block(panel / "MMVII-PhgrProj/InstrBlock/In/FileRB_B.xml").cameras[1].pose
    shifts = [
        np.linalg.norm(np.array(found["rigid_blocks"][0]["places"][1]["centre"]) - given.centre)
        for found in (hard, attached)
    ]
    assert shifts[1] < 0.1 * shifts[0]


CLINOMETER = (
    '<el><Name>"{}"</Name><IsInit>1</IsInit><PolCorr><el>0</el><el>1</el><el>0</el><el>0</el></PolCorr>'
    "<PtNorm>{}</PtNorm></el>"
)


def _tilts(panel, offset=0.0, **changes):
    """Two clinometers of camera 043, whose readings fit the poses, in a block file and a file of readings."""
    axes = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0])}
    clinometers = "".join(
        CLINOMETER.format(name, " ".join(map(repr, map(float, axis)))) for name, axis in axes.items()
    )
    right = '<CstrOrthog><Pair><K>"x" "y"</K><V><Sigma>0.001</Sigma></V></Pair></CstrOrthog>'
    own = "".join(DESCRIPTION.format(name, "Clino", SIGMA.format(0.0, 4e-4)) for name in axes)
    path = _file(
        panel, clinometers, own, changes=[("<CstrOrthog></CstrOrthog>", right), *changes.get("block", ())]
    )
    poses, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/BA")
    images = [image for image in poses.images if image.startswith("043")]
    rng = np.random.default_rng(1)
    rows = []
    for image in images:
        sines = [poses[image].rotation[2] @ axis - offset for axis in axes.values()]
        angles = np.arcsin(sines) + rng.normal(0.0, 1e-4, 2)
        rows.append({"Ident": image.split("_")[1], "Angles": [(float(angle),) for angle in angles]})
    rows += changes.get("more", [])
    readings = panel / "MMVII-PhgrProj/MeasureClino/Mc/ClinoMeasures.xml"
    readings.parent.mkdir(parents=True, exist_ok=True)
    readings.write_text(data_text({"NamesClino": ["x", "y"], "SetMeasures": rows}))
    return path, readings, images


def test_clinometers_of_a_block_join_with_their_readings(panel, capsys):
    path, _, images = _tilts(panel, offset=0.002)
    without = _run(panel, "BOI=[[B,10,10]]")
    assert any(
        "Clinos is not used by the adjustment (ClinoBOI joins it)" in note for note in without["notes"]
    )
    words = ["BOI=[[B,10,10]]", "InMeasureClino=Mc", "OutInstrBlock=Out"]
    found = _run(panel, *words, "ClinoBOI=[[B,100,1],[0],[1]]")
    assert found["redundancy"] == without["redundancy"] + 2 * len(images) + 1 - 4 - 2
    first = found["clinometers"][0]
    assert first["correction"][0] == pytest.approx(0.002, abs=1e-3)  # the axes take a part of it
    assert first["correction"][1:] == [1.0, 0.0, 0.0]
    assert first["rms"] == pytest.approx(1e-4, rel=0.5)
    written = read_instrument_block(panel / "MMVII-PhgrProj/InstrBlock/Out/FileRB_B.xml")
    np.testing.assert_array_equal(written.clinometers[0].axis, first["axis"])
    assert written.clinometers[0].correction == tuple(first["correction"])
    assert written.right_angles == {("x", "y"): 0.001}
    assert read_instrument_block(path).clinometers[0].correction == (0.0, 1.0, 0.0, 0.0)


def test_readings_without_an_image_are_refused_or_left_aside(panel, capsys):
    _tilts(panel, more=[{"Ident": "9999", "Angles": [(0.1,), (0.2,)]}])
    words = ["BOI=[[B]]", "InMeasureClino=Mc"]
    assert main([*WORDS, *words, "ClinoBOI=[[B]]", f"--project={panel}"]) == 2
    assert "ClinoMeasures.xml: exposure 9999 has no image" in capsys.readouterr().err
    assert "1 exposures have no image: 9999" in _run(panel, *words, "ClinoBOI=[[],[0,1]]")["notes"][0]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("<NumMaster>0<", "<NumMaster>-1<", "NumMaster is -1; the cameras have"),
        ("<el>-1</el>", "<el>1</el>", "NumPoseInstr should name one camera, the master"),
        ("<el>-1</el>", "<el>7</el>", "NumPoseInstr is 7; the cameras have"),
        ("<IsInit>1</IsInit>\n", "<IsInit>0</IsInit>\n", "has no pose yet"),
        ("<SumW>4", "<SumW>0", "no sigma is known yet"),
        ("<SelIsPat>1", "<SelIsPat>0", "which is not at"),
        ("<PtNorm>1.0", "<PtNorm>0.0", "clinometer x has no axis yet"),
        ('<K>"x" "y"', '<K>"x" "z"', "CstrOrthog names z"),
        ('<K>"x" "y"', '<K>"x"', "a key should be two names"),
        ('"y"', '"v"', "has the clinometers x, y"),
    ],
)
def test_block_files_that_do_not_do_are_refused(panel, capsys, before, after, message):
    path, _, _ = _tilts(panel)
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    words = ["BOI=[[B]]", "InMeasureClino=Mc", "ClinoBOI=[[B]]", "OutInstrBlock=Out"]
    assert main([*WORDS, *words, f"--project={panel}"]) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert "FileRB_B.xml" in shown
    assert not (panel / "MMVII-PhgrProj/Ori/Mine").exists()
    assert not (panel / "MMVII-PhgrProj/InstrBlock/Out").exists()


def test_images_of_a_block_may_come_from_a_list(panel):
    poses, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/BA")
    _file(panel, changes=[("<SelIsPat>1", "<SelIsPat>0"), ('<ImSelect>".*"', '<ImSelect>"used.xml"')])
    chosen = [image for image in poses.images if not image.endswith("_0002_Scaled.tif")]
    assert len(chosen) > 0
    (panel / "used.xml").write_text(tree_text("SetOfName", chosen[:-4]))
    shown = _run(panel, "BOI=[[B]]")["unpaired"]
    assert any("images are of none of its exposures" in item["reason"] for item in shown)


def test_blocks_are_found_by_name(panel, capsys):
    assert main([*WORDS, "BOI=[[Other]]", f"--project={panel}"]) == 2
    assert "BOI names Other; there are none" in capsys.readouterr().err
    path = _file(panel, pairs=False)
    assert main([*WORDS, "BOI=[[B]]", f"--project={panel}"]) == 2
    assert f"{path}: SigmasPairs is empty" in capsys.readouterr().err


def test_options_of_blocks_are_read_as_mmvii_writes_them():
    words = ["BOI=[[B,2,3,0,false],[1,0],[4,5]]", "ClinoBOI=[[B,6],[1,1],[1,0,1]]", "InMeasureClino=M"]
    found = parse_options(words).instrument
    assert (found.block, found.factors, found.save, found.relative) == ("B", (2.0, 3.0), False, False)
    assert (found.gauge, found.attachment) == ((1.0, 0.0), (4.0, 5.0))
    assert found.clinometers == ClinometerOptions("M", (6.0, 1.0), True, True, (0, 2))
    assert parse_options(["BOI=[[],[]]"]).instrument.attachment is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["InInstrBlock=R"], "InInstrBlock has no effect without BOI"),
        (["ClinoBOI=[[B]]"], "ClinoBOI has no effect without BOI"),
        (["BOI=[[B]]", "InMeasureClino=M"], "InMeasureClino has no effect without ClinoBOI"),
        (["BOI=[[B]]", "ClinoBOI=[[C]]"], "ClinoBOI names the block C, BOI names B"),
        (["BOI=[B]"], "takes lists in brackets"),
        (["BOI=[[B],[1,1],[1,1],[1]]"], "takes lists in brackets"),
        (["BOI=[[B],[1,1,1]]"], "a list has more values than these"),
        (["BOI=[[B],[],[0,1]]"], "BOI: cTr and cRot must be above zero"),
        (["BOI=[[B,0]]"], "BOI: mTr and mRot must be above zero"),
        (["BOI=[[B,1,1,x]]"], "BOI: 'x' is neither true nor false"),
    ],
)
def test_options_of_blocks_that_mean_nothing_are_refused(words, message):
    with pytest.raises(InputError, match=message):
        parse_options(words)


def test_a_body_from_nothing_to_its_adjustment(panel, monkeypatch, capsys):
    """Readings in gon are imported, the body is named, placed, and adjusted, by MMVII's commands."""
    monkeypatch.chdir(panel)
    poses, _ = read_orientation(panel / "MMVII-PhgrProj/Ori/BA")
    axes = {"a": np.array([0.6, 0.0, 0.8]), "b": np.array([0.8, 0.1, -0.6])}
    rng, lines = np.random.default_rng(2), ["# exposure, and for each clinometer its name, gon, sigma"]
    for image in poses.images:
        if image.startswith("043"):
            words = [image.split("_")[1]]
            for name, axis in axes.items():
                sine = poses[image].rotation[2] @ axis / np.linalg.norm(axis)
                words += [name, f"{np.degrees(np.arcsin(sine)) / 0.9 + rng.normal(0, 0.005):.5f}", "0.005"]
            lines.append(" ".join(words))
    (panel / "tilts.txt").write_text("\n".join(lines) + "\n")
    assert main(["import-clinometers", "tilts.txt", "ImNASNAS", "Mc", "--unit=gon"]) == 0
    for line in (
        "BlockInstrEdit B0 PatsIm4Cam=['.*_Scaled.tif','.*_(.*)_Scaled.tif'] InMeasureClino=Mc NameBloc=B",
        "BlockInstrEdit B0 CstrOrthog=[[a,b,0.1]] NameBloc=B",
        "BlockInstrInitCam .* B0 BA B1 NameBloc=B",
        "BlockInstrInitClino .* B1 BA Mc In NameBloc=B",
    ):
        assert main(["mmvii", *line.split()]) == 0, capsys.readouterr().err
    made = read_instrument_block(panel / "MMVII-PhgrProj/InstrBlock/In/FileRB_B.xml")
    assert [item.name for item in made.clinometers] == ["a", "b"] and made.right_angles == {("a", "b"): 0.1}
    for item in made.clinometers:
        true = axes[item.name] / np.linalg.norm(axes[item.name])
        np.testing.assert_allclose(item.axis, true, atol=2e-3)
        assert made.instruments[item.name][1] == pytest.approx(0.005 * np.pi / 200, rel=0.6)
    (pair,) = made.pairs.values()
    assert pair[0] == pytest.approx(1.33e-4 * 1000, rel=0.5)  # mm: as the original's block of the panel
    found = _run(panel, "BOI=[[B,10,10]]", "InMeasureClino=Mc", "ClinoBOI=[[B,1,1]]")
    for one, axis in zip(found["clinometers"], axes.values(), strict=True):
        np.testing.assert_allclose(one["axis"], axis / np.linalg.norm(axis), atol=2e-3)


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("ImAX", "1 0.1 0.2", "is no format of readings"),
        ("ImNAA", "1 a 0.1 0.2", "each of the 2 clinometers has a name"),
        ("ImNA", "1 a 0.1\n2 b 0.2", "tilts.txt:2: has the clinometers b; before, a"),
        ("ImA", "1 0.1\n1 0.2", "exposure"),
        ("ImA", "1 zero", "tilts.txt:1: could not convert"),
        ("ImAA", "1 0.1", "tilts.txt:1: has 2 fields; ImAA takes 3"),
        ("ImA", "# nothing", "holds no readings"),
    ],
)
def test_files_of_readings_that_do_not_do_are_refused(tmp_path, monkeypatch, capsys, form, text, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tilts.txt").write_text(text + "\n")
    assert main(["mmvii", "ImportMeasuresClino", "tilts.txt", form, "Mc"]) == 2
    assert said in capsys.readouterr().err


def test_images_that_are_tilted_alike_say_nothing_of_an_axis():
    up = np.array([[0.1, 0.2, 0.97]] * 5)
    with pytest.raises(InputError, match="tilted alike"):
        axis_of(up, np.zeros(5), "c")
    rng = np.random.default_rng(1)
    turns = rng.normal([0.0, 0.0, 1.0], 0.2, (40, 3))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    axis = np.array([0.36, 0.48, 0.8])
    found = axis_of(turns, turns @ axis + rng.normal(0.0, 1e-4, 40), "c")
    assert np.linalg.norm(found) == pytest.approx(1.0)
    np.testing.assert_allclose(found, axis, atol=2e-3)
