"""MMVII's commands on coded targets, as they are typed, on a project that is made up."""

from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.images import Camera, ControlPoints, Poses
from obseq.project import points_text, read_image_measures, write_orientation
from obseq.project.tree import read_tree, tree_text
from obseq.targets import Conditions, Scene, made, photograph, random_sheets
from obseq.targets.circles import radii_of, refined
from obseq.targets.measures import Measure, mmvii_text, read_ellipses, read_mmvii
from obseq.targets.pictures import png_bytes

TREE = Path("MMVII-PhgrProj")
CAMERA = Camera("C1", 480, 400, 700.0, [239.5, 199.5])  # type: ignore[arg-type]
LEVEL = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])  # from above: down is away from y


@pytest.fixture
def truths(tmp_path, monkeypatch):  # type: ignore[no-untyped-def]
    """An image of both families in an empty folder, and where its targets are."""
    monkeypatch.chdir(tmp_path)
    for line in ("CodedTargetGenerateEncoding CERN NbBits=14", "CodedTargetGenerateEncoding IGNIndoor"):
        assert main(["mmvii", *line.split()]) == 0
    names = ["003", "010", "055", "07", "14", "21"]
    scene = Scene(6, (55.0, 70.0), (0.0, 40.0), seed=4)
    sheets = random_sheets(CAMERA, [made("CERN"), made("IGNIndoor")], scene, names)
    image, truths = photograph(CAMERA, sheets, Conditions(seed=1))
    Path("C1_1.PNG").write_bytes(png_bytes(image))
    assert {one.family for one in truths} == {"CERN", "IGNIndoor"}
    return truths


def test_the_two_extractions_of_the_training(truths, capsys) -> None:  # type: ignore[no-untyped-def]
    """Each family into its folder; ellipses and grey levels of rings beside."""
    for name, family, options in (
        ("CodedTargetCircExtract", "CERN_Nbb14", "DiamMin=8 OutPointsMeasure=TargetsC ZoomVisuEllipse=1"),
        (
            "CodedTargetExtract",
            "IGNIndoor_Nbb12",
            "DMD=30 Debug=1023 Margin=0.3 Tolerance=0.2 OutPointsMeasure=TargetsI",
        ),
    ):
        (spec,) = map(str, Path().glob(f"{family}_*_FullSpecif.xml"))
        assert main(["mmvii", name, ".*PNG", spec, *options.split()]) == 0
        folder = TREE / "PointsMeasure" / options.split("PointsMeasure=")[1].split()[0]
        measures = read_image_measures(folder)
        wanted = {one.name: one.centre for one in truths if one.family == family.split("_")[0]}
        assert set(measures.point_names) == wanted.keys()
        for point, xy, sigma in zip(measures.point, measures.xy, measures.sigmas, strict=True):
            off = xy - wanted[measures.point_names[point]]
            assert np.abs(off).max() < 0.06 and (np.abs(off) < 5.0 * sigma).all()
    ellipses = read_ellipses(TREE / "ObjMesInstr/TargetsC/Attribute-MesIm-C1_1.PNG.xml")
    for one in truths:
        if one.family == "CERN":
            centre, shape = ellipses[one.name]
            assert 0.0 < np.hypot(*(centre - one.centre)) < 0.5
            assert np.sqrt(np.linalg.eigvalsh(shape)[1]) == pytest.approx(one.size / 6.0, rel=0.05)
    assert (TREE / "VISU/C1_1.PNG.png").is_file()
    assert not (TREE / "ObjMesInstr/TargetsI/Attribute-MesIm-C1_1.PNG.xml").exists()
    assert main(["mmvii", "CodedTargetExtract", ".*PNG", spec, "Restrikt=0."]) == 2
    assert "did you mean Restrict?" in capsys.readouterr().err


def test_an_image_that_cannot_be_read_is_named(truths, capsys) -> None:  # type: ignore[no-untyped-def]
    Path("C1_2.PNG").write_bytes(b"no image")
    (spec,) = map(str, Path().glob("CERN_*_FullSpecif.xml"))
    assert main(["mmvii", "CodedTargetCircExtract", ".*PNG", spec, "OutPointsMeasure=T"]) == 1
    assert "C1_2.PNG: is no image" in capsys.readouterr().out
    assert [path.name for path in (TREE / "ObjMesInstr/T").glob("MesIm*")] == ["MesIm-C1_1.PNG.xml"]


def circle(place: np.ndarray, radius: float, pose) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[no-untyped-def]
    """The ellipse that a horizontal circle is in the image."""
    turns = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    around = place + radius * np.column_stack((np.cos(turns), np.sin(turns), 0.0 * turns))
    pixels = CAMERA.project(pose.to_local(around))
    mean = pixels.mean(axis=0)
    x, y = (pixels - mean).T
    a, b, c, d, e = np.linalg.lstsq(np.column_stack((x * x, x * y, y * y, x, y)), np.ones(90), rcond=None)[0]
    conic = np.array([[a, 0.5 * b], [0.5 * b, c]])
    middle = np.linalg.solve(2.0 * conic, [-d, -e])
    return mean + middle, np.linalg.inv(conic) * (1.0 + middle @ conic @ middle)


def test_spots_get_names_and_true_centres(tmp_path, monkeypatch, capsys) -> None:  # type: ignore[no-untyped-def]
    """From ellipses alone: which point each is, how large the circles are, where their centres are."""
    monkeypatch.chdir(tmp_path)
    angle = 0.6
    tilt = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    poses = Poses.of(["C1_1.PNG"], [[0.1, -1.2, 2.0]], [tilt @ LEVEL], cameras=["C1"])
    pose = poses["C1_1.PNG"]
    places = {"P1": np.array([0.0, 0.1, 0.0]), "P2": np.array([0.4, 0.4, 0.05]), "P3": [-0.3, -0.1, 0.0]}
    ellipses = {name: circle(np.array(place), 0.06, pose) for name, place in places.items()}
    points = ControlPoints.of(list(places), np.array(list(places.values())), 0.001)
    given = [Measure("C1_1.PNG", name, centre, 1e-4 * np.eye(2)) for name, (centre, _) in ellipses.items()]
    assert radii_of(given, ellipses, CAMERA, pose, points) == pytest.approx([0.06] * 3, rel=1e-2)
    better = refined(given, ellipses, CAMERA, pose, points, 0.06)
    for one, before in zip(better, given, strict=True):
        truth = CAMERA.project(pose.to_local(np.array(places[one.point])[None]))[0]
        assert np.hypot(*(before.xy - truth)) > 0.15
        assert one.xy == pytest.approx(truth, abs=2e-3)

    write_orientation(TREE / "Ori/BA", poses, {"C1": CAMERA})
    (TREE / "ObjCoordWorld/Std").mkdir(parents=True)
    (TREE / "ObjCoordWorld/Std/MesGCP-Std.xml").write_text(points_text(points, "Std"), encoding="utf-8")
    (TREE / "ObjMesInstr/Std").mkdir(parents=True)
    spots = [
        Measure("C1_1.PNG", f"NONE_00000{k}", one.xy + 0.4, one.covariance) for k, one in enumerate(better)
    ]
    (TREE / "ObjMesInstr/Std/MesIm-C1_1.PNG.xml").write_text(mmvii_text("C1_1.PNG", spots))
    assert main("mmvii CodedTargetCompleteUncoded .*PNG BA 1.0 Std Std All".split()) == 0
    assert "3 spots have names now" in capsys.readouterr().out
    named = {one.point: one.xy for one in read_mmvii(TREE / "ObjMesInstr/All/MesIm-C1_1.PNG.xml")}
    assert named.keys() == places.keys()
    for one in better:
        assert named[one.point] == pytest.approx(one.xy + 0.4)

    entries = [
        {
            "Ellipse": {
                "V": (*np.linalg.inv(shape)[np.triu_indices(2)].tolist(), 0.0, 0.0),
                "C0": tuple(centre.tolist()),
            },
            "NameCode": name,
        }
        for name, (centre, shape) in ellipses.items()
    ]
    folder = TREE / "ObjMesInstr/Seen"
    folder.mkdir()
    (folder / "MesIm-C1_1.PNG.xml").write_text(mmvii_text("C1_1.PNG", given))
    (folder / "Attribute-MesIm-C1_1.PNG.xml").write_text(tree_text("Attributes", entries))
    assert main("mmvii CodedTargetRefineCirc .*PNG Seen Std BA Better".split()) == 0
    assert "3 centres corrected for circles of radius 0.0" in capsys.readouterr().out
    found = {one.point: one.xy for one in read_mmvii(TREE / "ObjMesInstr/Better/MesIm-C1_1.PNG.xml")}
    for one in better:
        assert found[one.point] == pytest.approx(one.xy, abs=5e-3)


def test_targets_are_put_into_images_as_the_original_does(tmp_path, monkeypatch, capsys) -> None:  # type: ignore[no-untyped-def]
    """`CodedTargetSimul`: they are found where the files say."""
    monkeypatch.chdir(tmp_path)
    assert main(["mmvii", "CodedTargetGenerateEncoding", "IGNIndoor"]) == 0
    (spec,) = map(str, Path().glob("IGNIndoor*_FullSpecif.xml"))
    Path("wall.png").write_bytes(png_bytes(np.full((420, 520), 120, dtype=np.uint8)))
    options = "PatNames=0[1-4] Radius=[35,40] Ratio=[0.8,1] NoiseAmpl=[0,0.02] SzK=2 SuplPref=A_"
    assert main(["mmvii", "CodedTargetSimul", ".*png", spec, *options.split()]) == 0
    truth = {
        one.point: one.xy for one in read_mmvii(TREE / "ObjMesInstr/Simul/MesIm-SimulTarget_A_wall.tif.xml")
    }
    assert set(truth) == {"01", "02", "03", "04"}
    assert main(["mmvii", "CodedTargetExtract", "SimulTarget.*tif", spec, "OutPointsMeasure=T"]) == 0
    found = read_mmvii(TREE / "ObjMesInstr/T/MesIm-SimulTarget_A_wall.tif.xml")
    assert {one.point for one in found} == set(truth)
    assert max(np.abs(one.xy - truth[one.point]).max() for one in found) < 0.06
    geometries = read_tree(TREE / "ObjMesInstr/Simul/SimulTarget_A_wall_GroundTruth.xml")["ResSimul"]["Geoms"]
    assert all(35.0 <= one["R2"][0] <= 40.0 and one["R1"][0] >= 0.79 * one["R2"][0] for one in geometries)
    capsys.readouterr()
    assert main(["mmvii", "CodedTargetSimul", ".*png", spec, "Radius=[80,90]"]) == 1
    assert "no room for" in capsys.readouterr().out
