"""Calibrated camera parameters of Pix4D."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.pix4d.reader import read_pix4d
from obseq.geometry import RigidMotion
from obseq.images import Camera

HEAD = """fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]
camera model m = K [R|-Rt] X

"""
CAMERA = Camera(
    "c", 2000, 1500, 1800.0, np.array([990.0, 760.0]), (3, 1, 1), [-0.05, 0.04, -0.03, 1e-3, -2e-3, 0, 0]
)


def _text(poses):
    text = HEAD
    for k, image in enumerate(poses.images):
        rows = [*[[1800.0, 0, 990.0], [0, 1800.0, 760.0], [0, 0, 1]], [-0.05, 0.04, -0.03], [-2e-3, 1e-3]]
        rows += [poses.centres[k].tolist(), *poses.rotations[k].T.tolist()]
        text += f"my {image}.jpg 2000 1500\n" + "".join(" ".join(map(repr, row)) + "\n" for row in rows)
    return text


def test_the_model_of_the_file_projects_as_ours(tmp_path):
    poses, points = scenes.ring(n_images=3, n_points=10)
    (tmp_path / "p.txt").write_text(_text(poses))
    (tmp_path / "a_offset.xyz").write_text("1 2 3\n")
    block = read_pix4d(tmp_path / "p.txt")
    assert list(block.cameras) == ["camera 1"]
    assert block.poses.images == ("my i0.jpg", "my i1.jpg", "my i2.jpg")
    assert any("a_offset.xyz" in note for note in block.notes)
    matrix, turn, centre = (
        np.array([[1800.0, 0, 990], [0, 1800, 760], [0, 0, 1]]),
        poses.rotations[1].T,
        poses.centres[1],
    )
    m = (points - centre) @ turn.T
    x, y = (m[:, :2] / m[:, 2:]).T
    r = x * x + y * y
    radial, (t1, t2) = 1 - 0.05 * r + 0.04 * r**2 - 0.03 * r**3, (-2e-3, 1e-3)
    u = x * radial + 2 * t1 * x * y + t2 * (r + 2 * x * x)
    v = y * radial + 2 * t2 * x * y + t1 * (r + 2 * y * y)
    wanted = np.column_stack([u, v]) * 1800.0 + matrix[:2, 2]
    pose = block.poses["my i1.jpg"]
    found = block.cameras["camera 1"].project(RigidMotion(pose.centre, pose.rotation).to_local(points))
    np.testing.assert_allclose(found, wanted, atol=1e-8)
    assert {t for t in CAMERA.parameter_names if block.is_frozen("camera 1", t)} == {"b1", "b2"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("fileName", "file"), "begin with"),
        (("1800.0 0 990.0", "1800.0 5 990.0"), "one focal length and no shear"),
        (("0 0 1\n", "0 0\n"), "3 finite numbers"),
        (("-0.05 0.04 -0.03\n", ""), "cut short"),
        (("2000 1500", "2000 wide"), "its name, width and height"),
    ],
)
def test_what_is_broken_is_named(tmp_path, change, message):
    text = _text(scenes.ring(n_images=1, n_points=4)[0])
    assert change[0] in text
    (tmp_path / "p.txt").write_text(text.replace(*change, 1))
    with pytest.raises(InputError, match=message):
        read_pix4d(tmp_path / "p.txt")
