"""Reconstructions of OpenSfM and ODM: `reconstruction.json`, `tracks.csv`, `gcp_list.txt`, `geo.txt`.

Poses go from world to camera, x right, y down, z forward. Image coordinates are from the middle of the image,
in shares of its larger side; the centre of the first pixel is (0.5, 0.5) here. The world is east, north, up
at `reference_lla`: a local tangent frame (RTL).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.formats.blocks.features import add_features
from obseq.formats.blocks.json_nodes import Node, read_json
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.formats.blocks.rigs import Rig, add_rig
from obseq.formats.opensfm.cameras import read_camera
from obseq.formats.opensfm.world import add_ground_points, add_positions
from obseq.geometry import RigidMotion, exponential
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses
from obseq.reading.tables import text_of
from obseq.reading.text import counted

PLACES = ("", "opensfm")
"""Where the files are in a folder: beside one another, or in that of ODM's project."""
TRACKS = "OPENSFM_TRACKS_VERSION_v"


def read_opensfm(path: str | Path) -> BundleAdjustment:
    """The largest reconstruction of a folder; points have the names of their tracks, images their own.

    Raises:
        InputError: a file is missing or broken, or a camera has a model that is not one of ours.
    """
    place = Path(path)
    if place.is_dir():
        folders = [place / name for name in PLACES]
        place = next((f for f in folders if (f / "reconstruction.json").is_file()), place)
        place /= "reconstruction.json"
    scenes = sorted(read_json(place), key=lambda scene: -len(dict(scene.get("shots", {}).items())))
    if not scenes:
        raise InputError(f"{place}: there is no reconstruction")
    scene = scenes[0]
    with new_block(path) as block:
        others = [f"{len(dict(one.get('shots', {}).items()))} images" for one in scenes[1:]]
        note_count(block, others, "smaller reconstructions are left out")
        cameras = dict(read_camera(name, given) for name, given in scene["cameras"].items())
        block.add_cameras(*cameras)
        hold_all_but(block, {camera.name: free for camera, free in cameras.items()})
        _add_images(block, scene)
        _add_points(block, place, scene)
        _add_rigs(block, scene)
        _place(block, scene)
        add_positions(block, place.parent, scene)
        add_ground_points(block, place.parent)
    return block


def _add_images(block: BundleAdjustment, scene: Node) -> None:
    names, owners, turns, shifts = [], [], [], []
    for name, shot in scene["shots"].items():
        names.append(name)
        owners.append(shot["camera"].text())
        turns.append(shot["rotation"].numbers(3))
        shifts.append(shot["translation"].numbers(3))
        if owners[-1] not in block.cameras:
            raise shot.problem(f"the camera {owners[-1]!r} is not there")
    motions = RigidMotion(np.array(shifts).reshape(-1, 3), exponential(np.array(turns).reshape(-1, 3)))
    poses = motions.inverse()
    block.add_poses(Poses.of(names, poses.centre, poses.rotation, cameras=owners))


def _add_points(block: BundleAdjustment, place: Path, scene: Node) -> None:
    points = {name: point["coordinates"].numbers(3) for name, point in scene["points"].items()}
    block.add_approximations(list(points), np.array(list(points.values())).reshape(-1, 3))
    tracks = _track_file(place)
    if not tracks.is_file():
        block.notes.append(f"{tracks}: there is no such file: image points come from --measures")
        return
    images, names = list(block.poses.images), list(points)
    image_of = {name: k for k, name in enumerate(images)}
    point_of = {name: k for k, name in enumerate(names)}
    rows = [
        (image_of[image], point_of[track], x, y)
        for image, track, x, y in _tracks(tracks)
        if image in image_of and track in point_of
    ]
    if not rows:
        return
    columns = np.array(rows)
    image, point = columns[:, :2].T.astype(np.int64)
    cameras = [block.cameras[block.camera_of[name]] for name in images]
    add_features(block, images, names, image, point, _pixels(columns[:, 2:], cameras, image))


def _pixels(xy: FloatArray, cameras: list[Camera], image: IntArray) -> FloatArray:
    """Pixels (n, 2) of coordinates from the middle, in shares of the larger side."""
    sizes = np.array([(camera.width, camera.height) for camera in cameras], dtype=np.float64)[image]
    return np.asarray(xy * sizes.max(axis=1, keepdims=True) + sizes / 2.0)


def _track_file(place: Path) -> Path:
    """The tracks beside a reconstruction, which may have a word more in their name as it has."""
    found = place.with_name(place.name.replace("reconstruction", "tracks")).with_suffix(".csv")
    return found if found.is_file() else place.with_name("tracks.csv")


def _tracks(path: Path) -> list[tuple[str, str, float, float]]:
    """Image, track, x and y of each feature."""
    lines = text_of(path).split("\n")
    version = 0
    if lines[0].startswith(TRACKS):
        word = lines.pop(0)[len(TRACKS) :].strip()
        if word not in ("1", "2"):
            raise InputError(f"{path}:1: tracks of version {word[:20]!r} are not read; 1 and 2 are")
        version = 1
    found = []
    for number, line in enumerate(counted(path, lines), 1 + version):
        if not line:
            continue
        fields = line.split("\t")
        try:
            found.append((fields[0], fields[1], float(fields[3]), float(fields[4])))
        except (IndexError, ValueError):
            raise InputError(f"{path}:{number}: a track is: image, track, feature, x, y") from None
    if not np.isfinite([row[2:] for row in found]).all():
        raise InputError(f"{path}: a coordinate is not finite")
    return found


def _add_rigs(block: BundleAdjustment, scene: Node) -> None:
    """The rig of all instances, where its cameras are several."""
    cameras = {
        name: RigidMotion(camera["translation"].numbers(3), exponential(camera["rotation"].numbers(3)))
        for name, camera in scene.get("rig_cameras", {}).items()
    }
    exposures = []
    for name, instance in scene.get("rig_instances", {}).items():
        for image, camera in instance["rig_camera_ids"].items():
            if camera.text() not in cameras:
                raise camera.problem(f"the rig camera {camera.text()!r} is not there")
            exposures.append((camera.text(), name, image))
    if exposures:
        places = {name: motion.inverse() for name, motion in cameras.items()}
        master = next(iter(cameras))
        home = places[master].inverse()
        moved = {name: home @ place for name, place in places.items()}
        add_rig(block, Rig("rig", master, moved, exposures))


def _place(block: BundleAdjustment, scene: Node) -> None:
    """Where the frame is on the Earth."""
    reference = scene.get("reference_lla", {})
    values = [reference.get(key, 0.0).number() for key in ("longitude", "latitude", "altitude")]
    if any(values):
        block.frame = f"RTL*{values[0]!r}*{values[1]!r}*{values[2]!r}*Geog"
