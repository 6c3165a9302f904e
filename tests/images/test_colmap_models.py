"""All camera models of COLMAP, and its rigs. The pixels are those that pycolmap 4.2.1 gives."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import scenes

from obseq.errors import InputError
from obseq.formats.colmap.models import FREE, MODELS, camera_of, parameters_of
from obseq.formats.colmap.reader import read_colmap, write_colmap
from obseq.geometry import RigidMotion, attitudes, exponential
from obseq.images import Camera, ControlPoints, Poses

RAYS = np.array([[0.1, 0.2, 1.0], [-0.35, 0.25, 1.0], [0.4, -0.3, 1.2]])
PYCOLMAP = json.loads((Path(__file__).parents[1] / "data" / "colmap_models.json").read_text())


@pytest.mark.parametrize("model", list(MODELS))
def test_a_model_projects_as_colmap_says_and_comes_back(model):
    values, pixels = PYCOLMAP[model]
    assert len(values) == MODELS[model]
    size = (1000, 500) if model == "EQUIRECTANGULAR" else (1000, 760)
    camera = camera_of("c", model, size, values)
    np.testing.assert_allclose(camera.project(RAYS), pixels, atol=0.01)
    name, again = parameters_of(camera, (model,))
    assert name == model
    np.testing.assert_allclose(camera_of("c", model, size, again).project(RAYS), pixels, atol=0.02)
    assert set(FREE[model]) <= {*camera.parameter_names, "K4", "K5"}


def test_a_camera_that_a_model_does_not_reach_is_refused():
    bent = Camera("c", 1000, 760, 900.0, degree=(3, 1, 1), distortion={"K1": -0.2})
    with pytest.raises(InputError, match="its model of COLMAP projects otherwise"):
        parameters_of(bent, ("PINHOLE",))


@pytest.fixture(scope="module")
def solved():
    block, _, _ = scenes.block()
    block.freeze_parameters("K3|b.")
    return block.solve()


def test_names_and_models_survive_a_round_trip(solved, tmp_path):
    write_colmap(solved, tmp_path)
    again = read_colmap(tmp_path)
    assert set(again.approximations) == set(solved.points)  # P0, P1, ...: in comments
    assert set(again.poses.images) == set(solved.poses.images)
    text = (tmp_path / "cameras.txt").read_text().replace("OPENCV", "FOV").split()
    (tmp_path / "cameras.txt").write_text(" ".join([*text[:8], "0.3"]) + "\n")
    block = read_colmap(tmp_path)
    block.freeze_parameters(".*")
    write_colmap(block.solve(datum="centres"), tmp_path / "again")
    line = (tmp_path / "again" / "cameras.txt").read_text().split()
    assert line[:2] == ["1", "FOV"]
    np.testing.assert_allclose(float(line[-1]), 0.3, atol=1e-4)


# Rigs


PLACES = {
    7: RigidMotion(np.zeros(3), np.eye(3)),
    8: RigidMotion(np.array([0.5, 0.0, 0.1]), exponential([0.0, 0.3, 0.0])),
}


def _rig(folder, binary, noise=0.3):
    """Two cameras on a ring of six frames, their files as COLMAP has them."""
    masters, points = scenes.ring(n_images=6, n_points=40)
    rng = np.random.default_rng(5)
    images, features, track = [], [], {p: [] for p in range(len(points))}
    for frame, (centre, rotation) in enumerate(zip(masters.centres, masters.rotations, strict=True)):
        for camera, place in PLACES.items():
            pose = RigidMotion(centre, rotation) @ place
            local = pose.to_local(points)
            seen = np.flatnonzero(scenes.CAMERA.sees(local))
            xy = scenes.CAMERA.project(local[seen]) + rng.normal(0.0, noise, (len(seen), 2))
            number = len(images) + 1
            images.append((number, pose.inverse(), camera, frame + 1))
            features.append((xy, seen))
            for k, p in enumerate(seen):
                track[p].append((number, k))
    values = [1800.0, 1800.0, 1000.0, 750.0, -0.08, 0.02, 0.0, 1e-3]
    _write_text(folder, images, features, points, track, values)
    if binary:
        for name in ("rigs", "frames"):
            (folder / f"{name}.txt").unlink()
        _write_binary_rigs(folder, images)
        for name in ("cameras", "images", "points3D"):
            assert (folder / f"{name}.txt").is_file()
    return masters


def _numbers(motion):
    return [*attitudes(motion.rotation, "quaternion").tolist(), *motion.centre.tolist()]


def _write_text(folder, images, features, points, track, values):
    def words(numbers):
        return " ".join(map(repr, map(float, numbers)))

    cameras = [f"{k} OPENCV 2000 1500 {words(values)}" for k in PLACES]
    lines = []
    for (number, back, camera, frame), (xy, seen) in zip(images, features, strict=True):
        lines.append(f"{number} {words(_numbers(back))} {camera} f{frame}/c{camera}.jpg")
        lines.append(" ".join(f"{words(place)} {p + 1}" for place, p in zip(xy, seen, strict=True)))
    seen_by = {p: " ".join(f"{i} {k}" for i, k in own) for p, own in track.items()}
    rows = [f"{p + 1} {words(xyz)} 1 2 3 0.5 {seen_by[p]}" for p, xyz in enumerate(points)]
    rig = f"3 2 CAMERA 7 CAMERA 8 1 {words(_numbers(PLACES[8].inverse()))}"
    frames = [
        f"{frame} 3 {words(_numbers(back))} 2 CAMERA 7 {number} CAMERA 8 {number + 1}"
        for number, back, camera, frame in images
        if camera == 7
    ]
    files = {"cameras": cameras, "images": lines, "points3D": rows, "rigs": [rig], "frames": frames}
    for name, text in files.items():
        (folder / f"{name}.txt").write_text("# a comment\n" + "\n".join(text) + "\n")


def _write_binary_rigs(folder, images):
    pose = _numbers(PLACES[8].inverse())
    rig = struct.pack("<QIIiI", 1, 3, 2, 0, 7) + struct.pack("<iIB7d", 0, 8, 1, *pose)
    own = [one for one in images if one[2] == 7]
    frames = struct.pack("<Q", len(own))
    for number, back, _, frame in own:
        frames += struct.pack("<II7dI", frame, 3, *_numbers(back), 2)
        frames += struct.pack("<iIQ", 0, 7, number) + struct.pack("<iIQ", 0, 8, number + 1)
    (folder / "rigs.bin").write_bytes(rig)
    (folder / "frames.bin").write_bytes(frames)


@pytest.mark.parametrize("binary", [False, True])
def test_a_rig_is_a_rigid_block(tmp_path, binary):
    masters = _rig(tmp_path, binary)
    block = read_colmap(tmp_path)
    (rig,) = block.rigid_blocks
    assert (rig.name, rig.master) == ("rig 3", "camera 7")
    assert len(rig.exposures.names) == 6
    np.testing.assert_allclose(rig.places["camera 8"].centre, PLACES[8].centre, atol=1e-12)
    block.freeze_parameters(".*")
    solution = block.solve(datum="centres")
    found = solution.rigid_residuals("rig 3")
    assert np.abs(found.translations).max() < 1e-4  # exact: far below what pixels tell (2 mm)
    control = ControlPoints.of(["1", "2", "3", "4"], scenes.ring(n_images=6, n_points=40)[1][:4], 1e-4)
    block.add_control_points(control)
    place = block.solve().rigid_places("rig 3")["camera 8"]
    np.testing.assert_allclose(place.centre, PLACES[8].centre, atol=0.01)
    assert isinstance(masters, Poses)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("rigs", (" CAMERA 8 1", " CAMERA 8 1 7"), "a sensor is|numbers are expected|is no whole number"),
        ("rigs", ("3 2 CAMERA", "3 CAMERA"), "a rig is|a sensor is|is no whole number|is not in rigs"),
        ("frames", ("1 3 ", "1 9 "), "is of rig 9, which is not in rigs"),
        ("frames", (" CAMERA 7", ""), "a frame is"),
    ],
)
def test_broken_rigs_are_named(tmp_path, name, change, message):
    _rig(tmp_path, False)
    path = tmp_path / f"{name}.txt"
    path.write_text(path.read_text().replace(*change, 1))
    with pytest.raises(InputError, match=message):
        read_colmap(tmp_path)
