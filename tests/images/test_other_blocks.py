"""Blocks of other programs: what they say is what we say; what has no place here is refused by its line."""

import json
import struct
import zipfile

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.geometry import attitudes
from obseq.images import ControlPoints, Poses
from obseq.images.files.aicon import read_aicon
from obseq.images.files.colmap import read_colmap, write_colmap
from obseq.images.files.dbat import read_dbat
from obseq.images.files.metashape import read_metashape
from obseq.images.files.opk import check_convention, opk_text, read_opk
from obseq.images.files.photomodeler import read_photomodeler

NAMES = [f"P{k}" for k in range(30)]


def _local(block, image, xyz):
    return block.poses[image].to_local(np.atleast_2d(xyz))


def _projected(block, image, xyz):
    return block.cameras[block.camera_of[image]].project(_local(block, image, xyz))


# COLMAP


def _binary_colmap(folder, block, solution, model=(4, [1800.0, 1800.0, 1000, 750, -0.08, 0.02, 0.0, 1e-3])):
    """A model as COLMAP writes it, by its own description."""
    back, found = solution.poses.motions.inverse(), solution.residuals
    cameras = struct.pack("<QIiQQ", 1, 7, model[0], 2000, 1500) + struct.pack(f"<{len(model[1])}d", *model[1])
    images = struct.pack("<Q", len(solution.poses))
    for k, name in enumerate(solution.poses.images):
        rows = np.flatnonzero(found.image == k)
        pose = [*attitudes(back.rotation[k], "quaternion"), *back.centre[k]]
        images += struct.pack("<I7dI", 100 + k, *pose, 7) + name.encode() + b"\0"
        images += struct.pack("<Q", len(rows) + 1) + struct.pack("<ddQ", 1.0, 2.0, 2**64 - 1)
        for row in rows:
            images += struct.pack("<ddQ", *found.xy[row], 2**40 + int(found.point[row]))
    points = struct.pack("<Q", len(solution.points))
    for k, xyz in enumerate(solution.coordinates):
        points += struct.pack("<Q3d3Bd", 2**40 + k, *xyz, 1, 2, 3, 0.5) + struct.pack("<QII", 1, 100, 1)
    for name, data in (("cameras", cameras), ("images", images), ("points3D", points)):
        (folder / f"{name}.bin").write_bytes(data)


@pytest.fixture(scope="module")
def solved():
    block, _, _ = scenes.block()
    block.freeze_parameters("K3|b.")
    return block, block.solve()


def test_binary_models_say_what_text_says_and_win(solved, tmp_path):
    block, solution = solved
    write_colmap(solution, tmp_path)
    text = read_colmap(tmp_path)
    camera = solution.cameras["c"]
    values = dict(zip(camera.parameter_names, camera.parameters.tolist(), strict=True))
    parameters = [values[key] for key in ("F", "F", "PPx", "PPy", "K1", "K2", "p2", "p1")]
    _binary_colmap(tmp_path, block, solution, (4, parameters))
    binary = read_colmap(tmp_path)
    assert next(iter(binary.cameras)) == "camera 7"
    np.testing.assert_array_equal(binary.cameras["camera 7"].parameters, text.cameras["camera 1"].parameters)
    np.testing.assert_allclose(binary.poses.rotations, text.poses.rotations, atol=1e-15)
    np.testing.assert_allclose(binary.poses.centres, text.poses.centres, atol=1e-13)
    np.testing.assert_array_equal(binary.sets[0].measures.xy, text.sets[0].measures.xy)
    assert set(binary.approximations) == {str(2**40 + k) for k in range(len(solution.points))}


def _opencv(values, plane):
    """OpenCV's formula, as its documentation has it."""
    fx, fy, cx, cy, k1, k2, p1, p2, *more = values
    k3, k4, k5, k6 = more or (0.0, 0.0, 0.0, 0.0)
    x, y = plane.T
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.column_stack([fx * u + cx, fy * v + cy])


@pytest.mark.parametrize(
    ("number", "values", "tolerance"),
    [
        (4, [1800.0, 1800.0, 990.0, 760.0, -0.1, 0.03, 1e-3, -2e-3], 1e-9),
        (4, [1802.0, 1800.0, 990.0, 760.0, -0.1, 0.03, 1e-3, -2e-3], 0.01),
        (1, [1850.0, 1800.0, 990.0, 760.0], 1e-9),
        (6, [1800.0, 1800.0, 990, 760, -0.1, 0.03, 1e-3, 1e-3, 0.01, 0.02, 1e-3, 1e-4], 0.01),
    ],
)
def test_cameras_of_opencv_project_as_opencv_says(solved, tmp_path, number, values, tolerance):
    _binary_colmap(tmp_path, *solved, (number, values))
    camera = read_colmap(tmp_path).cameras["camera 7"]
    plane = np.random.default_rng(0).uniform(-0.4, 0.4, (50, 2)) * [1.2, 0.9]
    given = [*values, 0, 0, 0, 0] if number == 1 else values
    found = camera.project(np.column_stack([plane, np.ones(50)]))
    np.testing.assert_allclose(found, _opencv(given, plane), atol=tolerance)


def test_fish_eyes_of_opencv(solved, tmp_path):
    values = [900.0, 900.0, 990.0, 760.0, 0.02, -0.005, 1e-3, -1e-4]
    _binary_colmap(tmp_path, *solved, (5, values))
    rays = np.array([[0.5, -0.4, 1.0], [1.5, 1.0, 0.6]])
    angle = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    bent = angle * (1 + 0.02 * angle**2 - 0.005 * angle**4 + 1e-3 * angle**6 - 1e-4 * angle**8)
    unit = rays[:, :2] / np.hypot(rays[:, 0], rays[:, 1])[:, None]
    found = read_colmap(tmp_path).cameras["camera 7"].project(rays)
    np.testing.assert_allclose(found, 900.0 * bent[:, None] * unit + [990.0, 760.0], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("cameras", lambda data: data[:-3], r"cameras\.bin: is cut short"),
        ("images", lambda data: data[:200], r"images\.bin: is cut short|has no end"),
        ("points3D", lambda data: data + b"x", r"points3D\.bin: 1 bytes are left over"),
        ("cameras", lambda data: data[:12] + struct.pack("<i", 7) + data[16:], "left over|not one of ours"),
        ("cameras", lambda data: data[:12] + struct.pack("<i", 99) + data[16:], "unknown model, 99"),
        ("images", lambda data: b"\xff" * 8 + data[8:], r"images\.bin"),
    ],
)
def test_broken_binary_models_are_refused(solved, tmp_path, name, change, message):
    _binary_colmap(tmp_path, *solved)
    path = tmp_path / f"{name}.bin"
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=message):
        read_colmap(tmp_path)


# Metashape

METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document version="2.1.0">
  <chunk label="one" enabled="true">
    <sensors next_id="1">
      <sensor id="0" label="X100" type="frame">
        <resolution width="2000" height="1500"/>
        <calibration type="frame" class="initial"><f>1000</f></calibration>
        <calibration type="frame" class="adjusted">
          <resolution width="2000" height="1500"/>
          <f>1800</f><cx>-10</cx><cy>5</cy><k1>-0.1</k1><k2>0.03</k2><p1>0.001</p1><p2>-0.0005</p2>{b}
        </calibration>
      </sensor>
    </sensors>
    <cameras>
      <camera id="3" sensor_id="0" label="a.jpg">
        <transform>1 0 0 0 0 1 0 0 0 0 1 -10 0 0 0 1</transform></camera>
      <group id="0" label="g"><camera id="5" sensor_id="0" label="b.jpg">
        <transform>1 0 0 2 0 1 0 0 0 0 1 -10 0 0 0 1</transform></camera></group>
      <camera id="6" sensor_id="0" label="lost.jpg"/>
    </cameras>
    <markers>
      <marker id="0" label="M1">
        <reference x="101" y="202" z="303" sx="0.01" sy="0.01" sz="0.02" enabled="true"/></marker>
      <marker id="1" label="M2"><reference x="1" y="2" z="3" enabled="false"/></marker>
    </markers>
    <scalebars><scalebar id="0" label="s" marker_1_id="0" marker_2_id="1">
      <reference distance="1.5" accuracy="0.001" enabled="true"/></scalebar></scalebars>
    <frames><frame id="0"><markers>
      <marker marker_id="0"><location camera_id="3" pinned="true" x="1000" y="700"/>
        <location camera_id="5" pinned="false" x="1" y="1"/></marker>
      <marker marker_id="1"><location camera_id="5" pinned="true" x="900" y="600"/></marker>
    </markers></frame></frames>
    <transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>100 200 300</translation>
      <scale>2</scale></transform>
    <reference>{reference}</reference>
    <settings><property name="accuracy_projections" value="0.5"/></settings>
  </chunk>
</document>
"""
LOCAL = "LOCAL_CS[&quot;Local Coordinates (m)&quot;]"


def _metashape(tmp_path, text=METASHAPE, b="", reference=LOCAL):
    path = tmp_path / "block.xml"
    path.write_text(text.replace("{b}", b).replace("{reference}", reference))
    return path


def test_a_chunk_of_metashape_is_a_block(tmp_path):
    block, frame = read_metashape(_metashape(tmp_path))
    assert frame == "LocalNONE"
    assert block.poses.images == ("a.jpg", "b.jpg")
    assert set(block.camera_of) == {"a.jpg", "b.jpg", "lost.jpg"}
    # 2 R (0, 0, -10) + T
    np.testing.assert_allclose(block.poses["a.jpg"].centre, [100, 200, 280])
    np.testing.assert_allclose(block.poses["b.jpg"].centre, [100, 204, 280])
    np.testing.assert_allclose(block.poses["a.jpg"].rotation[:, 0], [0, 1, 0])
    assert block.control.names == ("M1",)
    assert block.control.sigmas[0].tolist() == [0.01, 0.01, 0.02]
    (part,) = block.sets
    assert part.measures.xy.tolist() == [[1000, 700], [900, 600]]
    assert part.measures.sigmas[0].tolist() == [0.5, 0.5]
    assert block.lengths.values == (1.5,)


def _agisoft(x, y, b1, b2):
    """The formula of Metashape's manual, with the parameters of the file."""
    r2 = x**2 + y**2
    radial = 1 - 0.1 * r2 + 0.03 * r2**2
    u = x * radial + 0.001 * (r2 + 2 * x**2) + 2 * -0.0005 * x * y
    v = y * radial + -0.0005 * (r2 + 2 * y**2) + 2 * 0.001 * x * y
    return [1000 - 10 + u * 1800 + u * b1 + v * b2, 750 + 5 + v * 1800]


@pytest.mark.parametrize(
    ("b", "b1", "b2", "tolerance"), [("", 0, 0, 1e-9), ("<b1>0.8</b1><b2>-0.4</b2>", 0.8, -0.4, 0.01)]
)
def test_its_camera_projects_as_its_manual_says(tmp_path, b, b1, b2, tolerance):
    block, _ = read_metashape(_metashape(tmp_path, b=b))
    (camera,) = block.cameras.values()
    for x, y in ((0.1, 0.2), (-0.5, 0.35), (0.4, -0.3)):
        np.testing.assert_allclose(camera.project([[x, y, 1.0]])[0], _agisoft(x, y, b1, b2), atol=tolerance)


def test_a_chunk_on_the_earth_becomes_a_local_frame(tmp_path):
    text = METASHAPE.replace('x="101" y="202" z="303"', 'x="2.4" y="48.8" z="100"')
    wgs84 = "EPSG:4979"
    # the identity: the chunk is geocentric
    start = text.index("<transform><rotation>")
    text = text[:start] + "<transform></transform>" + text[text.index("</transform>", start) + 12 :]
    block, frame = read_metashape(_metashape(tmp_path, text, reference=wgs84))
    assert frame.startswith("RTL*")
    np.testing.assert_allclose(block.control.coordinates[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(block.control.sigmas[0], [0.01, 0.01, 0.02], rtol=1e-9)
    # the cameras are near the middle of the Earth: as far below as its radius there
    assert block.poses["a.jpg"].centre[2] == pytest.approx(-6366e3, abs=5e3)


def test_a_project_of_metashape_holds_its_chunks_beside(tmp_path):
    whole = METASHAPE.replace("{b}", "").replace("{reference}", LOCAL)
    chunk = whole[whole.index("<chunk") : whole.index("</document>")]
    folder = tmp_path / "p.files/0"
    folder.mkdir(parents=True)
    with zipfile.ZipFile(folder / "chunk.zip", "w") as archive:
        archive.writestr("doc.xml", chunk)
    with zipfile.ZipFile(tmp_path / "p.files/project.zip", "w") as archive:
        archive.writestr(
            "doc.xml", '<document><chunks next_id="1"><chunk id="0" path="0/chunk.zip"/></chunks></document>'
        )
    (tmp_path / "p.psx").write_text('<document version="1.2.0" path="{projectname}.files/project.zip"/>')
    block, _ = read_metashape(tmp_path / "p.psx")
    assert block.poses.images == ("a.jpg", "b.jpg")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'type="frame">\n        <res',
            'type="fisheye">\n        <res',
            r"block\.xml:5: <sensor>: a camera of type fisheye",
        ),
        ("<p1>", "<p3>0.1</p3><p1>", r"block\.xml:10: <p3>: the parameter p3 has no place"),
        ("</document>", '<chunk label="two"/></document>', "there are 2 chunks: choose one of one, two"),
        ("<f>1800</f>", "<f>many</f>", r"block\.xml:10: <f>: 1 finite numbers are expected"),
        ('camera_id="3"', 'camera_id="9"', "the camera '9' is not in the list"),
        (
            '<property name="accuracy_projections" value="0.5"/>',
            "",
            "the accuracy of image measures is not said",
        ),
        ('<?xml version="1.0" encoding="UTF-8"?>', '<!DOCTYPE a [<!ENTITY b "c">]>', "entities"),
        ("</chunk>", "", "the XML is broken"),
        ("1 0 0 0 0 1 0 0 0 0 1 -10", "1 0 0 0 0 1 0 0 0 0 1 x", "16 finite numbers are expected"),
        ("0 -1 0 1 0 0 0 0 1", "0 -1 0 1 0 0 0 0 2", "no similarity"),
    ],
)
def test_what_metashape_has_and_we_have_not_is_refused_by_its_line(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        read_metashape(_metashape(tmp_path, METASHAPE.replace(old, new)))


# Omega, phi, kappa


def test_poses_as_text_come_back(tmp_path):
    poses, _ = scenes.ring(origin=(6e5, 6.8e6, 100.0))
    (tmp_path / "p.txt").write_text(opk_text(poses))
    again = read_opk(tmp_path / "p.txt", camera="c")
    assert (again.images, again.cameras) == (poses.images, poses.cameras)
    np.testing.assert_array_equal(again.centres, poses.centres)
    np.testing.assert_allclose(again.rotations, poses.rotations, atol=1e-14)


def test_columns_and_units_are_as_told(tmp_path):
    (tmp_path / "p.txt").write_text("x;a;1;2;3;30;20;10;more\n")
    (tmp_path / "q.txt").write_text("1 2 3 9 11.111111111111111 22.222222222222222 33.333333333333333 a\n")
    first = read_opk(tmp_path / "p.txt", "? N X Y Z K P O")
    second = read_opk(tmp_path / "q.txt", "XYZ?OPKN", "gon")
    np.testing.assert_allclose(first.attitudes("opk"), np.radians([[10, 20, 30]]), atol=1e-14)
    np.testing.assert_allclose(second.rotations, first.rotations, atol=1e-14)


@pytest.mark.parametrize("transposed", [False, True])
def test_a_convention_that_does_not_fit_is_refused_and_the_right_one_named(tmp_path, transposed):
    poses, points = scenes.ring()
    matrices = poses.rotations * [1, -1, -1]
    matrices = np.swapaxes(matrices, 1, 2) if transposed else matrices
    lines = [
        f"{name} {' '.join(map(str, [*c, *m.ravel()]))}"
        for name, c, m in zip(poses.images, poses.centres, matrices, strict=True)
    ]
    (tmp_path / "p.txt").write_text("\n".join(lines))
    measures = scenes.measured(poses, points, NAMES, 0.5)
    control = ControlPoints.of(NAMES, points)
    cameras = dict.fromkeys(poses.images, scenes.CAMERA)
    right = read_opk(tmp_path / "p.txt", "NXYZM", world_to_camera=transposed)
    np.testing.assert_allclose(right.rotations, poses.rotations, atol=1e-12)
    check_convention(right, measures, control, cameras)
    wrong = read_opk(tmp_path / "p.txt", "NXYZM", world_to_camera=not transposed)
    with pytest.raises(InputError, match="fit when read with the transposed matrix"):
        check_convention(wrong, measures, control, cameras)


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        ("a 1 2 3\n", "NXYZOPK", r"p\.txt:1: 4 fields where NXYZOPK are 7"),
        ("a 1 2 3 x 0 0\n", "NXYZOPK", r"p\.txt:1: 'x' is no finite number"),
        ("# only\n", "NXYZOPK", "holds no pose"),
        ("a 1 2 3 0 0 0\n", "NXYZOP", "needed once each"),
        ("a 1 2 3 0 0 0\n", "NXYZQ", "Q is none of"),
        ("a 1 2 3 0 0 0\na 1 2 3 0 0 0\n", "NXYZOPK", r"p\.txt: .*'a' is given twice"),
        ("a 0 0 0 2 0 0 0 1 0 0 0 1\n", "NXYZM", r"p\.txt: .*rotation"),
    ],
)
def test_texts_that_hold_no_poses_are_refused(tmp_path, text, columns, message):
    (tmp_path / "p.txt").write_text(text)
    with pytest.raises(InputError, match=message):
        read_opk(tmp_path / "p.txt", columns)


# DBAT and PhotoModeler


def test_the_calibration_of_dbat_from_its_own_script(shared_data):
    expected = json.loads((shared_data / "dbat-camcal/expected.json").read_text())["dbat"]
    block = read_dbat(shared_data / "dbat-camcal/camcaldemo.xml")
    assert "P8250021.JPG" in block.camera_of
    block.initialise()
    solution = block.solve()
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)


def test_the_aerial_block_of_dbat_from_its_own_script(shared_data):
    expected = json.loads((shared_data / "dbat-sxb/expected.json").read_text())["dbat"]
    block = read_dbat(shared_data / "dbat-sxb/sxb.xml")
    assert not {"351", "410"} & set(block.control.names)
    block.initialise()
    solution = block.solve()
    assert solution.result.redundancy == expected["redundancy"]
    assert solution.sigma0 == pytest.approx(expected["sigma0"], abs=5e-5)


def _dbat(tmp_path, change=lambda text: text, points="1, 2, 3, 4\n"):
    text = """<document><input base_dir="$HERE">
<ctrl_pts><file format="id,x,y,z" sxyz="0.5">c.txt</file></ctrl_pts>
<images><file format="id,path">i.txt</file></images>
<image_pts><file format="im,id,x,y" sxy="0.1">m.txt</file></image_pts>
<cameras><camera><name>X</name><unit>mm</unit><sensor>auto,15</sensor><image>2000,1500</image>
<aspect>1</aspect><focal>18</focal><model>3</model><nK>3</nK><nP>2</nP></camera></cameras>
</input></document>"""
    (tmp_path / "s.xml").write_text(change(text))
    (tmp_path / "c.txt").write_text("1, 1, 2, 3\n")
    (tmp_path / "i.txt").write_text("1, a/x.jpg # first\n2, b/x.jpg\n")
    (tmp_path / "m.txt").write_text(points)
    return tmp_path / "s.xml"


def test_sigmas_may_be_attributes_and_files_may_be_called_alike(tmp_path):
    block = read_dbat(_dbat(tmp_path))
    assert list(block.camera_of) == ["1", "2"]
    assert block.control.sigmas.tolist() == [[0.5, 0.5, 0.5]]
    assert block.sets[0].measures.sigmas.tolist() == [[0.1, 0.1]]
    (camera,) = block.cameras.values()
    assert camera.focal == pytest.approx(1800.0)
    assert camera.backward


@pytest.mark.parametrize(
    ("change", "points", "message"),
    [
        (
            lambda text: text.replace("<model>3", "<model>-1"),
            "1,2,3,4",
            r"s\.xml:\d+: <camera>: camera model -1",
        ),
        (lambda text: text.replace(' sxy="0.1"', ""), "1,2,3,4", "the measures have no sigma"),
        (lambda text: text, "1,2,3", r"m\.txt:1: 3 fields where im,id,x,y are expected"),
        (lambda text: text, "1,2,3,x", r"m\.txt:1: y is 'x', which is no number"),
        (lambda text: text, "7,2,3,4", "the image 7 is not in the list"),
        (lambda text: text.replace("$HERE", "$DBAT"), "", r"only \$HERE is known"),
        (lambda text: text.replace("<sensor>auto", "<sensor>40"), "1,2,3,4", "2 times as wide as high"),
        (lambda text: text.replace("c.txt", "none.txt"), "1,2,3,4", "none.txt"),
        (lambda text: "<a/>", "", "no script of DBAT"),
    ],
)
def test_scripts_that_cannot_be_read_are_refused_by_their_line(tmp_path, change, points, message):
    with pytest.raises(InputError, match=message):
        read_dbat(_dbat(tmp_path, change, points))


def test_an_export_of_photomodeler(tmp_path):
    interior = "18 10 7.5 20 15 0.0001 0 0 0 0"
    photo = (
        "{k} C:\\p\\{name}.jpg\n{k} 0 10 90 0 0\n1 1 1 1 1 1\n0 0 0 0\n"
        + interior
        + "\n0 0 0 0 0 0 0 0 0 0\n0\n"
    )
    photos = photo.format(k=0, name="a") + photo.format(k=1, name="b")
    head = f"title\n1e-4 20 2000 1500\n0.1 0.1\n{interior}\n0 0 0 0 0 0 0 0 0 0\n"
    text = (
        head
        + photos
        + "\n1 0 0 0 0.1 0.1 0.2\n2 1 0 0 0 0 0\n\n7 3 4 5\n"
        + "\n0 1 1000 750 0.001 0.002\n1 7 900 700 0.001 0.001\n"
    )
    (tmp_path / "p.txt").write_text(text)
    block = read_photomodeler(tmp_path / "p.txt")
    assert block.poses.images == ("a.jpg", "b.jpg")
    np.testing.assert_allclose(block.poses.attitudes("opk")[0], [0, 0, np.pi / 2], atol=1e-15)
    (camera,) = block.cameras.values()
    assert camera.focal == pytest.approx(1800.0)
    assert camera.principal_point.tolist() == [1000.0, 750.0]
    assert dict(zip(camera.coefficient_names, camera.coefficients, strict=True))["K1"] == pytest.approx(
        0.0001 * 324
    )
    assert block.control.names == ("1", "2")
    np.testing.assert_allclose(block.sets[0].measures.sigmas, [[0.1, 0.2], [0.1, 0.1]])
    (tmp_path / "p.txt").write_text(text.replace("1 7 900", "9 7 900"))
    with pytest.raises(InputError, match=r"p\.txt:\d+: the photo 9 is not there"):
        read_photomodeler(tmp_path / "p.txt")


# AICON


def _aicon(folder, a1=-2e-4, r0=8.0, c1=1e-4, order=0):
    """A camera of 18 mm, pixels of a hundredth of a millimetre; what is measured follows AICON's formula."""
    poses, points = scenes.ring(n_images=4)
    poses = Poses(poses.images, poses.centres * 1000, poses.rotations, poses.cameras)
    points = points * 1000.0
    measures, wanted = [], {}
    for name in poses.images:
        x, y, z = (poses[name].to_local(points) * [1, -1, -1]).T
        xs, ys = -18 * x / z, -18 * y / z
        square = xs**2 + ys**2
        radial = a1 * (square - r0**2)
        u = 0.05 + xs * (1 + radial) + 1e-5 * (square + 2 * xs**2) + c1 * xs
        v = -0.02 + ys * (1 + radial) + 2e-5 * xs * ys
        wanted[name] = np.column_stack([1000 + 100 * u, 750 - 100 * v])
        measures += [f"{name} {p} {a} {b} 1 1 0 0 0 1 0" for p, a, b in zip(NAMES, u, v, strict=True)]
    angles = poses.attitudes("opk")
    (folder / "b.phc").write_text("\n".join([*measures, "i0 off 0 0 1 1 0 0 0 0 0"]))
    (folder / "b.ior").write_text(f"5 0 -18 0.05 -0.02 {a1} 0 {r0}\n0\n1e-5 0\n{c1} 0\n20 15 2000 1500\n")
    rows = [
        f"{name} 5 {' '.join(map(str, [*c, *t]))} {order} 1 3"
        for name, c, t in zip(poses.images, poses.centres, angles, strict=True)
    ]
    (folder / "b.eor").write_text("# images\n" + "\n".join(rows))
    rows = [
        f"{p} {x} {y} {z} 0 0 0 4 1 0 {int(k < 5)}"
        for k, (p, (x, y, z)) in enumerate(zip(NAMES, points, strict=True))
    ]
    (folder / "b.obc").write_text("\n".join(rows))
    (folder / "b.scl").write_text('1 "bar" P0 P1 1234.5 0.01 1\n2 "off" P2 P3 1 0.01 0\n')
    return points, wanted


def test_a_block_of_aicon_projects_where_its_formula_says(tmp_path):
    points, wanted = _aicon(tmp_path)
    block, datum = read_aicon(tmp_path, image_sigma=0.05)
    assert datum == ("P0", "P1", "P2", "P3", "P4")
    assert block.lengths.values == (1234.5,)
    for image, pixels in wanted.items():
        np.testing.assert_allclose(_projected(block, image, points), pixels, atol=1e-6)
    (part,) = block.sets
    assert "off" not in part.measures.point_names
    np.testing.assert_allclose(part.measures.xy[:30], wanted["i0"], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("b.eor", " 0 1 3", " 1 1 3", r"b\.eor:2: the order of rotations 1"),
        ("b.eor", "i0 5", "i0 6", r"b\.eor:2: the camera 6 is not"),
        ("b.ior", "-18", "18", r"b\.ior:1: the camera constant is negative"),
        ("b.ior", "20 15", "20 x", r"b\.ior:5: field 2 should be a number"),
        ("b.obc", "P0 ", "", r"b\.obc:1"),
    ],
)
def test_files_of_aicon_are_refused_by_their_line(tmp_path, name, old, new, message):
    _aicon(tmp_path)
    path = tmp_path / name
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        read_aicon(tmp_path, 0.05)
    path.unlink()
    with pytest.raises(InputError, match="0 files end in"):
        read_aicon(tmp_path, 0.05)


def test_a_camera_that_ours_does_not_reach_is_refused(solved, tmp_path):
    far = [1800.0, 1800.0, 990.0, 760.0, 0, 0, 0, 0, 0, 60.0, 0, 0]
    _binary_colmap(tmp_path, *solved, (6, far))
    with pytest.raises(InputError, match="its distortion differs from ours by"):
        read_colmap(tmp_path)
