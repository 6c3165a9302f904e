"""Sparse models of COLMAP: binary says what text says, and its cameras project as OpenCV says."""

import struct

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.colmap.reader import read_colmap, write_colmap
from obseq.geometry import attitudes
from obseq.images.output.page import text as summary
from obseq.images.output.record import record_of


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
    assert not text.notes
    for name in ("rigs.bin", "frames.txt"):
        (tmp_path / name).touch()
    binary = read_colmap(tmp_path)
    (note,) = binary.notes
    assert f"{tmp_path}: rigs.bin and frames.txt: rigs are not read" in note
    assert f"Note: {note}" in summary(record_of(binary.solve(datum="centres"))).replace("\n    ", " ")
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


def test_a_model_that_is_not_whole_says_what_is_missing(solved, tmp_path):
    _binary_colmap(tmp_path, *solved)
    (tmp_path / "cameras.txt").write_text("# nothing\n")
    (tmp_path / "points3D.bin").unlink()
    with pytest.raises(InputError, match=r": points3D\.bin not there: a model is cameras, images, points3D"):
        read_colmap(tmp_path)


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


def test_a_camera_that_ours_does_not_reach_is_refused(solved, tmp_path):
    far = [1800.0, 1800.0, 990.0, 760.0, 0, 0, 0, 0, 0, 60.0, 0, 0]
    _binary_colmap(tmp_path, *solved, (6, far))
    with pytest.raises(InputError, match="its distortion differs from ours by"):
        read_colmap(tmp_path)
