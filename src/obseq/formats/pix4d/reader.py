"""Calibrated camera parameters of Pix4D: the interior of the camera and the pose of each image.

`m = K [R | -R t] X`: R goes from world to camera, x right, y down, z forward; t is the projection centre. The
distortion is OpenCV's. A file of matrices (`pmatrix`) has the product, a line an image, for images without
distortion. Image points are in none of its files: give them with `--measures`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.linalg import rq

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block
from obseq.geometry import closest_rotation
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.poses import Poses
from obseq.reading.tables import text_of

FIRST = "fileName imageWidth imageHeight"
WIDTHS = (3, 3, 3, 3, 2, 3, 3, 3, 3)
"""Numbers in the lines below the name of an image: K, radial, tangential, t, R."""
TERMS = ("K1", "K2", "K3", "p2", "p1")
FREE = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2")
"""What Pix4D estimates of a camera."""
ORTHONORMAL = 1e-6
MATRIX = 12
"""Numbers of a projection matrix."""
ALIKE = 1e-6
"""Relative difference of the matrices of one camera: their digits."""
OFFSET = "offset.xyz"


def read_pix4d(path: str | Path) -> BundleAdjustment:
    """Cameras and poses of a file of parameters, or of matrices; images of one calibration share a camera.

    Raises:
        InputError: the file is none, or broken; file and line are named.
    """
    place = Path(path)
    lines = [(n, line.split()) for n, line in enumerate(text_of(place).split("\n"), 1) if line.strip()]
    if lines and all(len(words) > MATRIX and words[0] != FIRST.split()[0] for _, words in lines):
        return _of_matrices(place, lines)
    if not lines or " ".join(lines[0][1]) != FIRST:
        raise InputError(f"{place}:1: calibrated camera parameters begin with {FIRST!r}")
    start = next((k for k, (_, words) in enumerate(lines) if "model" in words), 0) + 1
    body = lines[start:]
    step = len(WIDTHS) + 1
    if not body or len(body) % step:
        raise InputError(f"{place}: an image takes {step} lines; the file is cut short")
    with new_block(path) as block:
        cameras: dict[tuple[float, ...], Camera] = {}
        names, centres, rotations, owners = [], [], [], []
        for k in range(0, len(body), step):
            name, size, values = _image(place, body[k : k + step])
            interior = (*size, *values[:14].tolist())
            if interior not in cameras:
                cameras[interior] = _camera(place, body[k][0], f"camera {len(cameras) + 1}", size, values)
            names.append(name)
            centres.append(values[14:17])
            rotations.append(_rotation(place, body[k][0], values[17:].reshape(3, 3)))
            owners.append(cameras[interior].name)
        block.add_cameras(*cameras.values())
        hold_all_but(block, {camera.name: FREE for camera in cameras.values()})
        block.add_poses(Poses.of(names, np.array(centres), rotations, cameras=owners))
        offsets = [other.name for other in place.parent.glob(f"*{OFFSET}")]
        if offsets:
            block.notes.append(f"{offsets[0]}: positions are from this offset, which is not added")
    return block


def _of_matrices(place: Path, lines: list[tuple[int, list[str]]]) -> BundleAdjustment:
    """Cameras and poses of projection matrices; images whose interior is one have one camera."""
    with new_block(place) as block:
        cameras: list[Camera] = []
        names, centres, rotations, owners = [], [], [], []
        for line, words in lines:
            matrix = np.array(_finite(place, line, words[-MATRIX:], MATRIX)).reshape(3, 4)
            interior, rotation = _parts(place, line, matrix)
            mine = next((one for one in cameras if _is_of(one, interior)), None)
            if mine is None:
                middle = interior[:2, 2]
                size = (0, 0)  # nowhere in the file
                mine = Camera(f"camera {len(cameras) + 1}", *size, float(interior[0, 0]), middle, (0, 0, 0))
                cameras.append(mine)
            names.append(" ".join(words[:-MATRIX]))
            centres.append(-np.linalg.solve(matrix[:, :3], matrix[:, 3]))
            rotations.append(rotation)
            owners.append(mine.name)
        block.add_cameras(*cameras)
        hold_all_but(block, {camera.name: FREE[:3] for camera in cameras})
        block.add_poses(Poses.of(names, np.array(centres), rotations, cameras=owners))
        block.notes.append(f"{place}: matrices are of images without distortion, and so are image points")
    return block


def _is_of(camera: Camera, interior: FloatArray) -> bool:
    known = np.array([camera.focal, *camera.principal_point])
    return bool(np.abs(known - [interior[0, 0], *interior[:2, 2]]).max() <= ALIKE * camera.focal)


def _parts(place: Path, line: int, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The interior, whose last number is 1, and the rotation from camera to world, of a matrix."""
    if abs(np.linalg.det(matrix[:, :3])) < 1e-12:
        raise InputError(f"{place}:{line}: a projection matrix has an inverse")
    upper, turn = rq(matrix[:, :3])
    signs = np.sign(np.diag(upper))
    upper, turn = upper * signs, turn * signs[:, None]
    if np.linalg.det(turn) < 0.0:
        turn = -turn
    upper = upper / upper[2, 2]
    if abs(upper[0, 1]) > ALIKE * upper[0, 0] or abs(upper[0, 0] / upper[1, 1] - 1.0) > ALIKE:
        raise InputError(f"{place}:{line}: the matrix of a camera has one focal length and no shear here")
    return upper, closest_rotation(turn.T)


def _finite(place: Path, line: int, fields: list[str], count: int) -> list[float]:
    """So many finite numbers."""
    try:
        found = [float(field) for field in fields]
    except ValueError:
        found = []
    if len(found) != count or not np.isfinite(found).all():
        raise InputError(f"{place}:{line}: {count} finite numbers are expected")
    return found


def _image(place: Path, lines: list[tuple[int, list[str]]]) -> tuple[str, tuple[int, int], FloatArray]:
    """Name, size and 26 numbers of an image."""
    line, words = lines[0]
    if len(words) < 3 or not (words[-1].isdigit() and words[-2].isdigit()):
        raise InputError(f"{place}:{line}: an image begins with its name, width and height")
    values: list[float] = []
    for (number, fields), width in zip(lines[1:], WIDTHS, strict=True):
        values += _finite(place, number, fields, width)
    return " ".join(words[:-2]), (int(words[-2]), int(words[-1])), np.array(values)


def _camera(place: Path, line: int, name: str, size: tuple[int, int], values: FloatArray) -> Camera:
    matrix, terms = values[:9].reshape(3, 3), values[9:14].tolist()
    if matrix[0, 0] != matrix[1, 1] or matrix[0, 1] or not (matrix[2] == [0.0, 0.0, 1.0]).all():
        raise InputError(f"{place}:{line}: the matrix of a camera has one focal length and no shear here")
    given = dict(zip(TERMS, terms, strict=True))
    return Camera(name, *size, float(matrix[0, 0]), matrix[:2, 2], (3, 1, 1), given)


def _rotation(place: Path, line: int, matrix: FloatArray) -> FloatArray:
    """From camera to world."""
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(matrix) < 0.0:
        raise InputError(f"{place}:{line}: R is no rotation")
    return closest_rotation(matrix.T)
