"""COLMAP's sparse models as text: `cameras.txt`, `images.txt`, `points3D.txt`.

Poses go from world to camera, x right, y down, z forward; the centre of the first pixel is (0.5, 0.5), as it
stays here. COLMAP's p1 is our p2, and its p2 our p1.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.geometry import Pose, attitudes, rotations_from
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.files.tables import text_of
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.writing import write_all

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.images.adjustment.solution import BundleSolution

MODELS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8}


def read_colmap(folder: str | Path) -> BundleAdjustment:
    """The block of a sparse model; points keep their numbers as names, images their names.

    Raises:
        InputError: a file is missing or broken, or a camera has a model that is not one of ours.
    """
    place = Path(folder)
    cameras = dict(_cameras(place / "cameras.txt"))
    block = BundleAdjustment()
    block.add_cameras(*cameras.values())
    names, poses, views = _images(place / "images.txt")
    numbers = [number for number, _ in names]
    missing = [number for number in numbers if number not in cameras]
    if missing:
        raise InputError(f"{place / 'images.txt'}: camera {missing[0]} is not in cameras.txt")
    block.add_poses(
        Poses.of(
            [name for _, name in names], poses.centre, poses.rotation,
            cameras=[cameras[number].name for number in numbers],
        )
    )  # fmt: skip
    _add_points(block, place / "points3D.txt", [name for _, name in names], views)
    return block


def _add_points(block: BundleAdjustment, path: Path, images: list[str], views: list[np.ndarray]) -> None:
    rows = [_floats(path, number, fields[:4]) for number, fields in _lines(path)]
    points = {int(row[0]): row[1:] for row in rows}
    stacked = np.concatenate(views) if views else np.zeros((0, 3))
    image = np.repeat(np.arange(len(views)), [len(view) for view in views])
    point = stacked[:, 2].astype(np.int64)
    lost = set(np.unique(point).tolist()) - set(points)
    if lost:
        raise InputError(f"{path}: point {min(lost)} is measured in images.txt but not here")
    names = [str(number) for number in points]
    number = {key: k for k, key in enumerate(points)}
    block.add_approximations(names, np.array(list(points.values())).reshape(-1, 3))
    order = np.array([number[key] for key in point.tolist()], dtype=np.int64)
    _, first = np.unique(np.column_stack([image, order]), axis=0, return_index=True)
    kept = np.sort(first)  # COLMAP may match a point to two features of an image; the first one counts
    block.add_measures(ImagePoints.packed(images, names, image[kept], order[kept], stacked[kept, :2]))


def _cameras(path: Path) -> Iterator[tuple[int, Camera]]:
    for line, fields in _lines(path):
        if len(fields) < 5 or fields[1] not in MODELS or len(fields) != 4 + MODELS[fields[1]]:
            raise InputError(
                f"{path}:{line}: a camera is: number, model, width, height, parameters; the models "
                f"known here are {', '.join(MODELS)}"
            )
        width, height, *values = _floats(path, line, fields[2:])
        yield int(fields[0]), _camera(f"camera {fields[0]}", fields[1], int(width), int(height), values)


def _camera(name: str, model: str, width: int, height: int, values: list[float]) -> Camera:
    if model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"):
        focal, x, y, *radial = values
        radial += [0.0] * (2 - len(radial))
        return Camera(name, width, height, focal, np.array([x, y]), (2, 0, 0), radial)
    fx, fy, x, y, *more = values
    k1, k2, p1, p2 = more or (0.0, 0.0, 0.0, 0.0)
    if model == "OPENCV" and fx != fy:
        # fx D_x = fy (D_x + b1 x) exactly for b1 x alone; with distortion the products would not vanish
        raise InputError(f"{name}: two focal lengths with distortion are not a model of ours")
    given = {"K1": k1, "K2": k2, "p1": p2, "p2": p1, "b1": fx / fy - 1.0}
    return Camera(name, width, height, fy, np.array([x, y]), (3, 1, 1), given)


def _images(path: Path) -> tuple[list[tuple[int, str]], Pose, list[np.ndarray]]:
    """Camera and name of each image, poses, and rows x, y, point of each."""
    lines = [
        (number, line.split())
        for number, line in enumerate(text_of(path).splitlines(), 1)
        if not line.startswith("#")
    ]
    if len(lines) % 2 and lines and not lines[-1][1]:
        lines.pop()
    if len(lines) % 2:
        raise InputError(f"{path}: an image takes two lines, the second of which may be empty")
    names, quaternions, shifts, views = [], [], [], []
    for (number, first), (below, second) in zip(lines[::2], lines[1::2], strict=True):
        if len(first) < 10 or len(second) % 3:
            raise InputError(f"{path}:{number}: an image is: number, qw qx qy qz, tx ty tz, camera, name")
        values = _floats(path, number, first[1:9])
        names.append((int(values[7]), " ".join(first[9:])))
        quaternions.append(values[:4])
        shifts.append(values[4:7])
        rows = np.array(_floats(path, below, second)).reshape(-1, 3)
        views.append(rows[rows[:, 2] >= 0])
    rotations = rotations_from(np.array(quaternions).reshape(-1, 4), "quaternion")
    return names, Pose(np.array(shifts).reshape(-1, 3), rotations).inverse(), views


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(text_of(path).splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            yield number, line.split()


def _floats(path: Path, line: int, fields: list[str]) -> list[float]:
    try:
        values = [float(field) for field in fields]
    except ValueError as error:
        raise InputError(f"{path}:{line}: {error}") from None
    if not np.isfinite(values).all():
        raise InputError(f"{path}:{line}: a number is not finite")
    return values


def write_colmap(solution: BundleSolution, folder: str | Path) -> None:
    """Writes an adjusted block as `cameras.txt`, `images.txt` and `points3D.txt`.

    Raises:
        InputError: a camera has no model in COLMAP: it takes at most K1, K2, p1 and p2.
    """
    place = Path(folder)
    number = {name: k for k, name in enumerate(solution.cameras, 1)}
    write_all(
        {
            place / "cameras.txt": "".join(
                _camera_line(number[c.name], c) for c in solution.cameras.values()
            ),
            place / "images.txt": "".join(_image_lines(solution, number)),
            place / "points3D.txt": "".join(_point_lines(solution)),
        }
    )


def _camera_line(number: int, camera: Camera) -> str:
    given = dict(zip(camera.coefficient_names, camera.coefficients, strict=True))
    others = [name for name, value in given.items() if value and name not in ("K1", "K2", "p1", "p2")]
    if camera.projection != "Stenope" or camera.backward or others:
        raise InputError(
            f"camera {camera.name}: COLMAP has no place for {', '.join(others) or _kind(camera)}"
        )
    x, y = camera.principal_point
    k1, k2, p1, p2 = (given.get(name, 0.0) for name in ("K1", "K2", "p1", "p2"))
    values = (camera.focal, camera.focal, x, y, k1, k2, p2, p1)
    text = " ".join(f"{value:.17g}" for value in values)
    return f"{number} OPENCV {camera.width} {camera.height} {text}\n"


def _kind(camera: Camera) -> str:
    return "distortion that corrects the measured point" if camera.backward else camera.projection


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
