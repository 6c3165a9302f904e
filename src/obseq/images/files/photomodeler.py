"""Projects that PhotoModeler exports as text: photos, cameras, control points, object points and marks.

Sections end with an empty line: photos with the header, control points, object points, marks.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.images.bundle import BundleAdjustment
from obseq.images.control import ControlPoints
from obseq.images.files.dbat import BrownCamera
from obseq.images.files.tables import text_of
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

if TYPE_CHECKING:
    from obseq.images.camera import Camera

HEADER, PHOTO = 5, 7
"""Lines of the header and of a photo."""


@dataclass(frozen=True)
class _Line:
    where: str
    text: str

    def numbers(self, least: int, first: int = 0) -> list[float]:
        """The finite numbers from a field on, at least so many."""
        try:
            values = [float(word) for word in self.text.split()[first:]]
        except ValueError:
            values = []
        if len(values) < least or not np.isfinite(values).all():
            raise InputError(f"{self.where}: {least} numbers are expected, not {self.text[:60]!r}")
        return values


def read_photomodeler(path: str | Path, size: tuple[int, int] | None = None) -> BundleAdjustment:
    """The block of a text export.

    Photos are called as their files, without folders. Photos of one interior orientation share a camera.
    Control points with sigmas of zero are held.

    Args:
        path: the file.
        size: columns and lines of the images; needed when the second line of the file does not have them.

    Raises:
        InputError: a line does not hold what it should; it is named.
    """
    sections = _sections(Path(path))
    head, photos = sections[0][:HEADER], sections[0][HEADER:]
    if len(sections) < 4 or len(head) < HEADER or len(photos) % PHOTO or not photos:
        raise InputError(
            f"{path}: four sections are expected: header and photos ({PHOTO} lines each), control points, "
            "object points, marks"
        )
    words = head[1].numbers(2)
    columns, rows = size or (tuple(int(value) for value in words[2:4]) if len(words) > 3 else (0, 0))
    if min(columns, rows) < 1:
        raise InputError(f"{head[1].where}: the size of the images is missing; give it")
    block = BundleAdjustment()
    names, pixels = _add_photos(block, photos, (columns, rows))
    _add_points(block, sections[1], sections[2])
    _add_marks(block, sections[3], names, pixels)
    return block


def _sections(path: Path) -> list[list[_Line]]:
    found: list[list[_Line]] = [[]]
    for number, line in enumerate(text_of(path).splitlines(), 1):
        if line.strip():
            found[-1].append(_Line(f"{path}:{number}", line.strip()))
        elif found[-1]:
            found.append([])
    return found if found[-1] else found[:-1]


def _add_photos(
    block: BundleAdjustment, lines: list[_Line], size: tuple[int, int]
) -> tuple[dict[int, str], dict[str, float]]:
    """Names of images by number, and the height of a pixel (mm) of each image."""
    names: dict[int, str] = {}
    pixels: dict[str, float] = {}
    cameras: dict[tuple[float, ...], Camera] = {}
    centres, angles, owners = [], [], []
    for k in range(0, len(lines), PHOTO):
        number, file, pose, interior = _photo(lines[k : k + PHOTO])
        if interior not in cameras:
            cameras[interior] = _camera(f"camera {len(cameras) + 1}", interior, size, lines[k].where)
            block.add_cameras(cameras[interior])
        names[number] = file
        pixels[file] = interior[4] / size[1]
        centres.append(pose[:3])
        angles.append([pose[5], pose[4], pose[3]])
        owners.append(cameras[interior].name)
    block.add_poses(Poses.of(list(names.values()), centres, np.radians(angles), "opk", owners))
    return names, pixels


def _photo(lines: list[_Line]) -> tuple[int, str, list[float], tuple[float, ...]]:
    """Number and file (its first line), pose (X Y Z kappa phi omega), interior orientation."""
    first = lines[0].text.split(maxsplit=1)
    if len(first) != 2 or not first[0].isdecimal():
        raise InputError(f"{lines[0].where}: a photo begins with its number and its file")
    file = first[1].strip('"').replace("\\", "/").rpartition("/")[2]
    return int(first[0]), file, lines[1].numbers(6)[:6], tuple(lines[4].numbers(10)[:10])


def _camera(name: str, interior: tuple[float, ...], size: tuple[int, int], where: str) -> Camera:
    c, xp, yp, xs, ys, k1, k2, k3, p1, p2 = interior
    if not (c > 0.0 and xs > 0.0 and ys > 0.0):
        raise InputError(f"{where}: the camera constant and the format must be above zero")
    pixel, wide = ys / size[1], xs / size[0]
    brown = BrownCamera(name, size, pixel, c, (xp, yp), (k1, k2, k3), (p1, p2), wide / pixel)
    return brown.camera()


def _add_points(block: BundleAdjustment, control: list[_Line], objects: list[_Line]) -> None:
    known = {line.text.split()[0]: line.numbers(6, 1) for line in control}
    if known:
        values = np.array([row[:6] for row in known.values()])
        block.add_control_points(ControlPoints.of(list(known), values[:, :3], values[:, 3:]))
    free = {line.text.split()[0]: line.numbers(3, 1)[:3] for line in objects}
    names = [name for name in free if name not in known]
    block.add_approximations(names, np.array([free[name] for name in names]).reshape(-1, 3))


def _add_marks(
    block: BundleAdjustment, lines: list[_Line], names: dict[int, str], pixels: dict[str, float]
) -> None:
    images, points, xy, sigmas = [], [], [], []
    for line in lines:
        photo, x, y, sx, sy = (*line.numbers(1)[:1], *line.numbers(4, 2)[:4])
        if int(photo) not in names:
            raise InputError(f"{line.where}: the photo {photo:g} is not there")
        images.append(names[int(photo)])
        points.append(line.text.split()[1])
        xy.append([x, y])
        sigmas.append([sx / pixels[images[-1]], sy / pixels[images[-1]]])
    block.add_measures(ImagePoints.of(images, points, np.array(xy), np.array(sigmas)), name="marks")
