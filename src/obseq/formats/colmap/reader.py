"""COLMAP's sparse models: `cameras`, `images`, `points3D`, read as text or binary, written as text.

Rigs and frames (`rigs`, `frames`) are rigid blocks; their cameras have places that are unknown.
Poses go from world to camera, x right, y down, z forward; the centre of the first pixel is (0.5, 0.5), as it
stays here. COLMAP's p1 is our p2, and its p2 our p1.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from obseq.errors import InputError, naming
from obseq.formats.blocks.features import add_features
from obseq.formats.blocks.reading import hold_all_but, new_block
from obseq.formats.blocks.rigs import Rig, add_rig
from obseq.formats.camera_terms import check_camera, check_cameras
from obseq.formats.colmap.model import ColmapCamera, ColmapImage, ColmapModel, read_model
from obseq.formats.colmap.models import FREE, camera_of, parameters_of
from obseq.formats.colmap.rigs import lone_files, read_rigs
from obseq.geometry import RigidMotion, attitudes, rotations_from
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses
from obseq.writing import write_all

TERMS = ("K1", "K2", "p1", "p2")
"""Of the distortion, in the order of the camera that is written."""
WRITTEN = ("cameras.txt", "images.txt", "points3D.txt")
NUMBER, DIGITS = re.compile(r"camera (\d{1,9})"), re.compile(r"(0|[1-9]\d{0,17})")
"""What cameras and points of a model are called here."""


def read_colmap(folder: str | Path) -> BundleAdjustment:
    """The block of a sparse model, text or binary; points keep their numbers as names, images their names.

    Of a camera its own parameters are unknown; the others that ours has are held. Of two features of an image
    that COLMAP has matched to one point, the first one counts, and the others are told in a note.

    Raises:
        InputError: a file is missing or broken, or a camera has a model that is not one of ours.
    """
    place = Path(folder)
    model = read_model(place)
    cameras = {number: _camera(f"camera {number}", given) for number, given in model.cameras.items()}
    with new_block(place) as block:
        block.add_cameras(*cameras.values())
        hold_all_but(block, {cameras[k].name: FREE[given.model] for k, given in model.cameras.items()})
        missing = [image for image in model.images if image.camera not in cameras]
        if missing:
            raise InputError(
                f"{place}: camera {missing[0].camera} of image {missing[0].name} is not in cameras"
            )
        block.add_poses(_poses(place, model.images, cameras))
        _add_points(block, place, model)
        _add_rigs(block, place, model)
        block.models = {cameras[k].name: given.model for k, given in model.cameras.items()}
    return block


def _add_rigs(block: BundleAdjustment, place: Path, model: ColmapModel) -> None:
    """Rigs of several cameras; the poses of their images are what they are in the model."""
    images = {image.number: image.name for image in model.images}
    alone = lone_files(place)
    if alone:
        block.notes.append(f"{place}: {' and '.join(alone)}: rigs are not read: rigs go with frames, alike")
    for rig in read_rigs(place):
        known = {f"camera {number}": where for number, where in rig.places.items() if where is not None}
        exposures = [
            (f"camera {camera}", str(frame), images[image])
            for camera, frame, image in rig.exposures
            if image in images and f"camera {camera}" in known
        ]
        add_rig(block, Rig(f"rig {rig.number}", f"camera {rig.reference}", known, exposures))


def _poses(place: Path, images: list[ColmapImage], cameras: dict[int, Camera]) -> Poses:
    quaternions = np.array([image.quaternion for image in images]).reshape(-1, 4)
    shifts = np.array([image.shift for image in images]).reshape(-1, 3)
    with naming(place):
        poses = RigidMotion(shifts, rotations_from(quaternions, "quaternion")).inverse()
        names = [image.name for image in images]
        owners = [cameras[image.camera].name for image in images]
        return Poses.of(names, poses.centre, poses.rotation, cameras=owners)


def _add_points(block: BundleAdjustment, place: Path, model: ColmapModel) -> None:
    row = {number: k for k, number in enumerate(model.points)}
    lost = {number for image in model.images for number in image.points} - row.keys()
    if lost:
        raise InputError(f"{place}: point {min(lost)} is measured in images but not in points3D")
    names = [model.names.get(number, str(number)) for number in model.points]
    block.add_approximations(names, np.array(list(model.points.values())).reshape(-1, 3))
    image = np.repeat(np.arange(len(model.images)), [len(one.points) for one in model.images])
    point = np.array([row[number] for one in model.images for number in one.points], dtype=np.int64)
    xy = np.concatenate([np.zeros((0, 2)), *(one.xy for one in model.images)])
    add_features(block, [one.name for one in model.images], names, image, point, xy)


def _camera(name: str, given: ColmapCamera) -> Camera:
    with naming(given.where):
        return camera_of(name, given.model, given.size, given.parameters)


def write_colmap(solution: BundleSolution, folder: str | Path) -> None:
    """Writes an adjusted block as `cameras.txt`, `images.txt` and `points3D.txt`.

    Raises:
        InputError: a camera has no model in COLMAP: it takes at most K1, K2, p1 and p2.
    """
    write_all(dict(colmap_files(solution, folder)))


def colmap_files(solution: BundleSolution, folder: str | Path) -> dict[Path, str]:
    """The files that `write_colmap` writes: cameras and points keep their numbers where their names are such.

    A camera keeps the model that it came in. Points that are called otherwise have their names in comments.
    """
    number = _numbers([(name, NUMBER.fullmatch(name)) for name in solution.cameras])
    points = _numbers([(name, DIGITS.fullmatch(name)) for name in solution.points])
    models = solution.block.models
    cameras = (_camera_line(number[name], one, models.get(name)) for name, one in solution.cameras.items())
    parts = cameras, _image_lines(solution, number, points), _point_lines(solution, points)
    return {Path(folder) / name: "".join(lines) for name, lines in zip(WRITTEN, parts, strict=True)}


def _numbers(names: Sequence[tuple[str, re.Match[str] | None]]) -> dict[str, int]:
    """Numbers of names: what they say, or the next ones beyond."""
    given = {name: int(match[1]) for name, match in names if match}
    free = itertools.count(max(given.values(), default=0) + 1)
    return {name: given[name] if name in given else next(free) for name, _ in names}


def _camera_line(number: int, camera: Camera, model: str | None) -> str:
    if model is None:
        check_camera(camera, "COLMAP", TERMS)
        given = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
        k1, k2, p1, p2 = (given.get(name, 0.0) for name in TERMS)
        found = "OPENCV", np.array([*[camera.focal] * 2, *camera.principal_point, k1, k2, p2, p1])
    else:
        found = parameters_of(camera, (model,))
    text = " ".join(f"{value:.17g}" for value in found[1])
    return f"{number} {found[0]} {camera.width} {camera.height} {text}\n"


def _image_lines(solution: BundleSolution, number: dict[str, int], points: dict[str, int]) -> Iterator[str]:
    back = solution.poses.motions.inverse()
    found = solution.residuals
    numbers = [points[name] for name in solution.points]
    for k, (image, camera) in enumerate(zip(solution.poses.images, solution.poses.cameras, strict=True)):
        values = [*attitudes(back.rotation[k], "quaternion"), *back.centre[k]]
        yield f"{k + 1} {' '.join(f'{value:.17g}' for value in values)} {number[camera]} {image}\n"
        rows = np.flatnonzero(found.image == k)
        pairs = zip(found.xy[rows], found.point[rows], strict=True)
        triples = (f"{x:.17g} {y:.17g} {numbers[p]}" for (x, y), p in pairs)
        yield " ".join(triples) + "\n"


def _point_lines(solution: BundleSolution, points: dict[str, int]) -> Iterator[str]:
    found = solution.residuals
    place = np.empty(len(found.image), dtype=np.int64)
    for k in range(len(solution.poses)):
        rows = np.flatnonzero(found.image == k)
        place[rows] = np.arange(len(rows))
    for name in solution.points:
        if str(points[name]) != name:
            yield f"# point {points[name]} is called {name}\n"
    order = np.argsort(found.point, kind="stable")
    ends = np.cumsum(np.bincount(found.point, minlength=len(solution.points)))
    tracks = np.split(order, ends[:-1])
    for name, xyz, rows in zip(solution.points, solution.coordinates, tracks, strict=True):
        error = float(found.norms[rows].mean()) if rows.size else 0.0
        track = " ".join(f"{found.image[row] + 1} {place[row]}" for row in rows)
        yield f"{points[name]} {' '.join(f'{v:.17g}' for v in xyz)} 255 255 255 {error:.6g} {track}\n"


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block whose cameras COLMAP cannot hold; its own models it can."""
    check_cameras(block, "COLMAP", TERMS, block.models)
