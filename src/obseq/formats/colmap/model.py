"""What a sparse model of COLMAP holds, as text or binary, before it becomes a block."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.colmap.models import MODELS
from obseq.reading.tables import text_of
from obseq.reading.text import counted, read_bytes

NOTHING = 2**64 - 1
NAMED = re.compile(r"# point (\d{1,18}) is called (\S.*?)\s*$")


FILES = ("cameras", "images", "points3D")
"""What a model is."""


@dataclass(frozen=True)
class ColmapCamera:
    """A camera: its model, size and parameters, and where it stands for messages."""

    model: str
    size: tuple[int, int]
    parameters: tuple[float, ...]
    where: str


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """An image.

    Attributes:
        name: of its file.
        camera: number of its camera.
        quaternion: (4,) world to camera, scalar first.
        shift: (3,) world to camera.
        xy: (n, 2) pixels of the features that have a point.
        points: (n,) numbers of those points.
        where: file, and line where it has lines.
        number: of the image.
    """

    name: str
    camera: int
    quaternion: FloatArray
    shift: FloatArray
    xy: FloatArray
    points: tuple[int, ...]
    where: str
    number: int

    def __post_init__(self) -> None:
        largest = float(np.abs(self.quaternion).max(initial=0.0))
        if not 1e-100 < largest < 1e100:
            raise InputError(f"{self.where}: image {self.name}: {self.quaternion.tolist()} is no rotation")


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """Cameras and points by number, images in the order of the file; points that comments call by a name."""

    cameras: dict[int, ColmapCamera]
    images: list[ColmapImage]
    points: dict[int, tuple[float, float, float]]
    names: dict[int, str]


def read_model(folder: Path) -> ColmapModel:
    """The model of a folder; binary files win where both are there, as in COLMAP.

    Raises:
        InputError: a file is missing, cut short, or holds what it should not.
    """
    lacking = {
        form: [f"{name}.{form}" for name in FILES if not (folder / f"{name}.{form}").is_file()]
        for form in ("bin", "txt")
    }
    if all(lacking.values()) and folder.is_dir():
        which = ", ".join(lacking["bin"] if len(lacking["bin"]) <= len(lacking["txt"]) else lacking["txt"])
        raise InputError(
            f"{folder}: {which} not there: a model is {', '.join(FILES)}, all as .bin or as .txt"
        )
    try:
        return _text(folder) if lacking["bin"] else _binary(folder)
    except InputError as error:
        raise InputError(str(error) if str(folder) in str(error) else f"{folder}: {error}") from None


def _text(folder: Path) -> ColmapModel:
    cameras = dict(_text_cameras(folder / "cameras.txt"))
    images = list(_text_images(folder / "images.txt"))
    path = folder / "points3D.txt"
    points: dict[int, tuple[float, float, float]] = {}
    for number, fields in lines(path):
        x, y, z = floats(path, number, fields[1:4], 3)
        points[whole(path, number, fields[0])] = (x, y, z)
    return ColmapModel(cameras, images, points, _names(path))


def _names(path: Path) -> dict[int, str]:
    """Names of points in comments, as they are written here."""
    found = (NAMED.match(line) for line in text_of(path).splitlines() if line.startswith("#"))
    return {int(match[1]): match[2] for match in found if match}


def _text_cameras(path: Path) -> Iterator[tuple[int, ColmapCamera]]:
    for line, fields in lines(path):
        if len(fields) < 5 or fields[1] not in MODELS or len(fields) != 4 + MODELS[fields[1]]:
            raise InputError(
                f"{path}:{line}: a camera is: number, model, width, height, parameters; the models "
                f"known here are {', '.join(MODELS)}"
            )
        size = (whole(path, line, fields[2]), whole(path, line, fields[3]))
        values = tuple(floats(path, line, fields[4:], len(fields) - 4))
        yield whole(path, line, fields[0]), ColmapCamera(fields[1], size, values, f"{path}:{line}")


def _text_images(path: Path) -> Iterator[ColmapImage]:
    rows = [
        (number, line.split())
        for number, line in enumerate(counted(path, text_of(path).splitlines()), 1)
        if not line.startswith("#")
    ]
    if len(rows) % 2 and rows and not rows[-1][1]:
        rows.pop()
    if len(rows) % 2:
        raise InputError(f"{path}: an image takes two lines, the second of which may be empty")
    for (number, first), (below, second) in zip(rows[::2], rows[1::2], strict=True):
        if len(first) < 10 or len(second) % 3:
            raise InputError(f"{path}:{number}: an image is: number, qw qx qy qz, tx ty tz, camera, name")
        values = np.array(floats(path, number, first[1:8], 7))
        features = np.array(floats(path, below, second, len(second))).reshape(-1, 3)
        used = [k for k in range(len(features)) if second[3 * k + 2] != "-1"]
        points = tuple(whole(path, below, second[3 * k + 2]) for k in used)
        camera, number_of = whole(path, number, first[8]), whole(path, number, first[0])
        where = f"{path}:{number}"
        found = camera, values[:4], values[4:], features[used, :2], points
        yield ColmapImage(" ".join(first[9:]), *found, where, number_of)


def lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The words of the lines of a text that are no comments."""
    for number, line in enumerate(counted(path, text_of(path).splitlines()), 1):
        if line.strip() and not line.startswith("#"):
            yield number, line.split()


def whole(path: Path, line: int, word: str) -> int:
    """The whole number that a word is."""
    if not (word.isascii() and word.isdigit() and len(word) < 21):
        raise InputError(f"{path}:{line}: {word[:40]!r} is no whole number")
    return int(word)


def floats(path: Path, line: int, fields: list[str], count: int) -> list[float]:
    """So many finite numbers."""
    try:
        values = [float(field) for field in fields]
    except ValueError as error:
        raise InputError(f"{path}:{line}: {error}") from None
    if len(values) != count:
        raise InputError(f"{path}:{line}: {count} numbers are expected, not {len(values)}")
    if not np.isfinite(values).all():
        raise InputError(f"{path}:{line}: a number is not finite")
    return values


class Bytes:
    """A binary file that is read from its beginning to its end."""

    def __init__(self, path: Path) -> None:
        self.data = read_bytes(path)
        self.path, self.place = path, 0

    def take(self, form: str) -> tuple[int | float, ...]:
        """Numbers in the notation of `struct`, little-endian."""
        size = struct.calcsize(f"<{form}")
        self._require(size)
        found = struct.unpack_from(f"<{form}", self.data, self.place)
        self.place += size
        if any(isinstance(value, float) and not np.isfinite(value) for value in found):
            raise InputError(f"{self.path}: byte {self.place - size}: a number is not finite")
        return found

    def whole(self, form: str) -> int:
        """One whole number."""
        return int(self.take(form)[0])

    def rows(self, count: int, kind: list[tuple[str, str]]) -> np.ndarray[tuple[int], np.dtype[np.void]]:
        """Rows of fields."""
        layout = np.dtype(kind)
        self._require(count * layout.itemsize)
        found = np.frombuffer(self.data, layout, count, self.place)
        self.place += count * layout.itemsize
        return found

    def text(self) -> str:
        """A text that ends in a zero byte."""
        end = self.data.find(b"\0", self.place)
        if end < 0:
            raise InputError(f"{self.path}: byte {self.place}: a name has no end; the file is cut short")
        found = self.data[self.place : end]
        self.place = end + 1
        try:
            return found.decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(f"{self.path}: byte {self.place}: a name is not in UTF-8") from None

    def finish(self) -> None:
        """Refuses what is left over."""
        if self.place != len(self.data):
            raise InputError(f"{self.path}: {len(self.data) - self.place} bytes are left over: corrupted")

    def _require(self, size: int) -> None:
        if size > len(self.data) - self.place:
            raise InputError(f"{self.path}: is cut short at byte {len(self.data)}")


def _binary(folder: Path) -> ColmapModel:
    cameras = dict(_binary_cameras(Bytes(folder / "cameras.bin")))
    images = list(_binary_images(Bytes(folder / "images.bin")))
    points = dict(_binary_points(Bytes(folder / "points3D.bin")))
    return ColmapModel(cameras, images, points, {})


def _binary_cameras(file: Bytes) -> Iterator[tuple[int, ColmapCamera]]:
    names = list(MODELS)
    for _ in range(file.whole("Q")):
        number, model, width, height = (int(value) for value in file.take("IiQQ"))
        if not 0 <= model < len(names):
            raise InputError(f"{file.path}: camera {number} has an unknown model, {model}")
        values = file.take(f"{MODELS[names[model]]}d")
        where = f"{file.path}: camera {number}"
        yield number, ColmapCamera(names[model], (width, height), tuple(map(float, values)), where)
    file.finish()


def _binary_images(file: Bytes) -> Iterator[ColmapImage]:
    for _ in range(file.whole("Q")):
        number_of = file.whole("I")
        values = np.array(file.take("7d"))
        camera, name = file.whole("I"), file.text()
        rows = file.rows(file.whole("Q"), [("x", "<f8"), ("y", "<f8"), ("point", "<u8")])
        used = rows[rows["point"] != NOTHING]
        xy = np.column_stack([used["x"], used["y"]])
        if not np.isfinite(xy).all():
            raise InputError(f"{file.path}: image {name}: a pixel is not finite")
        points = tuple(used["point"].tolist())
        yield ColmapImage(name, camera, values[:4], values[4:], xy, points, str(file.path), number_of)
    file.finish()


def _binary_points(file: Bytes) -> Iterator[tuple[int, tuple[float, float, float]]]:
    for _ in range(file.whole("Q")):
        number, x, y, z = file.take("Q3d")
        file.take("3B")
        file.rows(1, [("error", "<f8")])
        file.rows(file.whole("Q"), [("image", "<u4"), ("place", "<u4")])
        yield int(number), (float(x), float(y), float(z))
    file.finish()
