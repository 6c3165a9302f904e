"""Projects that PhotoModeler exports as text: photos, cameras, control points, object points and marks.

A header of five lines, the fourth of which is the camera. Six lines a photo, each but the fourth
(covariances, which may be empty) after its number. Then control points, object points and marks, each ended
by an empty line. Marks have their sigmas in pixels, cameras and their formats are in millimetres.

What an export says of points is what was adjusted. So control points are known only where they were held. The
others are results with their precisions, and no observations of a new adjustment.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.blocks.reading import hold_all_but, new_block, note_count
from obseq.formats.dbat.reader import BrownCamera
from obseq.images.bundle import BundleAdjustment
from obseq.images.camera import Camera
from obseq.images.control import ControlPoints
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses
from obseq.reading.tables import text_of

HEADER, PHOTO = 5, 6
"""Lines of the header and of a photo."""
LISTS = ("control points", "object points", "marks")
INTERIOR = 10
"""Numbers of a camera."""
WINDOWS = "cp1252"
"""Encoding of paths with accents: PhotoModeler is a program of Windows."""
TERMS = ("F", "PPx", "PPy", "K1", "K2", "K3", "p1", "p2", "b1")
"""Our names of what it has."""


@dataclass(frozen=True)
class _Line:
    where: str
    text: str

    def words(self, least: int, first: int = 0) -> list[str]:
        """The fields from one on, which are at least so many finite numbers."""
        self.numbers(least, first)
        return self.text.split()[first:]

    def numbers(self, least: int, first: int = 0) -> list[float]:
        """The finite numbers from a field on, at least so many."""
        try:
            values = [float(word) for word in self.text.split()[first:]]
        except ValueError:
            values = []
        if len(values) < least or not np.isfinite(values).all():
            raise InputError(f"{self.where}: {least} numbers are expected, not {self.text[:60]!r}")
        return values


def read_photomodeler(
    path: str | Path, size: tuple[int, int] | None = None, mark_sigma: float | None = None
) -> BundleAdjustment:
    """The block of a text export.

    Photos are called as their files, without folders. Photos of one interior orientation share a camera.
    Control points are held where their sigmas are zero, or negative (as PhotoModeler marks them). Those with
    sigmas are places where points are about, and `datum_points` of the block: their sigmas are a posteriori.

    Args:
        path: the file.
        size: columns and lines of the images; needed when the second line of the file does not have them.
        mark_sigma: of marks that have none (pixels); None to leave them out.

    Raises:
        InputError: a line does not hold what it should; it is named.
    """
    lines = _lines(Path(path))
    head, photos, (control, objects, marks, *features) = lines[:HEADER], *_sections(Path(path), lines)
    words = head[1].numbers(2)
    columns, rows = size or (tuple(int(value) for value in words[2:4]) if len(words) > 3 else (0, 0))
    if min(columns, rows) < 1:
        raise InputError(f"{head[1].where}: the size of the images is missing; give it")
    with new_block(path) as block:
        if any(features):
            block.notes.append(f"{path}: lines and other features are not read")
        names = _add_photos(block, photos, head[3], (columns, rows))
        results = _add_points(block, control, objects)
        _add_marks(block, marks, names, mark_sigma)
        seen = Counter(line.text.split()[1] for line in marks)
        block.datum_points = tuple(name for name in results if seen[name] > 1)
    return block


def _lines(path: Path) -> list[_Line]:
    texts = text_of(path, WINDOWS).splitlines()
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


def _add_photos(
    block: BundleAdjustment, lines: list[_Line], head: _Line, size: tuple[int, int]
) -> dict[int, str]:
    """Names of images by number."""
    names: dict[int, str] = {}
    cameras: dict[tuple[float, ...], Camera] = {}
    centres, angles, owners = [], [], []
    for k in range(0, len(lines), PHOTO):
        number, file, pose, words = _photo(lines[k : k + PHOTO])
        interior = _exact(words, head)
        if interior not in cameras:
            cameras[interior] = _camera(f"camera {len(cameras) + 1}", interior, size, lines[k].where)
            block.add_cameras(cameras[interior])
        names[number] = file
        centres.append(pose[:3])
        angles.append([pose[5], pose[4], pose[3]])
        owners.append(cameras[interior].name)
    hold_all_but(block, dict.fromkeys(block.cameras, TERMS))
    block.add_poses(Poses.of(list(names.values()), centres, np.radians(angles), "opk", owners))
    return names


def _photo(lines: list[_Line]) -> tuple[int, str, list[float], list[str]]:
    """Number and file (its first line), pose (X Y Z kappa phi omega), interior orientation as written."""
    first = lines[0].text.split(maxsplit=1)
    if len(first) != 2 or not first[0].isdecimal():
        raise InputError(f"{lines[0].where}: a photo begins with its number and its file")
    file = first[1].strip('"').replace("\\", "/").rpartition("/")[2]
    pose, interior = (_after(first[0], lines[k], count) for k, count in ((1, 6), (4, INTERIOR)))
    return int(first[0]), file, [float(word) for word in pose], interior


def _after(number: str, line: _Line, count: int) -> list[str]:
    """The numbers of a line of a photo, after that of the photo."""
    if line.text.split()[:1] != [number]:
        raise InputError(f"{line.where}: a line of photo {number} begins with its number")
    return line.words(count, 1)[:count]


def _exact(words: list[str], head: _Line) -> tuple[float, ...]:
    """The interior orientation of a photo; of the fourth line, with its decimals, where that rounds to it."""
    own, given = [float(word) for word in words], head.text.split()
    try:
        exact = [float(word) for word in given]
    except ValueError:
        return tuple(own)
    if len(exact) != INTERIOR or not all(map(_agree, words, given)):
        return tuple(own)
    return tuple(
        b if _step(theirs) < _step(word) else a
        for a, b, word, theirs in zip(own, exact, words, given, strict=True)
    )


def _agree(one: str, other: str) -> bool:
    """Whether two texts are the same number, as far as the coarser one says it."""
    return abs(float(one) - float(other)) <= 0.5001 * max(_step(one), _step(other))


def _step(word: str) -> float:
    """What a number is written to multiples of."""
    digits, _, exponent = word.lower().partition("e")
    return float(10.0 ** (int(exponent or 0) - len(digits.partition(".")[2])))


def _camera(name: str, interior: tuple[float, ...], size: tuple[int, int], where: str) -> Camera:
    c, xp, yp, xs, ys, k1, k2, k3, p1, p2 = interior
    if not (c > 0.0 and xs > 0.0 and ys > 0.0):
        raise InputError(f"{where}: the camera constant and the format must be above zero")
    pixel, wide = ys / size[1], xs / size[0]
    brown = BrownCamera(name, size, pixel, c, (xp, yp), (k1, k2, k3), (p1, p2), wide / pixel)
    return brown.camera()


def _add_points(block: BundleAdjustment, control: list[_Line], objects: list[_Line]) -> list[str]:
    """Points that were held are known, others are about where the export has them; control among these."""
    given = {line.text.split()[0]: line.numbers(6, 1)[:6] for line in control}
    held = {name: row for name, row in given.items() if max(row[3:]) <= 0.0}
    results = [name for name in given if name not in held]
    if held:
        places = np.array([row[:3] for row in held.values()])
        block.add_control_points(ControlPoints.of(list(held), places, np.zeros_like(places)))
    note_count(
        block,
        results,
        "control points are no observations here: their lines hold what was adjusted, with a-posteriori "
        "sigmas; give what was known before in a table of control points",
    )
    free = {line.text.split()[0]: line.numbers(3, 1)[:3] for line in objects}
    free = {name: row[:3] for name, row in given.items()} | free
    names = [name for name in free if name not in held]
    block.add_approximations(names, np.array([free[name] for name in names]).reshape(-1, 3))
    return results


def _add_marks(
    block: BundleAdjustment, lines: list[_Line], names: dict[int, str], mark_sigma: float | None
) -> None:
    """Marks, and a note on those without sigma: SmartPoints have none, and numbers that others may have."""
    images, points, xy, sigmas, left_out = [], [], [], [], []
    for line in lines:
        photo, x, y, sx, sy = (*line.numbers(1)[:1], *line.numbers(4, 2)[:4])
        if int(photo) not in names:
            raise InputError(f"{line.where}: the photo {photo:g} is not there")
        point = line.text.split()[1]
        if min(sx, sy) <= 0.0:
            if mark_sigma is None:
                left_out.append(f"{point} in {names[int(photo)]}")
                continue
            sx = sy = mark_sigma
        images.append(names[int(photo)])
        points.append(point)
        xy.append([x, y])
        sigmas.append([sx, sy])
    note_count(
        block,
        left_out,
        "marks have no sigma and are left out (as SmartPoints, whose numbers may be those of other points)",
    )
    if left_out and not points:
        raise InputError(
            f"{lines[0].where}: the mark has no sigma, as those of SmartPoints, nor has any other; give one "
            "for them (--image-sigma)"
        )
    block.add_measures(
        ImagePoints.of(images, points, np.array(xy).reshape(-1, 2), np.array(sigmas).reshape(-1, 2)),
        name="marks",
    )
