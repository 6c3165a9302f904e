"""COR files (Comp3D point files): reading (`read_cor`) and writing (`write_cor`).

A line is `flag name x y z [sx sy sz | s] [eta xi] [text]`; a `*` begins a comment. Coordinates are in the
units of their system, sigmas in metres, deflections of the vertical (eta east, xi north) in arc seconds; they
follow three sigmas, or directly the coordinates of a free point.

| flag | the point is |
|---|---|
| 0 | free; its coordinates are starting values |
| 1 | constrained in x, y, z |
| 2 | constrained in x, y; z free |
| 3 | constrained in z; x, y free |
| 4, 5 | Comp3D's 1D point: x, y held; z free (4) or constrained (5) |
| 6, 7 | Comp3D's 2D point: z held; x, y free (6) or constrained (7) |
| 8, 9 | the same, remote: no part of a datum of its own |

A constrained component with a sigma of 0 is held at its value; with a negative sigma its constraint is
switched off and the component is free. This is Comp3D's reading; MMVII has no such file.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from obseq.arguments import NOTHING, NUMBER, PATH, PATHS, TEXT, WORDS, expecting, instance
from obseq.errors import InputError
from obseq.formats.obs.after_sigma import checked_ignore
from obseq.formats.once import require_distinct
from obseq.reading.angles import SECOND
from obseq.reading.text import (
    LEAST_SIGMA,
    TextFile,
    check_default_sigma,
    check_writable,
    leading_numbers,
    quoted,
    read_text,
    words,
)
from obseq.survey.model import Points, merge_points
from obseq.writing import write_text

LARGEST_DEFLECTION = 600.0
"""Arc seconds; beyond it a deflection is a mistake."""
_FREE, _GIVEN, _HELD = "free", "given", "held"
_FLAGS = {
    0: (_FREE, _FREE, _FREE),
    1: (_GIVEN, _GIVEN, _GIVEN),
    2: (_GIVEN, _GIVEN, _FREE),
    3: (_FREE, _FREE, _GIVEN),
    4: (_HELD, _HELD, _FREE),
    5: (_HELD, _HELD, _GIVEN),
    6: (_FREE, _FREE, _HELD),
    7: (_GIVEN, _GIVEN, _HELD),
    8: (_FREE, _FREE, _HELD),
    9: (_GIVEN, _GIVEN, _HELD),
}
_KNOWN_FLAGS = frozenset(str(flag) for flag in _FLAGS)
_HELP = "flag name x y z [sx sy sz, or s] [eta xi]"
_NO_NUMBER = f"{{}} (fields are: {_HELP}; a name has no blanks)"
_FLAG_HELP = (
    "0 free, 1 known, 2 known in x y, 3 known in z, 4 and 5 heights only, 6 to 9 plane only; "
    "a comment begins with *"
)


class _Rest(NamedTuple):
    """What follows the coordinates of a line: none or three sigmas, a deflection (rad) or NaN, and text."""

    sigmas: tuple[float, ...]
    deflection: tuple[float, float]
    info: str


_NO_DEFLECTION = (math.nan, math.nan)
_NO_SIGMAS = (0.0, 0.0, 0.0)
_NO_REST = _Rest((), _NO_DEFLECTION, "")


@expecting(paths=PATHS, default_sigma=NUMBER | NOTHING, encoding=TEXT, ignore=WORDS)
def read_cor(
    paths: str | Path | Sequence[str | Path],
    default_sigma: float | None = None,
    encoding: str = "utf-8",
    ignore: Collection[str] = (),
) -> Points:
    """Reads COR files.

    Args:
        paths: one file, or several.
        default_sigma: sigma (m) of known points whose line gives none; without it they are an error.
        encoding: of the point names; comments may be in any encoding.
        ignore: "deflections" to leave them out.

    Raises:
        InputError: naming file and line, what is wrong and what to do; also for a point given twice.
    """
    if default_sigma is not None:
        check_default_sigma(default_sigma, "the default sigma of known points (--point-sigma, default_sigma)")
    files = [paths] if isinstance(paths, str | Path) else paths
    require_distinct(files)
    points = merge_points([_read_one(read_text(path, encoding), default_sigma) for path in files])
    if "deflections" in checked_ignore(ignore):
        return replace(points, deflections=np.full_like(points.deflections, np.nan))
    return points


def _read_one(file: TextFile, default_sigma: float | None) -> Points:
    columns = PointColumns(default_sigma)
    columns.open_file(file)
    for index, line in enumerate(file.lines):
        fields = words(line.partition("*")[0])
        if fields:
            columns.append(file, index, fields)
    if not len(columns):
        raise InputError(f"{file.name}: holds no point (every line is empty or a comment)")
    return columns.points()


class PointColumns:
    """Collects the points of one COR file after another."""

    def __init__(self, default_sigma: float | None = None) -> None:
        self._default_sigma = default_sigma
        self._files: list[str] = []
        self._names: list[str] = []
        self._coordinates: list[list[float]] = []
        self._sigmas: list[list[float]] = []
        self._rests: list[_Rest] = []
        self._places: list[tuple[int, int]] = []

    def __len__(self) -> int:
        return len(self._names)

    def open_file(self, file: TextFile) -> None:
        """A file whose lines follow."""
        self._files.append(file.name)

    def append(self, file: TextFile, index: int, fields: list[str]) -> None:
        """Adds the point of line `index` (from 0) of an open file.

        Raises:
            InputError: the line is not what it must be; the message names it.
        """
        flag = _flag(file, index, fields)
        file.check_name(index, fields[1])
        rest = _rest(file, index, fields[5:], _GIVEN in _FLAGS[flag])
        self._names.append(fields[1])
        self._coordinates.append([_number(file, index, text) for text in fields[2:5]])
        self._sigmas.append(_sigmas(file, index, flag, rest.sigmas, self._default_sigma))
        self._rests.append(rest)
        self._places.append((self._files.index(file.name), index + 1))

    def points(self) -> Points:
        """Everything read.

        Raises:
            InputError: a name occurs twice.
        """
        n = len(self)
        places = np.array(self._places, np.int32).reshape(n, 2)
        points = Points(
            names=tuple(self._names),
            coordinates=np.array(self._coordinates, np.float64).reshape(n, 3),
            sigmas=np.array(self._sigmas, np.float64).reshape(n, 3),
            deflections=np.array([rest.deflection for rest in self._rests], np.float64).reshape(n, 2),
            infos=tuple(rest.info for rest in self._rests),
            files=tuple(self._files),
            file_indices=places[:, 0],
            lines=places[:, 1],
        )
        return merge_points([points])


def _flag(file: TextFile, index: int, fields: list[str]) -> int:
    flag = int(fields[0]) if fields[0] in _KNOWN_FLAGS else None
    if flag is None:
        raise file.error(
            index, f"unknown flag {quoted(fields[0])!r}; a line begins with a flag: {_FLAG_HELP}"
        )
    if len(fields) < 5:
        raise file.error(index, f"{len(fields)} fields where at least 5 are needed: {_HELP}")
    return flag


def _number(file: TextFile, index: int, text: str) -> float:
    return file.number(index, text, _NO_NUMBER)


def _rest(file: TextFile, index: int, fields: list[str], is_known: bool) -> _Rest:
    """The numbers after the coordinates, by how many they are, and the text after them."""
    if not fields:
        return _NO_REST
    numbers = leading_numbers(fields, lambda text: _number(file, index, text))
    info = quoted(" ".join(fields[len(numbers) :])) if len(numbers) < len(fields) else ""
    if len(numbers) == 2 and not is_known:
        return _Rest((), _deflection(file, index, numbers), info)
    if len(numbers) == 2:
        raise file.error(
            index, "two sigmas are given where one (for x, y, z) or three are needed; a name has no blanks"
        )
    if len(numbers) not in (0, 1, 3, 5):
        raise file.error(
            index,
            f"{len(numbers)} numbers after the coordinates, where one or three sigmas may stand, and after "
            "three "
            "the deflections eta xi; a name has no blanks, and a remark begins with *",
        )
    sigmas = tuple(numbers * 3 if len(numbers) == 1 else numbers[:3])
    if any(0.0 < sigma < LEAST_SIGMA for sigma in sigmas):
        raise file.error(index, "the sigma makes the weight infinite; give 0 to hold the coordinate")
    deflection = _deflection(file, index, numbers[3:]) if len(numbers) == 5 else _NO_DEFLECTION
    return _Rest(sigmas, deflection, info)


def _deflection(file: TextFile, index: int, seconds: list[float]) -> tuple[float, float]:
    east, north = seconds
    if max(abs(east), abs(north)) > LARGEST_DEFLECTION:
        raise file.error(
            index,
            f"a deflection of the vertical of {east:g} {north:g} arc seconds is beyond "
            f"{LARGEST_DEFLECTION:g}; "
            "correct it, or begin a remark with *",
        )
    return east * SECOND, north * SECOND


def _sigmas(
    file: TextFile, index: int, flag: int, given: tuple[float, ...], default_sigma: float | None
) -> list[float]:
    kinds = _FLAGS[flag]
    if _GIVEN in kinds and not given:
        if default_sigma is None:
            raise file.error(
                index,
                "a known point without sigma; add sx sy sz (m) to the line, or give the sigma of all such "
                "points (--point-sigma, default_sigma)",
            )
        given = (default_sigma,) * 3
    return [_sigma(*pair) for pair in zip(kinds, given or _NO_SIGMAS, strict=True)]


def _sigma(kind: str, given: float) -> float:
    """NaN for free, 0 for held."""
    if kind == _HELD:
        return 0.0
    return math.nan if kind == _FREE or given < 0.0 else given


@expecting(path=PATH, points=instance(Points), header=TEXT)
def write_cor(path: str | Path, points: Points, header: str = "") -> None:
    """Writes points as a COR file that `read_cor` gives back; free components get a sigma of -1.

    Args:
        path: the file to write.
        points: all with coordinates.
        header: comment lines put first (without `*`).

    Raises:
        InputError: a point has no coordinates, a name cannot be written, or the file cannot be written.
    """
    write_text(path, cor_text(points, header))


def cor_text(points: Points, header: str = "") -> str:
    """The text of a COR file, as `write_cor` writes it.

    Raises:
        InputError: a point has no coordinates, or a name cannot be written.
    """
    lines = [f"* {line}" for line in header.splitlines()]
    lines += [_cor_line(points, row) for row in range(len(points))]
    return "\n".join(lines) + "\n"


def _cor_line(points: Points, row: int) -> str:
    name, xyz, sigmas = points.names[row], points.coordinates[row], points.sigmas[row]
    check_writable(name)
    if not np.isfinite(xyz).all():
        if np.isfinite(xyz).any():
            known = " and ".join(axis for axis, value in zip("xyz", xyz, strict=True) if np.isfinite(value))
            raise InputError(f"point {name} has {known} only, which a COR file cannot say; write .csv")
        raise InputError(f"point {name} has no coordinates; leave it out of the COR file")
    start = " ".join([name, *(repr(float(value)) for value in xyz)])
    plumb = points.deflections[row] / SECOND
    deflection = [] if np.isnan(plumb).any() else [f"{seconds:.9g}" for seconds in plumb]
    if np.isnan(sigmas).all():
        return " ".join(["0", start, *deflection])
    spreads = ("-1" if np.isnan(s) else repr(float(s)) for s in sigmas)
    return " ".join(["1", start, *spreads, *deflection])
