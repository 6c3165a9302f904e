"""COLMAP's sparse models: `cameras`, `images`, `points3D`, read as text or binary, written as text.

Rigs and frames (`rigs`, `frames`) are not read: each image has a pose of its own, and the block a note on it.
Poses go from world to camera, x right, y down, z forward; the centre of the first pixel is (0.5, 0.5), as it
stays here. COLMAP's p1 is our p2, and its p2 our p1.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.formats.camera_terms import check_camera
from obseq.formats.colmap.model import read_model
from obseq.formats.fitted import fitted_camera
from obseq.geometry import RigidMotion, attitudes, rotations_from
from obseq.images.camera import Camera
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.writing import write_all

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.formats.colmap.model import ColmapCamera, ColmapImage, ColmapModel
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.bundle import BundleAdjustment

TERMS = ("K1", "K2", "p1", "p2")
"""Of the distortion, in the order of the camera that is written."""
WRITTEN = ("cameras.txt", "images.txt", "points3D.txt")
_ONE, _TWO, _DECENTRIC = ("F", "PPx", "PPy"), ("F", "PPx", "PPy", "b1"), ("p1", "p2")
FREE = {
    "SIMPLE_PINHOLE": _ONE,
    "PINHOLE": _TWO,
    "SIMPLE_RADIAL": (*_ONE, "K1"),
    "RADIAL": (*_ONE, "K1", "K2"),
    "OPENCV": (*_TWO, "K1", "K2", *_DECENTRIC),
    "FULL_OPENCV": (*_TWO, *(f"K{k}" for k in range(1, 6)), *_DECENTRIC),
    "SIMPLE_RADIAL_FISHEYE": (*_ONE, "K1"),
    "RADIAL_FISHEYE": (*_ONE, "K1", "K2"),
    "OPENCV_FISHEYE": (*_TWO, "K1", "K2", "K3", "K4"),
}
"""Our names of the parameters of each model: two focal lengths are F and b1. A quotient becomes K1 to K5."""
UNREAD = ("rigs", "frames")
"""Files of rigid blocks, since version 3.12."""


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
        block.notes.extend(_unread(place))
        block.add_poses(_poses(place, model.images, cameras))
        _add_points(block, place, model)
    return block


def _unread(place: Path) -> Iterator[str]:
    found = [name for stem in UNREAD for name in (f"{stem}.bin", f"{stem}.txt") if (place / name).is_file()]
    if found:
        files = " and ".join(found)
        yield f"{place}: {files}: rigs are not read; each image has a pose of its own (add_rigid_block)"


def _poses(place: Path, images: list[ColmapImage], cameras: dict[int, Camera]) -> Poses:
    quaternions = np.array([image.quaternion for image in images]).reshape(-1, 4)
    shifts = np.array([image.shift for image in images]).reshape(-1, 3)
    try:
        poses = RigidMotion(shifts, rotations_from(quaternions, "quaternion")).inverse()
        names = [image.name for image in images]
        owners = [cameras[image.camera].name for image in images]
        return Poses.of(names, poses.centre, poses.rotation, cameras=owners)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _add_points(block: BundleAdjustment, place: Path, model: ColmapModel) -> None:
    row = {number: k for k, number in enumerate(model.points)}
    lost = {number for image in model.images for number in image.points} - row.keys()
    if lost:
        raise InputError(f"{place}: point {min(lost)} is measured in images but not in points3D")
    names = [str(number) for number in model.points]
    block.add_approximations(names, np.array(list(model.points.values())).reshape(-1, 3))
    image = np.repeat(np.arange(len(model.images)), [len(one.points) for one in model.images])
    point = np.array([row[number] for one in model.images for number in one.points], dtype=np.int64)
    xy = np.concatenate([np.zeros((0, 2)), *(one.xy for one in model.images)])
    _, first = np.unique(np.column_stack([image, point]), axis=0, return_index=True)
    kept = np.sort(first)
    images = [one.name for one in model.images]
    again = np.setdiff1d(np.arange(len(image)), kept).tolist()
    labels = [f"image {images[image[row]]} point {names[point[row]]}" for row in again]
    note_count(block, labels, "features are left out: their points have another one in the image")
    block.add_measures(ImagePoints.packed(images, names, image[kept], point[kept], xy[kept]))


def _camera(name: str, given: ColmapCamera) -> Camera:
    values = list(given.parameters)
    try:
        if given.model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
            focal, x, y, *radial = values
            radial += [0.0] * (2 - len(radial))
            return Camera(name, *given.size, focal, np.array([x, y]), (2, 0, 0), radial)
        if given.model in ("PINHOLE", "OPENCV"):
            return _opencv(name, given.size, values)
        if given.model == "FULL_OPENCV":
            return _rational(name, given.size, values)
        if given.model in ("SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE"):
            powers = dict(zip(("K1", "K2"), values[3:], strict=False))
            middle = np.array(values[1:3])
            return Camera(name, *given.size, values[0], middle, (3, 1, 1), powers, "FE_EquiDist")
        if given.model == "OPENCV_FISHEYE":
            return _fisheye(name, given.size, values)
    except InputError as error:
        raise InputError(f"{given.where}: {error}") from None
    raise InputError(f"{given.where}: the model {given.model} is not one of ours")


def _fisheye(name: str, size: tuple[int, int], values: list[float]) -> Camera:
    fx, fy, x, y, *given = values
    powers = dict(zip(("K1", "K2", "K3", "K4"), given, strict=True))
    camera = Camera(name, *size, fy, np.array([x, y]), (5, 1, 1), powers, "FE_EquiDist")
    if fx == fy:
        return camera

    def project(plane: FloatArray) -> FloatArray:
        return np.asarray(camera.distorted(plane) * [fx, fy] + [x, y])

    return fitted_camera(name, size, fy, project, ((5, 1, 1), (5, 1, 5)), camera.projection)


def _opencv(name: str, size: tuple[int, int], values: list[float]) -> Camera:
    fx, fy, x, y, *more = values
    k1, k2, p1, p2 = more or (0.0, 0.0, 0.0, 0.0)
    given = {"K1": k1, "K2": k2, "p1": p2, "p2": p1}
    if fx == fy or not any(given.values()):
        return Camera(name, *size, fy, np.array([x, y]), (3, 1, 1), given | {"b1": fx / fy - 1.0})
    unit = Camera(name, 0, 0, 1.0, np.zeros(2), (3, 1, 1), given)

    def project(plane: FloatArray) -> FloatArray:
        return np.asarray(unit.distorted(plane) * [fx, fy] + [x, y])

    return fitted_camera(name, size, fy, project)


def _rational(name: str, size: tuple[int, int], values: list[float]) -> Camera:
    """OpenCV's model with a quotient of polynomials, where ours comes near enough."""
    fx, fy, x, y, k1, k2, p1, p2, k3, k4, k5, k6 = values
    decentric = Camera(name, 0, 0, 1.0, np.zeros(2), (3, 1, 1), {"p1": p2, "p2": p1})

    def project(plane: FloatArray) -> FloatArray:
        square = np.sum(plane**2, axis=1, keepdims=True)
        above = 1.0 + square * (k1 + square * (k2 + square * k3))
        below = 1.0 + square * (k4 + square * (k5 + square * k6))
        distorted = plane * above / below + decentric.distorted(plane) - plane
        return np.asarray(distorted * [fx, fy] + [x, y])

    return fitted_camera(name, size, fy, project, ((5, 1, 1), (5, 1, 5)))


def write_colmap(solution: BundleSolution, folder: str | Path) -> None:
    """Writes an adjusted block as `cameras.txt`, `images.txt` and `points3D.txt`.

    Raises:
        InputError: a camera has no model in COLMAP: it takes at most K1, K2, p1 and p2.
    """
    write_all(dict(colmap_files(solution, folder)))


def colmap_files(solution: BundleSolution, folder: str | Path) -> dict[Path, str]:
    """The files that `write_colmap` writes."""
    number = {name: k for k, name in enumerate(solution.cameras, 1)}
    cameras = (_camera_line(number[camera.name], camera) for camera in solution.cameras.values())
    parts = cameras, _image_lines(solution, number), _point_lines(solution)
    return {Path(folder) / name: "".join(lines) for name, lines in zip(WRITTEN, parts, strict=True)}


def _camera_line(number: int, camera: Camera) -> str:
    check_camera(camera, "COLMAP", TERMS)
    given = dict(zip(camera.coefficient_names, camera.coefficients, strict=True))
    x, y = camera.principal_point
    k1, k2, p1, p2 = (given.get(name, 0.0) for name in TERMS)
    values = (camera.focal, camera.focal, x, y, k1, k2, p2, p1)
    text = " ".join(f"{value:.17g}" for value in values)
    return f"{number} OPENCV {camera.width} {camera.height} {text}\n"


def _image_lines(solution: BundleSolution, number: dict[str, int]) -> Iterator[str]:
    back = solution.poses.motions.inverse()
    found = solution.residuals
    for k, (image, camera) in enumerate(zip(solution.poses.images, solution.poses.cameras, strict=True)):
        values = [*attitudes(back.rotation[k], "quaternion"), *back.centre[k]]
        yield f"{k + 1} {' '.join(f'{value:.17g}' for value in values)} {number[camera]} {image}\n"
        rows = np.flatnonzero(found.image == k)
        pairs = zip(found.xy[rows], found.point[rows], strict=True)
        triples = (f"{x:.17g} {y:.17g} {p + 1}" for (x, y), p in pairs)
        yield " ".join(triples) + "\n"


def _point_lines(solution: BundleSolution) -> Iterator[str]:
    found = solution.residuals
    place = np.empty(len(found.image), dtype=np.int64)
    for k in range(len(solution.poses)):
        rows = np.flatnonzero(found.image == k)
        place[rows] = np.arange(len(rows))
    order = np.argsort(found.point, kind="stable")
    ends = np.cumsum(np.bincount(found.point, minlength=len(solution.points)))
    for point, (xyz, rows) in enumerate(zip(solution.coordinates, np.split(order, ends[:-1]), strict=True)):
        error = float(found.norms[rows].mean()) if rows.size else 0.0
        track = " ".join(f"{found.image[row] + 1} {place[row]}" for row in rows)
        yield f"{point + 1} {' '.join(f'{v:.17g}' for v in xyz)} 255 255 255 {error:.6g} {track}\n"
