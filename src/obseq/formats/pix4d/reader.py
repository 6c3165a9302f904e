"""Calibrated camera parameters of Pix4D: the interior of the camera and the pose of each image.

`m = K [R | -R t] X`: R goes from world to camera, x right, y down, z forward; t is the projection centre. The
distortion is OpenCV's. Image points are in none of its files: give them with `--measures`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block
from obseq.geometry import closest_rotation
from obseq.images.camera import Camera
from obseq.images.poses import Poses
from obseq.reading.tables import text_of

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.bundle import BundleAdjustment

FIRST = "fileName imageWidth imageHeight"
WIDTHS = (3, 3, 3, 3, 2, 3, 3, 3, 3)
"""Numbers in the lines below the name of an image: K, radial, tangential, t, R."""
TERMS = ("K1", "K2", "K3", "p2", "p1")
FREE = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2")
"""What Pix4D estimates of a camera."""
ORTHONORMAL = 1e-6
OFFSET = "offset.xyz"


def read_pix4d(path: str | Path) -> BundleAdjustment:
    """Cameras and poses; images of one calibration and size share a camera.

    Raises:
        InputError: the file is none, or broken; file and line are named.
    """
    place = Path(path)
    lines = [(n, line.split()) for n, line in enumerate(text_of(place).split("\n"), 1) if line.strip()]
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


def _image(place: Path, lines: list[tuple[int, list[str]]]) -> tuple[str, tuple[int, int], FloatArray]:
    """Name, size and 26 numbers of an image."""
    line, words = lines[0]
    if len(words) < 3 or not (words[-1].isdigit() and words[-2].isdigit()):
        raise InputError(f"{place}:{line}: an image begins with its name, width and height")
    values: list[float] = []
    for (number, fields), width in zip(lines[1:], WIDTHS, strict=True):
        try:
            found = [float(field) for field in fields]
        except ValueError:
            found = []
        if len(found) != width or not np.isfinite(found).all():
            raise InputError(f"{place}:{number}: {width} finite numbers are expected")
        values += found
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
