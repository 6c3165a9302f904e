"""Projects that PhotoModeler exports as text: photos, cameras, control points, object points and marks.

A header of five lines; six lines a photo, each but the fourth (covariances, which may be empty) after its
number; then control points, object points and marks. Each of these ends with an empty line. Marks have their
sigmas in pixels, cameras and their formats are in millimetres.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.dbat.reader import BrownCamera
from obseq.images.bundle import BundleAdjustment
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.origin import Origin
from obseq.reading.tables import text_of

if TYPE_CHECKING:
    from obseq.images.camera import Camera

HEADER, PHOTO = 5, 6
"""Lines of the header and of a photo."""
LISTS = ("control points", "object points", "marks")


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
    Control points are held where their sigmas are zero, or negative (as PhotoModeler marks them).

    Args:
        path: the file.
        size: columns and lines of the images; needed when the second line of the file does not have them.

    Raises:
        InputError: a line does not hold what it should; it is named.
    """
    lines = _lines(Path(path))
    head, photos, (control, objects, marks, *features) = lines[:HEADER], *_sections(Path(path), lines)
    words = head[1].numbers(2)
    columns, rows = size or (tuple(int(value) for value in words[2:4]) if len(words) > 3 else (0, 0))
    if min(columns, rows) < 1:
        raise InputError(f"{head[1].where}: the size of the images is missing; give it")
    block = BundleAdjustment()
    block.origin = Origin(str(path))
    names = _add_photos(block, photos, (columns, rows))
    _add_points(block, control, objects)
    _add_marks(block, marks, names)
    if any(features):
        block.notes.append(f"{path}: lines and other features are not read")
    return block


def _lines(path: Path) -> list[_Line]:
    texts = text_of(path).splitlines()
    return [_Line(f"{path}:{number}", line.strip()) for number, line in enumerate(texts, 1)]


def _sections(path: Path, lines: list[_Line]) -> tuple[list[_Line], list[list[_Line]]]:
    """The lines of all photos, and the lists after them, without the empty lines that end them."""
    at = HEADER
    while at < len(lines) and lines[at].text:
        at += PHOTO
    photos = lines[HEADER:at]
    if not photos or len(photos) % PHOTO or at >= len(lines):
        raise InputError(
            f"{path}: a header of {HEADER} lines, {PHOTO} lines for each photo and an empty line are expected"
        )
    found: list[list[_Line]] = [[]]
    for line in lines[at + 1 :]:
        if line.text:
            found[-1].append(line)
        else:
            found.append([])
    if len(found) < len(LISTS):
        raise InputError(f"{path}: {', '.join(LISTS)} are expected, each ended by an empty line")
    return photos, found


def _add_photos(block: BundleAdjustment, lines: list[_Line], size: tuple[int, int]) -> dict[int, str]:
    """Names of images by number."""
    names: dict[int, str] = {}
    cameras: dict[tuple[float, ...], Camera] = {}
    centres, angles, owners = [], [], []
    for k in range(0, len(lines), PHOTO):
        number, file, pose, interior = _photo(lines[k : k + PHOTO])
        if interior not in cameras:
            cameras[interior] = _camera(f"camera {len(cameras) + 1}", interior, size, lines[k].where)
            block.add_cameras(cameras[interior])
        names[number] = file
        centres.append(pose[:3])
        angles.append([pose[5], pose[4], pose[3]])
        owners.append(cameras[interior].name)
    block.add_poses(Poses.of(list(names.values()), centres, np.radians(angles), "opk", owners))
    return names


def _photo(lines: list[_Line]) -> tuple[int, str, list[float], tuple[float, ...]]:
    """Number and file (its first line), pose (X Y Z kappa phi omega), interior orientation."""
    first = lines[0].text.split(maxsplit=1)
    if len(first) != 2 or not first[0].isdecimal():
        raise InputError(f"{lines[0].where}: a photo begins with its number and its file")
    file = first[1].strip('"').replace("\\", "/").rpartition("/")[2]
    pose, interior = (_after(first[0], lines[k], count) for k, count in ((1, 6), (4, 10)))
    return int(first[0]), file, pose, tuple(interior)


def _after(number: str, line: _Line, count: int) -> list[float]:
    """The numbers of a line of a photo, after that of the photo."""
    if line.text.split()[:1] != [number]:
        raise InputError(f"{line.where}: a line of photo {number} begins with its number")
    return line.numbers(count, 1)[:count]


def _camera(name: str, interior: tuple[float, ...], size: tuple[int, int], where: str) -> Camera:
    c, xp, yp, xs, ys, k1, k2, k3, p1, p2 = interior
    if not (c > 0.0 and xs > 0.0 and ys > 0.0):
        raise InputError(f"{where}: the camera constant and the format must be above zero")
    pixel, wide = ys / size[1], xs / size[0]
    brown = BrownCamera(name, size, pixel, c, (xp, yp), (k1, k2, k3), (p1, p2), wide / pixel)
    return brown.camera()


def _add_points(block: BundleAdjustment, control: list[_Line], objects: list[_Line]) -> None:
    """Control points, held where their sigmas are not above zero; places of the other points."""
    known = {line.text.split()[0]: line.numbers(6, 1) for line in control}
    if known:
        values = np.array([row[:6] for row in known.values()])
        sigmas = np.maximum(values[:, 3:], 0.0)
        block.add_control_points(ControlPoints.of(list(known), values[:, :3], sigmas))
    free = {line.text.split()[0]: line.numbers(3, 1)[:3] for line in objects}
    names = [name for name in free if name not in known]
    block.add_approximations(names, np.array([free[name] for name in names]).reshape(-1, 3))


def _add_marks(block: BundleAdjustment, lines: list[_Line], names: dict[int, str]) -> None:
    images, points, xy, sigmas = [], [], [], []
    for line in lines:
        photo, x, y, sx, sy = (*line.numbers(1)[:1], *line.numbers(4, 2)[:4])
        if int(photo) not in names:
            raise InputError(f"{line.where}: the photo {photo:g} is not there")
        if min(sx, sy) <= 0.0:
            raise InputError(
                f"{line.where}: the mark has no sigma, as those of SmartPoints, whose numbers may be "
                "those of other points; export the project without them"
            )
        images.append(names[int(photo)])
        points.append(line.text.split()[1])
        xy.append([x, y])
        sigmas.append([sx, sy])
    block.add_measures(
        ImagePoints.of(images, points, np.array(xy).reshape(-1, 2), np.array(sigmas).reshape(-1, 2)),
        name="marks",
    )
