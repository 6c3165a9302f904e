"""Tie points in files: MMVII's pairs and tracks, MicMac v1's `Homol` folders (text and binary), and CSV."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NoReturn

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.images import ImagePoints
from obseq.reading.text import read_bytes

PAIR_HEADER = "x1,y1,x2,y2"
TRACK_HEADER = "Pt.x,Pt.y,Id"
TRACKS, TRACKS_ENDING = "PMUL-", ".csv"
BINARY = ".dmp"
_BINARY_POINT = struct.Struct("<i5d")
_BINARY_HEADER = struct.Struct("<ii")
_FEWEST, _MOST = 4, 5


def read_pairs(path: str | Path) -> FloatArray:
    """Points (n, 4) seen by two images: x1, y1, x2, y2.

    Takes MMVII's CSV (``x1,y1,x2,y2``), MicMac's text (``x1 y1 x2 y2 [weight]``) and binary ``.dat`` files,
    told apart by what they hold.

    Raises:
        InputError: absent, empty, corrupted; with file and line for text.
    """
    place = Path(path)
    if place.suffix == BINARY:
        _refuse_binary(place)
    data = read_bytes(place)
    if b"\0" in data:
        return _binary(place, data)
    return _text(place, data)


def find_pairs(folder: str | Path, first: str, second: str) -> FloatArray:
    """Points (n, 4) of two images in a folder of ties: MMVII's ``TieP/<Folder>`` or MicMac's ``Homol<SH>``.

    The other way round serves too: columns are then exchanged.

    Raises:
        InputError: there is no file for the two images.
    """
    for one, other in ((first, second), (second, first)):
        for candidate in _names(Path(folder), one, other):
            if candidate.is_file():
                found = read_pairs(candidate)
                return found if one == first else found[:, [2, 3, 0, 1]]
    raise InputError(f"{folder}: holds no tie points of {first} and {second}")


def read_tracks(folder: str | Path) -> ImagePoints:
    """The multiple tie points of a folder ``MulTieP/<Folder>``: one ``PMUL-<image>.csv`` per image.

    Raises:
        InputError: no such file, or a line that is wrong.
    """
    files = sorted(Path(folder).glob(f"{TRACKS}*{TRACKS_ENDING}"))
    for binary in sorted(Path(folder).glob(f"{TRACKS}*{BINARY}")):
        if not binary.with_suffix(TRACKS_ENDING).is_file():
            _refuse_binary(binary)
    if not files:
        raise InputError(f"{folder}: holds no tie points ({TRACKS}<image>.csv)")
    images, names, pixels = [], [], []
    for path in files:
        image = path.name[len(TRACKS) : -len(TRACKS_ENDING)]
        lines = _lines(path, read_bytes(path))
        if not lines or lines[0].replace(" ", "") != TRACK_HEADER:
            raise InputError(f"{path}:1: the first line should be {TRACK_HEADER}")
        rows = _numbers(path, lines[1:], 2, (3, 3))
        images += [image] * len(rows)
        names += [str(int(number)) for number in rows[:, 2]]
        pixels.append(rows[:, :2])
    return ImagePoints.of(images, names, np.concatenate(pixels))


def _refuse_binary(path: Path) -> NoReturn:
    raise InputError(
        f"{path}: MMVII's binary tie points ({BINARY}) are not read; write them as CSV (vector format csv in "
        "the profile of MMVII)"
    )


def pairs_text(pairs: FloatArray) -> str:
    """MMVII's CSV of points (n, 4)."""
    rows = "".join(",".join(repr(float(value)) for value in row) + "\n" for row in pairs)
    return f"{PAIR_HEADER}\n{rows}"


def _names(folder: Path, one: str, other: str) -> list[Path]:
    return [
        folder / one / f"{other}.csv",
        folder / one / f"{other}{BINARY}",
        *(folder / f"Pastis{one}" / f"{other}{ending}" for ending in (".dat", ".txt")),
    ]


def _text(path: Path, data: bytes) -> FloatArray:
    lines = _lines(path, data)
    first = 1 if lines and lines[0].replace(" ", "") == PAIR_HEADER else 0
    return _numbers(path, lines[first:], first + 1, (_FEWEST, _MOST))[:, :4]


def _lines(path: Path, data: bytes) -> list[str]:
    try:
        return data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{path}: is neither text nor a file of tie points") from None


def _numbers(path: Path, lines: list[str], number: int, columns: tuple[int, int]) -> FloatArray:
    """The numbers of lines; the first has this number in the file."""
    rows = []
    for index, line in enumerate(lines, number):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise InputError(f"{path}:{index}: {line.strip()[:80]!r} holds what is no number") from None
        if not (columns[0] <= len(values) <= columns[1] and np.isfinite(values).all()):
            raise InputError(f"{path}:{index}: needs {columns[0]} finite numbers, not {line.strip()[:80]!r}")
        rows.append(values[: columns[0]])
    return np.array(rows, dtype=np.float64).reshape(-1, columns[0])


def _binary(path: Path, data: bytes) -> FloatArray:
    """MicMac's ``.dat``: dimension, number of pairs, then per pair 2, a weight and four coordinates."""
    if len(data) < _BINARY_HEADER.size:
        raise InputError(f"{path}: is cut short in its header")
    dimension, count = _BINARY_HEADER.unpack_from(data)
    size = _BINARY_POINT.size
    if dimension != 2 or count < 0:
        raise InputError(f"{path}: is not a file of tie points: dimension {dimension}, {count} pairs")
    if len(data) != _BINARY_HEADER.size + count * size:
        room = (len(data) - _BINARY_HEADER.size) / size
        raise InputError(f"{path}: announces {count} pairs and has room for {room:g}: corrupted")
    rows = np.array(list(_BINARY_POINT.iter_unpack(data[_BINARY_HEADER.size :]))).reshape(-1, 6)
    wrong = np.flatnonzero((rows[:, 0] != 2) | ~np.isfinite(rows).all(axis=1))
    if wrong.size:
        raise InputError(f"{path}: pair {wrong[0] + 1} is not of two finite points: corrupted")
    return np.ascontiguousarray(rows[:, 2:])
