import itertools
import json
import struct

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.geometry import RigidMotion, exponential
from obseq.images import Camera, ControlPoints, ImagePoints, Poses
from obseq.project import (
    BlockFile,
    block_text,
    calibration_text,
    chosen,
    find_pairs,
    measures_text,
    names_text,
    pairs_text,
    points_text,
    pose_text,
    read_block,
    read_calibration,
    read_control_points,
    read_image_measures,
    read_names,
    read_orientation,
    read_pairs,
    read_pose,
    read_rules,
    read_system,
    read_tracks,
    read_tree,
    rules_text,
    system_text,
    tree_text,
    write_orientation,
)

BOTH = pytest.mark.parametrize("ending", ["xml", "json"])
CAMERA = Camera(
    "Calib_A",
    2000,
    1333,
    focal=2095.4713926848967,
    principal_point=np.array([987.3472800008948, 664.4695737484234]),
    degree=(3, 1, 1),
    distortion={"K1": -0.098, "K2": 0.1062, "K3": -1 / 3, "p1": -2e-4, "p2": 1e-300, "b1": 0.1, "b2": -0.7},
)


def rotation(*axis):
    return exponential(np.array(axis))


@BOTH
def test_calibrations_come_back_to_the_last_bit(tmp_path, ending):
    path = tmp_path / f"Calib_A.{ending}"
    path.write_text(calibration_text(CAMERA, as_json=ending == "json"))
    found = read_calibration(path)
    np.testing.assert_array_equal(found.parameters, CAMERA.parameters)
    assert (found.width, found.height, found.degree, found.name) == (2000, 1333, (3, 1, 1), "Calib_A")


@BOTH
def test_orientations_come_back_to_the_last_bit(tmp_path, ending):
    turned = np.array([rotation(0.1, -2.0, 0.3), rotation(3.0, 0.0, 0.1)])
    poses = Poses.of(
        ['a "1".jpg', "b&<.jpg"], [[1 / 3, 2, 3], [1e9 + 0.1, -0.0, 7]], turned, cameras="Calib_A"
    )
    write_orientation(tmp_path, poses, {"Calib_A": CAMERA}, as_json=ending == "json")
    found, cameras = read_orientation(tmp_path)
    np.testing.assert_array_equal(found.centres, poses.centres)
    np.testing.assert_array_equal(found.rotations, poses.rotations)
    assert (found.images, found.cameras, list(cameras)) == (poses.images, poses.cameras, ["Calib_A"])


@BOTH
def test_measures_come_back(tmp_path, ending):
    given = ImagePoints.of(["i.tif"] * 2, ["p", "q"], [[1 / 3, 2.5], [3, 4e-7]], [[0.5, 0.25], [1, 2]])
    (tmp_path / f"MesIm-i.tif.{ending}").write_text(measures_text("i.tif", given, as_json=ending == "json"))
    found = read_image_measures(tmp_path)
    np.testing.assert_array_equal(found.xy, given.xy)
    np.testing.assert_array_equal(found.sigmas, given.sigmas)
    assert found.point_names == ("p", "q")


@BOTH
def test_control_points_come_back(tmp_path, ending):
    given = ControlPoints.of(["A", "B", "C"], np.eye(3) / 3, [[0.01] * 3, [0.0] * 3, [np.inf] * 3])
    (tmp_path / f"MesGCP-set.{ending}").write_text(points_text(given, "set", as_json=ending == "json"))
    (tmp_path / f"CurSysCo.{ending}").write_text(
        system_text("RTL*1*2*3*IGNF:LAMB93", as_json=ending == "json")
    )
    found = read_control_points(tmp_path)
    np.testing.assert_array_equal(found.coordinates, given.coordinates)
    np.testing.assert_array_equal(found.is_free, given.is_free)
    np.testing.assert_array_equal(found.is_held, given.is_held)
    np.testing.assert_allclose(found.sigmas[0], 0.01)
    assert read_system(tmp_path) == "RTL*1*2*3*IGNF:LAMB93"
    assert read_control_points(tmp_path, is_chosen=lambda name, info: name == "B").names == ("B",)


def test_places_that_are_no_rotation_are_refused(tmp_path):
    poses = {"C1": RigidMotion(np.zeros(3), np.diag([1.0, 1.0, -1.0]))}
    path = tmp_path / "RigidBloc_B.xml"
    path.write_text(block_text(BlockFile("B", "C1", "(.*)_(.*)", 1, 2, poses)))
    with pytest.raises(InputError, match=r"PoseRel: C1: RotMatrix is no rotation"):
        read_block(path)


@BOTH
def test_blocks_come_back(tmp_path, ending):
    poses = {
        "C1": RigidMotion(np.zeros(3), np.eye(3)),
        "C2": RigidMotion(np.array([0.61, 0, 0.01]), rotation(0.0, 0.1, 0)),
    }
    given = BlockFile("TheBloc", "C1", r"(.*)_(.*)\.JPG", 1, 2, poses, {"SeparatorInv": "@"})
    path = tmp_path / f"RigidBloc_TheBloc.{ending}"
    path.write_text(block_text(given, as_json=ending == "json"))
    found = read_block(path)
    np.testing.assert_array_equal(found.poses["C2"].rotation, poses["C2"].rotation)
    assert (found.content["SeparatorInv"], found.pattern, found.master) == ("@", given.pattern, "C1")
    assert found.exposures(["C1_7.JPG", "C2_7.JPG"]) == {"7": {"C1": "C1_7.JPG", "C2": "C2_7.JPG"}}
    with pytest.raises(InputError, match=r"C3\.tif does not match"):
        found.exposures(["C3.tif"])


@BOTH
def test_rules_and_names_come_back(tmp_path, ending):
    from obseq.project import Rules

    tries = {
        "Focalmm": ((r".*_2\.jpg", "NONE"), (r".*\.jpg", "24")),
        "ModelCam": ((r".*", "NIKON D5600"),),
        "AdditionalName": ((r"(.*)_(.*)\.jpg", "$1x$2$&"),),
    }
    (tmp_path / f"m.{ending}").write_text(rules_text(Rules(tries), as_json=ending == "json"))
    rules = read_rules(tmp_path / f"m.{ending}")
    assert rules.value("Focalmm", "a_2.jpg") == "24"
    assert rules.value("Focalmm", "a_2.tif") is None
    assert rules.value("AdditionalName", "a_2.jpg") == "ax2a_2.jpg"
    assert rules.calibration_name("043_5.jpg") == "CalibIntr_CamNIKON_D5600_Add043x5043_5.jpg_Foc24000"
    (tmp_path / f"n.{ending}").write_text(names_text(["b", "a"], as_json=ending == "json"))
    assert read_names(tmp_path / f"n.{ending}") == ["b", "a"]
    assert chosen(["im1.jpg", "im12.jpg"], r"im\d\.jpg") == ["im1.jpg"]


def test_the_panel_is_read_in_both_spellings(shared_data):
    panel = shared_data / "mmvii-bundle-panel"
    poses, cameras = read_orientation(panel / "MMVII-PhgrProj" / "Ori" / "BA2")
    assert len(poses) == 39
    assert sorted(cameras) == [
        "CalibIntr_CamNIKON_D5600_Add043_Foc24",
        "CalibIntr_CamNIKON_D5600_Add671_Foc24",
    ]
    image, calibration, pose = read_pose(panel / "json" / "Ori-PerspCentral-043_0005_Scaled.tif.json")
    np.testing.assert_array_equal(poses[image].rotation, pose.rotation)
    np.testing.assert_array_equal(poses[image].centre, pose.centre)
    twin = read_calibration(panel / "json" / f"{calibration}.json")
    np.testing.assert_array_equal(twin.parameters, cameras[calibration].parameters)
    folder = panel / "MMVII-PhgrProj" / "PointsMeasure" / "Fil"
    measures, points = read_image_measures(folder), read_control_points(folder)
    assert (len(measures), len(points), len(measures.image_names)) == (2032, 239, 39)
    np.testing.assert_allclose(points.sigmas, 1.0)
    rules = read_rules(panel / "MMVII-PhgrProj" / "MetaData" / "Std" / "CalcMTD.xml")
    assert rules.value("AdditionalName", "043_0005_Scaled.tif") == "043"
    assert read_system(folder) == "LocalNONE"


def test_angles_of_a_pose_are_those_of_the_original(shared_data):
    path = shared_data / "mmvii-bundle-panel/MMVII-PhgrProj/Ori/BA/Ori-PerspCentral-043_0005_Scaled.tif.xml"
    image, calibration, pose = read_pose(path)
    written = pose_text(image, calibration, pose)
    original = read_tree(path)["CameraPose"]
    again = {line.split(">")[0].strip(" <"): line for line in written.splitlines()}
    for key in ("EQ", "WPK", "YPR"):
        numbers = np.array(again[key].split(">")[1].split("<")[0].split(), dtype=float)
        sign = np.sign(numbers[0] * original[key][0]) if key == "EQ" else 1.0  # a quaternion and its opposite
        np.testing.assert_allclose(sign * numbers, original[key], rtol=0.0, atol=1e-9)


def test_what_is_not_known_is_kept(tmp_path):
    text = tree_text("Thing", {"A": "x", "New": {"B": (1, 2.5)}, "L": [{"Q": ""}, "y"], "E": []})
    (tmp_path / "t.xml").write_text(text)
    tree = read_tree(tmp_path / "t.xml")
    assert tree == {"Thing": {"A": "x", "New": {"B": (1, 2.5)}, "L": [{"Q": ""}, "y"], "E": []}}
    assert tree_text("Thing", tree["Thing"]) == text
    (tmp_path / "t.json").write_text(tree_text("Thing", tree["Thing"], as_json=True))
    assert read_tree(tmp_path / "t.json") == tree


BOMB = '<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><Root><Type>&b;</Type></Root>'
ROOT = '<Root><Type>"MMVII_Serialization"</Type><Version>"0.0.0"</Version><Data>{}</Data></Root>'


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "empty"),
        ("<Root>", "broken"),
        (BOMB, "refused"),
        ("<Root></Root>", "not a file of MMVII"),
        ('{"Type": "MMVII_Serialization", "Data": {"a": NaN}}', "not a finite number"),
        ('{"Type": "x", "Data": {}}', "not a file of MMVII"),
        (ROOT.format("<a>1 2 x</a>"), "'x' is not a number"),
        (ROOT.format('<a>"open</a>'), "not closed"),
        (ROOT.format("<a>nan</a>"), "not a finite number"),
        (ROOT.format(f"<a>{'9' * 400}</a>"), "not a finite number"),
        ('{"Type": "MMVII_Serialization", "Data": {"a": [1e999]}}', "not a finite number"),
        (f'{{"Type": "MMVII_Serialization", "Data": {{"a": {"9" * 400}}}}}', "not a finite number"),
        (ROOT.format("<b><c>1</c><c>2</c><d>3</d></b>"), "stands twice"),
        (ROOT.format("<a>" * 80 + "1" + "</a>" * 80), "nested deeper"),
    ],
)
def test_broken_and_hostile_files_are_refused(tmp_path, text, reason):
    path = tmp_path / "f.xml"
    path.write_text(text)
    with pytest.raises(InputError, match=reason):
        read_tree(path)


@pytest.mark.parametrize("encoding", ["utf-16", "latin-1", "koi8-r", "cp1252"])
def test_entities_are_refused_in_whatever_encoding(tmp_path, encoding):
    (tmp_path / "f.xml").write_bytes(BOMB.replace("?>", f' encoding="{encoding}"?>', 1).encode(encoding))
    with pytest.raises(InputError, match="refused: XML with entities"):
        read_tree(tmp_path / "f.xml")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("<F>", "<G>", "broken"),
        ('"Calib_A"', '"Calib_B"', "must be called as its file"),
        ("<NbPix>2000 1333</NbPix>", "<NbPix>2000</NbPix>", "NbPix should be 2 numbers"),
        ("<K1>", "<K9>", "broken"),
        ('"Stenope"', '"Round"', "Round"),
    ],
)
def test_wrong_calibrations_are_refused(tmp_path, old, new, reason):
    path = tmp_path / "Calib_A.xml"
    path.write_text(calibration_text(CAMERA).replace(old, new, 1))
    with pytest.raises(Exception, match=reason):
        read_calibration(path).project([[0.0, 0.0, 1.0]])


def test_a_pose_that_is_no_rotation_is_refused(tmp_path):
    text = pose_text("i", "", RigidMotion(np.zeros(3), np.eye(3))).replace("<AxeI>1.0", "<AxeI>1.1")
    (tmp_path / "Ori-PerspCentral-i.xml").write_text(text)
    with pytest.raises(InputError, match="no rotation"):
        read_orientation(tmp_path)


def test_a_missing_calibration_and_a_missing_pose_are_named(tmp_path):
    poses = Poses.of(["i"], np.zeros((1, 3)), np.eye(3)[None], cameras="Calib_A")
    write_orientation(tmp_path, poses, {})
    with pytest.raises(InputError, match=r"image i needs the calibration Calib_A\.xml"):
        read_orientation(tmp_path)
    with pytest.raises(InputError, match="no pose of the image j"):
        read_orientation(tmp_path, ["j"])


PAIRS = np.array([[1.5, 2.5, 3.25, 4.0], [5.0, 6.0, 7.0, 8.125]])


def binary(pairs):
    head = struct.pack("<ii", 2, len(pairs))
    return head + b"".join(struct.pack("<i5d", 2, 1.0, *row) for row in pairs)


def test_pairs_are_read_in_every_form(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b.csv").write_text(pairs_text(PAIRS))
    (tmp_path / "Pastisc").mkdir()
    (tmp_path / "Pastisc" / "d.dat").write_bytes(binary(PAIRS))
    (tmp_path / "Pastise").mkdir()
    (tmp_path / "Pastise" / "f.txt").write_text("1.5 2.5 3.25 4 0.5\n5 6 7 8.125\n")
    for first, second in (("a", "b"), ("c", "d"), ("e", "f")):
        np.testing.assert_array_equal(find_pairs(tmp_path, first, second), PAIRS)
        np.testing.assert_array_equal(find_pairs(tmp_path, second, first), PAIRS[:, [2, 3, 0, 1]])
    with pytest.raises(InputError, match="no tie points of a and z"):
        find_pairs(tmp_path, "a", "z")


def test_corrupted_binary_pairs_are_refused(tmp_path):
    path, whole = tmp_path / "p.dat", binary(PAIRS)
    wrong = bytearray(whole)
    wrong[8] = 3
    for data, reason in (
        (whole[:-3], "corrupted"),
        (whole[:6] + b"\0", "cut short|not a file|corrupted"),
        (bytes(wrong), "pair 1 is not of two finite points"),
        (b"\0" + whole, "not a file of tie points|corrupted"),
        (binary(PAIRS * np.nan), "pair 1"),
    ):
        path.write_bytes(data)
        with pytest.raises(InputError, match=reason):
            read_pairs(path)


def test_every_cut_of_a_binary_file_is_refused(tmp_path):
    path, whole = tmp_path / "p.dat", binary(PAIRS)
    for length in itertools.chain(range(1, 40), range(len(whole) - 8, len(whole))):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError):
            read_pairs(path)


def test_wrong_text_pairs_are_refused_by_line(tmp_path):
    path = tmp_path / "p.txt"
    path.write_text("1 2 3 4\n# comment\n1 2 3\n")
    with pytest.raises(InputError, match=r"p\.txt:3: needs 4 finite numbers"):
        read_pairs(path)


def test_binary_ties_are_refused_by_name(tmp_path):
    (tmp_path / "PMUL-a.jpg.csv").write_text("Pt.x,Pt.y,Id\n1,2,10\n")
    (tmp_path / "PMUL-a.jpg.dmp").write_bytes(b"\0")
    assert read_tracks(tmp_path).image_names == ("a.jpg",)
    (tmp_path / "PMUL-b.jpg.dmp").write_bytes(b"\0")
    with pytest.raises(InputError, match=r"PMUL-b\.jpg\.dmp: MMVII's binary tie points"):
        read_tracks(tmp_path)
    (tmp_path / "a").mkdir()
    (tmp_path / "a/b.dmp").write_bytes(b"\0")
    with pytest.raises(InputError, match=r"b\.dmp: MMVII's binary tie points"):
        find_pairs(tmp_path, "b", "a")


def test_tracks_are_read(tmp_path):
    (tmp_path / "PMUL-a.jpg.csv").write_text("Pt.x,Pt.y,Id\n1,2,10\n3,4,11\n")
    (tmp_path / "PMUL-b.jpg.csv").write_text("Pt.x,Pt.y,Id\n5,6,11\n")
    found = read_tracks(tmp_path)
    assert (found.image_names, found.point_names) == (("a.jpg", "b.jpg"), ("10", "11"))
    np.testing.assert_array_equal(found.xy, [[1, 2], [3, 4], [5, 6]])


V1 = """<ExportAPERO><OrientationConique>
<FileInterne>Ori-X/AutoCal.xml</FileInterne><TypeProj>eProjStenope</TypeProj>
<Externe><Centre>1 2 3</Centre><ParamRotation><CodageMatr><L1>0 -1 0</L1><L2>1 0 0</L2><L3>0 0 1</L3>
</CodageMatr></ParamRotation></Externe><ConvOri><KnownConv>eConvApero_DistM2C</KnownConv></ConvOri>
</OrientationConique></ExportAPERO>"""
V1_CAMERA = """<ExportAPERO><CalibrationInternConique><KnownConv>eConvApero_DistM2C</KnownConv>
<PP>1000 800</PP><F>2000</F><SzIm>2000 1600</SzIm><CalibDistortion><ModPhgrStd><RadialePart>
<CDist>1000 800</CDist><CoeffDist>1e-8</CoeffDist><CoeffDist>-2e-15</CoeffDist></RadialePart>
<P1>1e-7</P1><P2>-3e-7</P2><b1>1e-4</b1><b2>2e-4</b2></ModPhgrStd></CalibDistortion>
</CalibrationInternConique></ExportAPERO>"""


def test_orientations_of_micmac_v1(tmp_path):
    from obseq.project import read_v1_orientation

    (tmp_path / "Ori-X").mkdir()
    (tmp_path / "Ori-X" / "AutoCal.xml").write_text(V1_CAMERA)
    path = tmp_path / "Ori-X" / "Orientation-i.jpg.xml"
    path.write_text(V1)
    pose, camera = read_v1_orientation(path)
    np.testing.assert_array_equal(pose.to_local([1.0, 3.0, 5.0]), [1.0, 0.0, 2.0])
    plane = np.array([0.25, -0.1])
    d = 2000.0 * plane
    r2 = float(d @ d)
    radial = 1e-8 * r2 - 2e-15 * r2**2
    x = (
        1000
        + d[0] * (1 + radial)
        + 1e-7 * (2 * d[0] ** 2 + r2)
        - 6e-7 * d[0] * d[1]
        + 1e-4 * d[0]
        + 2e-4 * d[1]
    )
    y = 800 + d[1] * (1 + radial) - 3e-7 * (2 * d[1] ** 2 + r2) + 2e-7 * d[0] * d[1]
    np.testing.assert_allclose(camera.project([[*plane, 1.0]])[0], [x, y], rtol=0.0, atol=1e-9)
    path.write_text(V1.replace("eConvApero_DistM2C", "eConvApero_DistC2M"))
    with pytest.raises(InputError, match="eConvApero_DistC2M"):
        read_v1_orientation(path)


def test_numbers_keep_all_their_digits(tmp_path):
    value = 1 / 3
    tree = json.loads(tree_text("A", {"x": (value,)}, as_json=True))
    assert tree["Data"]["A"]["x"] == value
    assert repr(value) in tree_text("A", {"x": (value,)})


def test_a_wrong_line_of_pairs_is_told_by_its_number(tmp_path):
    for head, line in (("", 2), (pairs_text(PAIRS[:0]), 3)):
        (tmp_path / "p.csv").write_text(f"{head}1,2,3,4\n1,2,x,4\n")
        with pytest.raises(InputError, match=rf"p\.csv:{line}: "):
            read_pairs(tmp_path / "p.csv")
