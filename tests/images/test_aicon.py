"""Files of AICON 3D Studio: cameras project as its formula says, lines that are wrong are named."""

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.aicon.reader import read_aicon
from obseq.images import Poses

NAMES = [f"P{k}" for k in range(30)]


def _local(block, image, xyz):
    return block.poses[image].to_local(np.atleast_2d(xyz))


def _projected(block, image, xyz):
    return block.cameras[block.camera_of[image]].project(_local(block, image, xyz))


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
