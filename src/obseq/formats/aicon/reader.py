"""Blocks of AICON 3D Studio in its text files: `.obc` points, `.eor` poses, `.ior` cameras, `.phc` measures.

Millimetres and radians, blanks between fields, # for comments. Cameras look along -z, y up; the distortion
acts on what the camera constant gives, with a zero crossing r0 of its radial part; image coordinates are from
the middle of the sensor, y up.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, naming
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.formats.fitted import fitted_camera
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.origin import Origin
from obseq.reading.tables import text_of

TERMS = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2", "b1", "b2")
"""Our names of what its cameras have."""
ENDINGS = (".obc", ".eor", ".ior", ".phc")


@dataclass(frozen=True)
class _Line:
    """The fields of a line, and where it stands."""

    where: str
    fields: list[str]

    def number(self, place: int) -> float:
        try:
            value = float(self.fields[place])
        except (ValueError, IndexError):
            value = np.nan
        if not np.isfinite(value):
            raise InputError(f"{self.where}: field {place + 1} should be a number")
        return value

    def numbers(self, start: int, count: int) -> list[float]:
        return [self.number(place) for place in range(start, start + count)]

    def require(self, count: int, what: str) -> None:
        if len(self.fields) < count:
            raise InputError(f"{self.where}: {len(self.fields)} fields; {what}")


def read_aicon(folder: str | Path, image_sigma: float) -> tuple[BundleAdjustment, tuple[str, ...]]:
    """The block of a folder, and the points of its datum (inner constraints), empty when none is marked.

    Args:
        folder: with one file of each ending, and scale bars (`.scl` or `.dis`) where there are some.
        image_sigma: of the image coordinates, pixels: sigmas in the files are those of the target operator.

    Raises:
        InputError: a file is missing or broken, or holds what is not read; with file and line.
    """
    place = Path(folder)
    with new_block(folder) as block:
        cameras = _cameras(_file(place, ".ior"))
        block.add_cameras(*(camera for camera, _ in cameras.values()))
        hold_all_but(block, {camera.name: TERMS for camera, _ in cameras.values()})
        poses, owner, off = _poses(_file(place, ".eor"), cameras)
        note_count(block, off, "images are not active, or not oriented, and are left out")
        block.add_poses(poses)
        names, places, datum, inactive = _points(_file(place, ".obc"))
        note_count(block, inactive, "points are not active and are left out")
        block.add_approximations(names, places)
        _add_measures(block, _file(place, ".phc"), cameras, owner, inactive, image_sigma)
        for ending in (".scl", ".dis"):
            for path in sorted(place.glob(f"*{ending}")):
                _add_scale(block, path)
        block.datum_points = tuple(datum)
    return block, block.datum_points


def _file(folder: Path, ending: str) -> Path:
    found = sorted(folder.glob(f"*{ending}")) if folder.is_dir() else []
    if len(found) != 1:
        raise InputError(
            f"{folder}: {len(found)} files end in {ending}; one of each of {', '.join(ENDINGS)} is needed"
        )
    return found[0]


def _lines(path: Path) -> list[_Line]:
    found = [
        _Line(f"{path}:{number}", line.partition("#")[0].split())
        for number, line in enumerate(text_of(path).splitlines(), 1)
    ]
    return [line for line in found if line.fields]


def _cameras(path: Path) -> dict[str, tuple[Camera, FloatArray]]:
    """Cameras, and columns and lines per millimetre, by their numbers: five lines each."""
    lines = _lines(path)
    if not lines or len(lines) % 5:
        raise InputError(f"{path}: a camera takes five lines; there are {len(lines)}")
    return dict(_camera(lines[k : k + 5]) for k in range(0, len(lines), 5))


def _camera(lines: list[_Line]) -> tuple[str, tuple[Camera, FloatArray]]:
    first, second, third, fourth, last = lines
    first.require(8, "a camera begins with: number, -, -c, xh, yh, A1, A2, r0")
    constant, xh, yh, a1, a2, r0 = first.numbers(2, 6)
    a3 = second.number(0)
    (b1, b2), (c1, c2) = third.numbers(0, 2), fourth.numbers(0, 2)
    width, height, columns, rows = last.numbers(0, 4)
    c = -constant
    if not (c > 0.0 and min(width, height) > 0.0 and min(columns, rows) >= 1.0):
        raise InputError(
            f"{first.where}: the camera constant is negative in such files, sizes are above zero"
        )
    scale = np.array([columns / width, rows / height])
    size = (int(columns), int(rows))

    def project(plane: FloatArray) -> FloatArray:
        x, y = c * plane[:, 0], -c * plane[:, 1]
        square = x**2 + y**2
        radial = a1 * (square - r0**2) + a2 * (square**2 - r0**4) + a3 * (square**3 - r0**6)
        u = xh + x * (1.0 + radial) + b1 * (square + 2 * x**2) + 2 * b2 * x * y + c1 * x + c2 * y
        v = yh + y * (1.0 + radial) + b2 * (square + 2 * y**2) + 2 * b1 * x * y
        return np.column_stack([size[0] / 2.0 + u * scale[0], size[1] / 2.0 - v * scale[1]])

    name = first.fields[0]
    with naming(first.where):
        return name, (fitted_camera(name, size, c * scale[1], project), scale)


def _poses(
    path: Path, cameras: dict[str, tuple[Camera, FloatArray]]
) -> tuple[Poses, dict[str, str], list[str]]:
    """Poses of the active, oriented images, the camera of each, and the names of the others."""
    names: list[str] = []
    others: list[str] = []
    centres, angles = [], []
    owner: dict[str, str] = {}
    for line in _lines(path):
        line.require(11, "an image is: name, camera, X0 Y0 Z0, omega phi kappa, order, active, status")
        name, camera = line.fields[:2]
        if camera not in cameras:
            raise InputError(f"{line.where}: the camera {camera} is not in the .ior file")
        if line.number(8) != 0.0:
            raise InputError(f"{line.where}: the order of rotations {line.fields[8]}: only 0 is read")
        if line.number(9) == 0.0 or line.number(10) == 1.0:
            others.append(name)
            continue
        owner[name] = camera
        names.append(name)
        centres.append(line.numbers(2, 3))
        angles.append(line.numbers(5, 3))
    return Poses.of(names, centres, angles, "opk", [owner[name] for name in names]), owner, others


def _points(path: Path) -> tuple[list[str], FloatArray, list[str], list[str]]:
    """Names and places of points, the names of the datum, and of those that are switched off."""
    names, places, datum, inactive = [], [], [], []
    for line in _lines(path):
        line.require(11, "a point is: name, X Y Z, sX sY sZ, rays, active, new, datum")
        if line.number(8) == 0.0:
            inactive.append(line.fields[0])
            continue
        names.append(line.fields[0])
        places.append(line.numbers(1, 3))
        if line.number(10) != 0.0:
            datum.append(line.fields[0])
    return names, np.array(places, dtype=np.float64).reshape(-1, 3), datum, inactive


def _add_measures(
    block: BundleAdjustment,
    path: Path,
    cameras: dict[str, tuple[Camera, FloatArray]],
    owner: dict[str, str],
    inactive: Collection[str],
    sigma: float,
) -> None:
    images, points, pixels, off = [], [], [], []
    without = set(inactive)
    for line in _lines(path):
        line.require(10, "a measure is: image, point, x y, sx sy, vx vy, method, active")
        image, point = line.fields[:2]
        if line.number(9) <= 0.0 or image not in owner or point in without:
            off.append(f"{point} in {image}")
            continue
        camera, scale = cameras[owner[image]]
        x, y = line.numbers(2, 2)
        images.append(image)
        points.append(point)
        pixels.append([camera.width / 2.0 + x * scale[0], camera.height / 2.0 - y * scale[1]])
    note_count(block, off, "measures are not active, or of an image or a point that is not")
    with naming(path):
        measures = ImagePoints.of(images, points, np.array(pixels).reshape(-1, 2), sigma)
        block.add_measures(measures, name=path.name, origin=Origin(str(path)))


def _add_scale(block: BundleAdjustment, path: Path) -> None:
    off = []
    for line in _lines(path):
        line.require(7, 'a scale bar is: number, "name", point, point, length, sigma, active')
        first, second = line.fields[-5:-3]
        length, sigma, active = line.numbers(len(line.fields) - 3, 3)
        if active > 0.0:
            block.add_length(first, second, length, sigma)
        else:
            off.append(f"{first} - {second}")
    note_count(block, off, f"scale bars of {path.name} are not active")
