"""Chunks of Metashape: what they say is what we say; what has no place here is refused by its line."""

import struct
import zipfile

import numpy as np
import pytest

from obseq.errors import InputError
from obseq.formats.blocks.observations import Carried, carry_antennas
from obseq.formats.metashape.reader import read_metashape

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


OLD = """<calibration type="frame" class="initial"><fx>{fx}</fx><fy>20656.5</fy><cx>995</cx><cy>760</cy>
          <k1>-0.1</k1>{more}</calibration>"""


@pytest.mark.parametrize(("fx", "tolerance"), [("20656.5", 1e-9), ("20660", 0.01)])
def test_calibrations_of_photoscan_have_two_focal_lengths_and_a_corner(tmp_path, fx, tolerance):
    start, end = METASHAPE.index('<calibration type="frame" class="initial">'), METASHAPE.index("</sensor>")
    text = METASHAPE[:start] + OLD.format(fx=fx, more="") + METASHAPE[end:]
    (camera,) = read_metashape(_metashape(tmp_path, text))[0].cameras.values()
    x, y = 0.03, -0.02
    radial = 1.0 - 0.1 * (x**2 + y**2)
    expected = [995.0 + float(fx) * x * radial, 760.0 + 20656.5 * y * radial]
    np.testing.assert_allclose(camera.project([[x, y, 1.0]])[0], expected, atol=tolerance)
    text = METASHAPE[:start] + OLD.format(fx=fx, more="<p1>0.001</p1>") + METASHAPE[end:]
    with pytest.raises(InputError, match="p1 and p2 beside fx and fy are ambiguous"):
        read_metashape(_metashape(tmp_path, text))


def test_a_fourth_radial_term_is_kept(tmp_path):
    text = METASHAPE.replace("<k2>0.03</k2>", "<k2>0.03</k2><k4>0.02</k4>")
    (camera,) = read_metashape(_metashape(tmp_path, text))[0].cameras.values()
    assert camera.degree == (4, 1, 1)
    r2 = 0.3**2 + 0.1**2
    moved = camera.project([[0.3, 0.1, 1.0]])[0] - _agisoft(0.3, 0.1, 0, 0)
    np.testing.assert_allclose(moved, 1800 * 0.02 * r2**4 * np.array([0.3, 0.1]), atol=1e-9)


def test_components_have_their_own_places(tmp_path):
    """As files of version 2 have them, with attributes that say what is locked."""
    start = METASHAPE.index("<transform><rotation>")
    end = METASHAPE.index("</transform>", start) + len("</transform>")
    one = METASHAPE[start:end].replace("<scale>", '<scale locked="true">')
    two = one.replace(">2<", ">4<")
    parts = f'<component id="0">{one}</component><component id="1">{two}</component>'
    parts = f"<components>{parts}</components>"
    text = METASHAPE[:start] + parts + METASHAPE[end:]
    for camera, component in (("5", "1"), ("3", "0")):
        text = text.replace(f'<camera id="{camera}"', f'<camera id="{camera}" component_id="{component}"')
    poses = read_metashape(_metashape(tmp_path, text))[0].poses
    np.testing.assert_allclose(poses["a.jpg"].centre, [100, 200, 280])
    np.testing.assert_allclose(poses["b.jpg"].centre, [100, 208, 260])
    lost = text.replace(one, "").replace(two, "")
    with pytest.raises(InputError, match="components that are not placed"):
        read_metashape(_metashape(tmp_path, lost))


def test_images_that_are_not_enabled_take_no_part_and_equal_labels_get_numbers(tmp_path):
    text = METASHAPE.replace(
        '<camera id="5" sensor_id="0" label="b.jpg">',
        '<camera id="5" sensor_id="0" label="b.jpg" enabled="false">',
    )
    block, _ = read_metashape(_metashape(tmp_path, text))
    assert block.poses.images == ("a.jpg",)
    assert block.sets[0].measures.xy.tolist() == [[1000, 700]]
    assert "1 images are not enabled: b.jpg" in block.notes
    block, _ = read_metashape(_metashape(tmp_path, METASHAPE.replace("b.jpg", "a.jpg")))
    assert block.poses.images == ("a.jpg [3]", "a.jpg [5]")
    assert "1 labels are of several images" in block.notes[0]


def test_an_archive_of_photoscan_holds_its_chunks_inside(tmp_path):
    """One sigma for x and y, chunks in a list, everything in one file."""
    whole = METASHAPE.replace("{b}", "").replace("{reference}", LOCAL)
    whole = whole.replace('sx="0.01" sy="0.01" sz="0.02"', 'sxy="0.01" sz="0.02"')
    whole = whole.replace("<chunk label", "<chunks><chunk label").replace("</chunk>", "</chunk></chunks>")
    with zipfile.ZipFile(tmp_path / "block.psz", "w") as archive:
        archive.writestr("doc.xml", whole)
    block, _ = read_metashape(tmp_path / "block.psz")
    assert block.poses.images == ("a.jpg", "b.jpg")
    assert block.control.sigmas[0].tolist() == [0.01, 0.01, 0.02]


def ply(columns, rows):
    """A binary PLY of vertices."""
    types = {"f": "float", "i": "int", "I": "uint"}
    properties = "".join(f"property {types[kind]} {name}\n" for name, kind in columns)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    return head.encode() + b"".join(struct.pack("<" + "".join(k for _, k in columns), *row) for row in rows)


POINT = (("x", "f"), ("y", "f"), ("z", "f"), ("id", "I"))
MARK = (("x", "f"), ("y", "f"), ("size", "f"), ("id", "i"))
CLOUD = """<point_cloud><tracks path="t.ply"/><points path="o.ply"/>
<projections camera_id="3" path="p3.ply"/><projections camera_id="5" path="p5.ply"/>
<projections camera_id="9" path="p9.ply"/></point_cloud></frame></frames>"""
TIES = {
    "o.ply": ply(POINT, [(0.5, 0.0, 1.0, 7), (1.0, 0.5, 0.0, 4), (2.0, 0.0, 0.0, 11)]),
    "p3.ply": ply(MARK, [(1000.0, 700.0, 2.0, 4), (900.0, 650.0, 1.0, 7), (10.0, 20.0, 1.0, 99)]),
    "p5.ply": ply(MARK, [(700.0, 600.0, 0.5, 7), (800.0, 620.0, 1.0, 4), (300.0, 300.0, 1.0, 11)]),
}


def archived(folder, **changed):
    whole = METASHAPE.replace("{b}", "").replace("{reference}", LOCAL).replace("</frame></frames>", CLOUD)
    ties = '<property name="accuracy_tiepoints" value="0.7"/>'
    whole = whole.replace("<settings>", f"<settings>{ties}")
    whole = whole.replace("<chunk label", "<chunks><chunk label").replace("</chunk>", "</chunk></chunks>")
    with zipfile.ZipFile(folder / "block.psz", "w") as archive:
        archive.writestr("doc.xml", whole)
        for name, data in (TIES | changed).items():
            archive.writestr(name, data)
    return folder / "block.psz"


def test_tie_points_of_an_archive_have_their_places_and_scales(tmp_path):
    """World: 2 R p + (100, 200, 300), R turns x to y; sigmas are the accuracy times the scale."""
    block, _ = read_metashape(archived(tmp_path))
    (measures,) = [one.measures for one in block.sets if one.name == "tie points"]
    found = {
        (measures.image_names[i], measures.point_names[p]): (*xy, sigma)
        for i, p, xy, sigma in zip(
            measures.image, measures.point, measures.xy.tolist(), measures.sigmas[:, 0].tolist(), strict=True
        )
    }
    assert found == {
        ("a.jpg", "tie 4"): pytest.approx((1000.0, 700.0, 1.4)),
        ("a.jpg", "tie 7"): pytest.approx((900.0, 650.0, 0.7)),
        ("b.jpg", "tie 4"): pytest.approx((800.0, 620.0, 0.7)),
        ("b.jpg", "tie 7"): pytest.approx((700.0, 600.0, 0.35)),
    }
    np.testing.assert_allclose(block.approximations["tie 7"], [100.0, 201.0, 302.0], atol=1e-5)
    np.testing.assert_allclose(block.approximations["tie 4"], [99.0, 202.0, 300.0], atol=1e-5)
    assert any("seen in one image, or in none, and are left out: tie 11" in note for note in block.notes)


def test_frames_and_tie_points_of_a_project_have_archives_of_their_own(tmp_path):
    whole = METASHAPE.replace("{b}", "").replace("{reference}", LOCAL)
    chunk = whole[whole.index("<chunk") : whole.index("</document>")]
    start, end = chunk.index("<frame id"), chunk.index("</frames>")
    frame = chunk[start:end].replace("</frame>", '<point_cloud path="pc/pc.zip"/></frame>')
    inner = CLOUD[: CLOUD.index("</frame>")]
    parts = {
        "project.zip": {
            "doc.xml": '<document><chunks><chunk id="0" path="0/chunk.zip"/></chunks></document>'
        },
        "0/chunk.zip": {"doc.xml": chunk[:start] + '<frame id="0" path="0/frame.zip"/>' + chunk[end:]},
        "0/0/frame.zip": {"doc.xml": frame},
        "0/0/pc/pc.zip": {"doc.xml": inner, **TIES},
    }
    for name, members in parts.items():
        (tmp_path / "p.files" / name).parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(tmp_path / "p.files" / name, "w") as archive:
            for inside, data in members.items():
                archive.writestr(inside, data)
    (tmp_path / "p.psx").write_text('<document version="1.2.0" path="{projectname}.files/project.zip"/>')
    block, _ = read_metashape(tmp_path / "p.psx")
    assert sorted(len(one.measures.point) for one in block.sets) == [2, 4]
    assert block.approximations["tie 7"] == pytest.approx([100.0, 201.0, 302.0])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"p3.ply": b"ply\nformat ascii 1.0\n"}, "p3.ply is no binary PLY"),
        ({"p3.ply": TIES["p3.ply"][:-3]}, "p3.ply is cut short"),
        ({"p3.ply": ply(POINT[:3], [(1.0, 2.0, 3.0)])}, "has not the columns x, y, id"),
    ],
)
def test_a_wrong_archive_of_tie_points_is_told(tmp_path, changed, message):
    with pytest.raises(InputError, match=r"block\.psz: .*") as caught:
        read_metashape(archived(tmp_path, **changed))
    assert message in str(caught.value)


def test_positions_of_a_file_may_have_a_lever_arm(tmp_path):
    text = METASHAPE.replace('label="a.jpg">', 'label="a.jpg"><reference x="101" y="202" z="280"/>')
    block, _ = read_metashape(_metashape(tmp_path, text))
    assert block.antennas[0].is_central
    carry_antennas(block, Carried((0.1, 0.0, -0.2), 0.05))
    (antenna,) = block.antennas
    assert antenna.images == ("a.jpg",)
    assert antenna.lever_arm.tolist() == [0.1, 0.0, -0.2]
    assert antenna.lever_sigmas.tolist() == [0.05] * 3
    np.testing.assert_allclose(antenna.centres(np.eye(3)[None]), [[100.9, 202.0, 280.2]])
    assert "have the lever arm 0.1 0 -0.2 (known to 0.05), as asked for" in block.notes[-1]
    bare, _ = read_metashape(_metashape(tmp_path))
    with pytest.raises(InputError, match="the files have none"):
        carry_antennas(bare, Carried((0.1, 0.0, -0.2)))
