"""Bundle Adjustment in the Large: cameras that look along -z, y up, about the image centre.

    P = R X + t;  p = -P_xy / P_z;  pixel = f (1 + k1 |p|^2 + k2 |p|^4) p

Here y goes down and z forward: rotation and translation are turned by diag(1, -1, -1), and f, k1, k2 stay.
"""

from __future__ import annotations

import bz2
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError, naming
from obseq.formats.camera_terms import check_camera, check_cameras
from obseq.geometry import exponential, logarithm
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.block import Block
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.origin import Origin
from obseq.reading.tables import number_in, text_of
from obseq.reading.text import read_bytes
from obseq.writing import write_text

FLIP = np.array([1.0, -1.0, -1.0])
RADIAL = ("K1", "K2")
"""The terms of the distortion that BAL has."""


def read_bal(path: str | Path) -> BundleAdjustment:
    """The block of a BAL file, plain or compressed (.bz2): a camera per image, one pixel of sigma, no datum.

    Raises:
        InputError: the file does not hold what its first line says.
    """
    text = _text(path)
    numbers = _numbers(path, text)
    if len(numbers) < 3 or not (numbers[:3] == np.round(numbers[:3])).all() or (numbers[:3] < 0).any():
        raise InputError(f"{path}: the first line of a BAL file counts cameras, points and observations")
    n, m, k = numbers[:3].astype(np.int64)
    if len(numbers) != 3 + 4 * k + 9 * n + 3 * m:
        raise InputError(
            f"{_place(path, text, 0)}: {n} cameras, {m} points and {k} observations are "
            f"{3 + 4 * k + 9 * n + 3 * m} numbers; the file has {len(numbers)}"
        )
    rows = numbers[3 : 3 + 4 * k].reshape(-1, 4)
    cameras = numbers[3 + 4 * k : 3 + 4 * k + 9 * n].reshape(-1, 9)
    with np.errstate(invalid="ignore"):  # beyond whole numbers: refused
        index = rows[:, :2].astype(np.int64)
    wrong = np.flatnonzero(((index < 0) | (index >= [n, m]) | (index != rows[:, :2])).any(axis=1))
    if wrong.size:
        first, second = rows[wrong[0], :2]
        raise InputError(
            f"{_place(path, text, 3 + 4 * wrong[0])}: an observation names camera {first:g} and point "
            f"{second:g}; there are {n} and {m}, counted from 0"
        )
    points = numbers[3 + 4 * k + 9 * n :].reshape(-1, 3)
    with naming(path):
        return block_of_cameras(
            path, exponential(cameras[:, :3]), cameras[:, 3:6], cameras[:, 6:], points, index, rows[:, 2:]
        )


def _check_words(path: str | Path, text: str) -> None:
    """Refuses what is no finite number, with its line; lines that begin with # are left aside."""
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("#"):
            for word in line.split():
                number_in(word, f"{path}:{number}: a number is")


def _place(path: str | Path, text: str, number: int) -> str:
    """File and line of a number of the file, from 0."""
    for row, line in enumerate(text.splitlines(), 1):
        number -= len(line.split())
        if number < 0:
            return f"{path}:{row}"
    return str(path)


def _text(path: str | Path) -> str:
    if not str(path).endswith(".bz2"):
        return text_of(path)
    try:
        return bz2.decompress(read_bytes(Path(path))).decode()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _numbers(path: str | Path, text: str) -> FloatArray:
    try:
        numbers = np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        _check_words(path, text)
        raise InputError(f"{path}: {error}") from None
    if not np.isfinite(numbers).all():
        _check_words(path, text)
    return numbers


def block_of_cameras(
    path: str | Path,
    rotations: FloatArray,
    translations: FloatArray,
    interiors: FloatArray,
    points: FloatArray,
    index: IntArray,
    pixels: FloatArray,
    images: Sequence[str] | None = None,
) -> BundleAdjustment:
    """The block of a file of cameras in their convention: world to camera, f k1 k2.

    Args:
        path: the file.
        rotations: (n, 3, 3).
        translations: (n, 3).
        interiors: (n, 3) f, k1, k2.
        points: (m, 3).
        index: (k, 2) camera and point of each measure.
        pixels: (k, 2).
        images: (n,) names; numbers when None.
    """
    names = list(images) if images is not None else [f"image {k}" for k in range(len(rotations))]
    own = [f"camera of {name}" for name in names]
    turned = rotations * FLIP[:, None]
    centres = -(np.swapaxes(turned, 1, 2) @ (translations * FLIP)[:, :, None])[:, :, 0]
    point_names = [f"P{k}" for k in range(len(points))]
    block = BundleAdjustment()
    block.origin = Origin(str(path))
    block.add_cameras(
        *(
            Camera(name, 0, 0, float(f), np.zeros(2), (2, 0, 0), [k1, k2])
            for name, (f, k1, k2) in zip(own, interiors, strict=True)
        )
    )
    block.freeze_parameters("PP.")
    block.add_poses(Poses.of(names, centres, np.swapaxes(turned, 1, 2), cameras=own))
    block.add_approximations(point_names, points)
    image, point = np.asarray(index, dtype=np.int64).T
    block.add_measures(ImagePoints.packed(names, point_names, image, point, pixels * FLIP[:2]))
    return block


def write_bal(block: Block, path: str | Path) -> None:
    """Writes a block of pinholes with two radial terms as a BAL file (see `bal_text`)."""
    write_text(path, bal_text(block))


def bal_files(solution: BundleSolution, path: str | Path) -> dict[Path, str]:
    """The file of a solution."""
    return {Path(path): bal_text(solution.adjusted_block())}


def check_block(block: Block) -> None:
    """Refuses, before its adjustment, a block whose cameras BAL cannot hold."""
    check_cameras(block, "BAL", RADIAL)


def bal_text(block: Block) -> str:
    """A block of pinholes with two radial terms as BAL has it: pixels are about the principal points.

    Raises:
        InputError: a camera has another model, or other terms that are not zero; a point has no coordinates.
    """
    images = block.poses.images
    names = [name for part in block.sets for name in part.measures.point_names]
    points = list(dict.fromkeys(names))
    place = {name: k for k, name in enumerate(points)}
    number = {name: k for k, name in enumerate(images)}
    lines = []
    for part in block.sets:
        measures = part.measures
        for image, point, (x, y) in zip(measures.image, measures.point, measures.xy, strict=True):
            camera = block.cameras[block.camera_of[measures.image_names[image]]]
            dx, dy = (np.array([x, y]) - camera.principal_point) * FLIP[:2]
            pair = number[measures.image_names[image]], place[measures.point_names[point]]
            lines.append(f"{pair[0]} {pair[1]} {dx:.17g} {dy:.17g}")
    numbers = [*_camera_numbers(block, images), *_point_numbers(block, points)]
    first = f"{len(images)} {len(points)} {len(lines)}"
    return "\n".join([first, *lines, *(f"{value:.17g}" for value in numbers)]) + "\n"


def _camera_numbers(block: Block, images: Sequence[str]) -> FloatArray:
    poses = block.poses.select(images)
    turned = np.swapaxes(poses.rotations, 1, 2) * FLIP[:, None]
    moved = -(turned @ poses.centres[:, :, None])[:, :, 0]
    interiors = [_interior(block.cameras[block.camera_of[image]]) for image in images]
    return np.hstack([logarithm(turned), moved, np.array(interiors).reshape(-1, 3)]).ravel()


def _interior(camera: Camera) -> list[float]:
    """Focal length and the two radial terms of a camera that has no others."""
    check_camera(camera, "BAL", RADIAL)
    terms = dict(zip(camera.coefficient_names, camera.coefficients.tolist(), strict=True))
    return [camera.focal, *(terms.get(name, 0.0) for name in RADIAL)]


def _point_numbers(block: Block, points: Sequence[str]) -> FloatArray:
    known = {**block.approximations, **dict(zip(block.control.names, block.control.coordinates, strict=True))}
    missing = [name for name in points if name not in known]
    if missing:
        raise InputError(f"point {missing[0]}: it has no coordinates to write ({len(missing)} have none)")
    return np.array([known[name] for name in points]).ravel()
