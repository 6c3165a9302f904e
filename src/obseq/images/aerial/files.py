"""Text files of aerial work, in Borea's formats: shots (OPK), cameras, points in images and on the ground.

Columns are blank-separated; a header string names them, one letter each (S skips one). Empty lines and lines
that begin with # are passed over. A first line without any number where numbers belong is a title.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.aerial.heights import HeightType
from obseq.images.aerial.result_columns import LeftOut
from obseq.images.aerial.shots import FrameCamera, Shots, axes_of, unit_of
from obseq.reading.text import parse_number, read_text

SHOTS, IMAGE_POINTS, GROUND_POINTS = "NXYZOPKC", "PNXY", "PTXYZ"
"""The usual headers."""


class BadLine(NamedTuple):
    """A line that was left out.

    Attributes:
        number: of the line, from 1.
        reason: what is wrong with it.
    """

    number: int
    reason: str


@dataclass(frozen=True)
class ImagePoints:
    """Points measured in images, in columns.

    Attributes:
        names: of the points, one per measure.
        shots: name of the image of each measure.
        pixels: (m, 2) column and line.
        lines: (m,) line of the file, from 1.
        bad: lines that were left out.
        file: its name.
    """

    names: tuple[str, ...]
    shots: tuple[str, ...]
    pixels: FloatArray
    lines: IntArray
    bad: tuple[BadLine, ...] = ()
    file: str = ""

    def where(self, row: int) -> str:
        """File and line of a measure."""
        return f"{self.file}:{self.lines[row]}"

    def left_out(self) -> list[LeftOut]:
        """The lines that could not be read, for a table."""
        return [LeftOut(f"{self.file}:{line.number}", line.reason) for line in self.bad]


@dataclass(frozen=True)
class GroundPoints:
    """Points known on the ground, in columns.

    Attributes:
        names: of the points.
        codes: type of each (1, 11: known in z; 2, 12: in plan; 3, 13: both), or empty strings.
        coordinates: (n, 3) map coordinates and z.
        height_type: what z is counted from.
        bad: lines that were left out.
        file: its name.
    """

    names: tuple[str, ...]
    codes: tuple[str, ...]
    coordinates: FloatArray
    height_type: HeightType | None
    bad: tuple[BadLine, ...] = ()
    file: str = ""

    def left_out(self) -> list[LeftOut]:
        """The lines that could not be read, for a table."""
        return [LeftOut(f"{self.file}:{line.number}", line.reason) for line in self.bad]


def read_shots(
    path: str | Path,
    header: str = SHOTS,
    *,
    interval: tuple[int | None, int | None] = (None, None),
    unit: str = "degree",
    order: str = "opk",
    has_alteration: bool = True,
    keep_good: bool = False,
) -> tuple[Shots, tuple[BadLine, ...]]:
    """The shots of an OPK file, and the lines that were left out.

    Args:
        path: the file.
        header: its columns: N name, X Y, Z altitude or H height, O P K angles, C camera, S skipped.
        interval: first line read (from 1) and first line not read any more.
        unit: of the angles: degree, gon or radian.
        order: of the rotations; the i-th angle goes with the i-th letter.
        has_alteration: whether z carries the linear alteration of the map (IGN's custom).
        keep_good: leave out bad lines and list them, instead of refusing the file.

    Raises:
        InputError: with file and line.
    """
    axes_of(order)
    scale = unit_of(unit)
    columns = Columns.of(header, "NXYOPKC", "NXYOPKC", has_z=True)
    rows, lines, bad = _rows(path, columns, interval, keep_good=keep_good)
    rows, bad = _unique(path, rows, lines, bad, keep_good=keep_good)
    angles = scale * np.array([[row[letter] for letter in "OPK"] for row in rows], dtype=np.float64)
    places = np.array([[row[letter] for letter in "XYZ"] for row in rows], dtype=np.float64)
    shots = Shots.from_angles(
        [str(row["N"]) for row in rows],
        places,
        angles,
        [str(row["C"]) for row in rows],
        order=order,
        height_type=columns.height_type,
        has_alteration=has_alteration,
    )
    return shots, bad


def read_camera(path: str | Path) -> FrameCamera:
    """The camera of a file of lines ``key = value``: name, ppax, ppay, focal, width, height (pixels).

    Raises:
        InputError: with file and line; a key that is missing or given twice.
    """
    text = read_text(path)
    found: dict[str, str] = {}
    for index, line in enumerate(text.lines):
        key, equals, value = (part.strip() for part in line.partition("="))
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not equals:
            raise text.error(index, "is not 'key = value'")
        if key.lower() in found:
            raise text.error(index, f"{key} is given twice")
        found[key.lower()] = value
    return _camera(str(path), found)


def read_image_points(
    path: str | Path, header: str = IMAGE_POINTS, *, keep_good: bool = False
) -> ImagePoints:
    """Measures of points in images: P point, N shot, X column, Y line, S skipped.

    Raises:
        InputError: with file and line; the same point twice in an image.
    """
    columns = Columns.of(header, "PNXY", "PNXY", has_z=False)
    rows, lines, bad = _rows(path, columns, keep_good=keep_good)
    keys = [(row["P"], row["N"]) for row in rows]
    rows, lines, bad = _once(path, keys, rows, lines, bad, keep_good=keep_good)
    pixels = np.array([[row["X"], row["Y"]] for row in rows], dtype=np.float64).reshape(-1, 2)
    return ImagePoints(
        tuple(str(row["P"]) for row in rows),
        tuple(str(row["N"]) for row in rows),
        pixels,
        np.array(lines, dtype=np.int64),
        bad,
        str(path),
    )


def read_ground_points(
    path: str | Path, header: str = GROUND_POINTS, *, keep_good: bool = False
) -> GroundPoints:
    """Points on the ground: P point, T type, X Y, Z altitude or H height, S skipped (N is passed over).

    Raises:
        InputError: with file and line; a point given twice.
    """
    columns = Columns.of(header, "PXY", "PTNXY", has_z=True)
    rows, lines, bad = _rows(path, columns, keep_good=keep_good)
    rows, lines, bad = _once(path, [row["P"] for row in rows], rows, lines, bad, keep_good=keep_good)
    places = np.array([[row[letter] for letter in "XYZ"] for row in rows], dtype=np.float64).reshape(-1, 3)
    return GroundPoints(
        tuple(str(row["P"]) for row in rows),
        tuple(str(row.get("T", "")) for row in rows),
        places,
        columns.height_type,
        bad,
        str(path),
    )


def shots_text(shots: Shots, header: str = SHOTS, *, unit: str = "degree", order: str = "opk") -> str:
    """An OPK file of shots, sorted by name, with a title; Z or H in the title as the shots have it.

    Raises:
        InputError: if the header asks for another type of z than that of the shots.
    """
    columns = Columns.of(header, "NXYOPKC", "NXYOPKC", has_z=True)
    if shots.height_type is not None and columns.height_type is not shots.height_type:
        raise InputError(f"header {header!r}: the z of the shots is of type {shots.height_type.value}.")
    angles = shots.angles(order) / unit_of(unit)
    lines = ["   ".join(columns.letters)]
    for row in np.argsort(np.array(shots.names)):
        values = dict(zip("XYZ", shots.positions[row], strict=True)) | dict(
            zip("OPK", angles[row], strict=True)
        )
        words = {letter: repr(float(value)) for letter, value in values.items()}
        words |= {"N": shots.names[row], "C": shots.cameras[row], "H": words["Z"]}
        lines.append("   ".join(words[letter] for letter in columns.letters))
    return "\n".join(lines) + "\n"


_Row = dict[str, "str | float"]


def _rows(
    path: str | Path,
    columns: Columns,
    interval: tuple[int | None, int | None] = (None, None),
    *,
    keep_good: bool,
) -> tuple[list[_Row], list[int], tuple[BadLine, ...]]:
    """The lines of a file by letter, their numbers, and what was left out."""
    text = read_text(path)
    first, last = interval[0] or 1, interval[1] or len(text.lines) + 1
    rows, lines, bad = [], [], []
    for number in range(first, min(last, len(text.lines) + 1)):
        line = text.lines[number - 1]
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if keep_good and number == first and columns.is_title(line):
            continue
        try:
            rows.append(columns.read(line))
            lines.append(number)
        except ValueError as error:
            if not keep_good:
                raise text.error(number - 1, f"{error}{_title_hint(columns, number, line)}") from None
            bad.append(BadLine(number, str(error)))
    return rows, lines, tuple(bad)


def _title_hint(columns: Columns, number: int, line: str) -> str:
    is_title = number == 1 and columns.is_title(line)
    return "; is it a title? begin at line 2" if is_title else ""


def _once(
    path: str | Path,
    keys: Sequence[object],
    rows: list[_Row],
    lines: list[int],
    bad: tuple[BadLine, ...],
    *,
    keep_good: bool,
) -> tuple[list[_Row], list[int], tuple[BadLine, ...]]:
    """The rows whose key comes for the first time; the others are bad."""
    seen: dict[object, int] = {}
    kept, repeated = [], []
    for index, (key, line) in enumerate(zip(keys, lines, strict=True)):
        if key in seen:
            what = " ".join(map(str, key)) if isinstance(key, tuple) else str(key)
            repeated.append(BadLine(line, f"{what} was given before, in line {seen[key]}"))
        else:
            seen[key] = line
            kept.append(index)
    if repeated and not keep_good:
        raise InputError(f"{path}:{repeated[0].number}: {repeated[0].reason}")
    chosen = [rows[index] for index in kept]
    return chosen, [lines[index] for index in kept], tuple(sorted((*bad, *repeated)))


def _unique(
    path: str | Path, rows: list[_Row], lines: list[int], bad: tuple[BadLine, ...], *, keep_good: bool
) -> tuple[list[_Row], tuple[BadLine, ...]]:
    kept, _, all_bad = _once(path, [row["N"] for row in rows], rows, lines, bad, keep_good=keep_good)
    return kept, all_bad


def _camera(path: str, found: dict[str, str]) -> FrameCamera:
    missing = [key for key in ("name", "ppax", "ppay", "focal") if not found.get(key)]
    if missing:
        raise InputError(f"{path}: the camera lacks {', '.join(missing)}")
    column, line, focal = (_number(path, found, key, parse_number) for key in ("ppax", "ppay", "focal"))
    if "width" not in found or "height" not in found:
        return FrameCamera(found["name"], (column, line), focal)
    width, height = (int(_number(path, found, key, _whole)) for key in ("width", "height"))
    return FrameCamera(found["name"], (column, line), focal, (width, height))


def _number(path: str, found: dict[str, str], key: str, parse: Callable[[str], float]) -> float:
    try:
        return parse(found[key])
    except ValueError as error:
        raise InputError(f"{path}: {key}: {error}") from None


def _whole(text: str) -> float:
    value = parse_number(text)
    if value != int(value) or value <= 0:
        raise ValueError(f"{text!r} is not a positive whole number of pixels")
    return value


_Z_TYPES = {"Z": HeightType.ALTITUDE, "H": HeightType.HEIGHT}
_NUMBERS = frozenset("XYZHOPK")


@dataclass(frozen=True)
class Columns:
    """What the columns of a file mean.

    Attributes:
        letters: one per column.
    """

    letters: str

    @classmethod
    def of(cls, header: str, needed: str, allowed: str, *, has_z: bool) -> Columns:
        """The columns of a header string.

        Raises:
            InputError: an unknown letter, one that is missing or given twice, or both Z and H.
        """
        known = set(allowed) | {"S"} | (set(_Z_TYPES) if has_z else set())
        for letter in header:
            if letter not in known:
                raise InputError(
                    f"header {header!r}: {letter!r} has no meaning here; letters are {_listed(known)}."
                )
            if letter != "S" and header.count(letter) > 1:
                raise InputError(f"header {header!r}: {letter} stands twice.")
        missing = [letter for letter in needed if letter not in header]
        if missing:
            raise InputError(f"header {header!r}: {_listed(missing)} missing.")
        if has_z and sum(letter in header for letter in _Z_TYPES) != 1:
            raise InputError(f"header {header!r}: needs Z (altitude) or H (ellipsoidal height), one of them.")
        return cls(header)

    @property
    def height_type(self) -> HeightType | None:
        """Altitude for Z, height for H."""
        return next((kind for letter, kind in _Z_TYPES.items() if letter in self.letters), None)

    def read(self, line: str) -> dict[str, str | float]:
        """The fields of a line by letter, z under Z.

        Raises:
            ValueError: with the reason.
        """
        words = line.split()
        if len(words) != len(self.letters):
            raise ValueError(
                f"has {len(words)} columns, the header {self.letters!r} names {len(self.letters)}"
            )
        found: dict[str, str | float] = {}
        for letter, word in zip(self.letters, words, strict=True):
            if letter != "S":
                found["Z" if letter == "H" else letter] = self._value(letter, word)
        return found

    def _value(self, letter: str, word: str) -> str | float:
        is_angle_letter = "N" in self.letters and "C" in self.letters
        if letter not in _NUMBERS or (letter == "P" and not is_angle_letter):
            return word
        return parse_number(word)

    def is_title(self, line: str) -> bool:
        """Whether no column that should hold a number does."""
        words = line.split()
        return len(words) == len(self.letters) and not any(_is_number(word) for word in words)


def _is_number(word: str) -> bool:
    try:
        parse_number(word)
    except ValueError:
        return False
    return True


def _listed(letters: Iterable[str]) -> str:
    return ", ".join(sorted(letters))
