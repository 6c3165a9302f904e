"""Field books of Leica (GSI-8, GSI-16): set-ups, directions, zenith angles, distances, heights of both ends.

A line holds words of 16 or 24 characters: two digits that say what it is, four of which the last is the unit,
a sign, and 8 or 16 characters. A block begins with the number of its point (11) or a code (41). A block with
the coordinates of the station (84, 85), or its name (16), sets the instrument up. Where a file has neither, a
code with a name (42) and a height (43) does it, as many code lists have it. Coordinates are first values.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.formats.default_sigmas import lacking
from obseq.formats.project import Project
from obseq.formats.stochastic import NAME_OF, StochasticModel
from obseq.printable import listed
from obseq.reading.text import read_text
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.lengths import DIST, DIST_HZ
from obseq.survey.model import Orientation, points_of_lines

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from obseq.formats.project import Reading
    from obseq.reading.text import TextFile
    from obseq.survey.kinds.kind import ObservationKind

SHORT, LONG = 16, 24
"""Characters of a word of GSI-8 and GSI-16, the blank after it included."""
POINT, STATION, CODE, NAME, HEIGHT = "11", "16", "41", "42", "43"
HORIZONTAL, VERTICAL, SLOPE, FLAT = "21", "22", "31", "32"
TARGET, PLACE = ("81", "82", "83"), ("84", "85", "86")
TARGET_HEIGHT, INSTRUMENT_HEIGHT = "87", "88"
FOOT = 0.3048
LENGTHS = {"0": 1e-3, "1": FOOT * 1e-3, "6": 1e-4, "7": FOOT * 1e-4, "8": 1e-5}
"""Metres in the last digit of a length, by its unit."""
ANGLES = {"2": math.pi / 200.0 * 1e-5, "3": math.pi / 180.0 * 1e-5, "5": math.pi / 3200.0 * 1e-4}
"""Radians in the last digit of an angle, by its unit."""
SEXAGESIMAL = "4"
"""Unit of angles that are written dddmmss, and a tenth of a second."""
SECOND = math.pi / 648_000.0
SHOWN = 5
_WORD = re.compile(r"(\d\d)([0-9.]{3})([0-9.])([+-])(.+)")


class _Word(NamedTuple):
    """A word: its unit, and what it holds with its sign."""

    unit: str
    sign: str
    text: str


class _Block(NamedTuple):
    """Words by number, and the line (from 0) that the block begins in."""

    line: int
    words: dict[str, _Word]


def read_gsi(paths: tuple[Path, ...], reading: Reading) -> Project:
    """Reads field books, one after the other.

    Args:
        paths: The files.
        reading: How to read them; `sigmas` are the standard deviations of their observations.

    Raises:
        InputError: Naming file and line, what is wrong and what to do.
    """
    book = _FieldBook(StochasticModel(reading.sigmas, reading.instruments))
    for path in paths:
        book.read(read_text(path, reading.encoding))
    return book.project()


class _FieldBook:
    """Set-ups and sights, block by block."""

    def __init__(self, model: StochasticModel) -> None:
        self._columns, self._model, self._given = Columns(), model, model.of("")
        self._places: dict[str, tuple[float, float, float]] = {}
        self._lines: dict[str, int] = {}
        self._by_code: list[str] = []
        self._idle: list[str] = []

    def read(self, file: TextFile) -> None:
        """Takes all blocks of a file; a set-up ends with it."""
        self._file, self._number = file, self._columns.open_file(file)
        self._station, self._origin = -1, -1
        self._from_height = self._to_height = 0.0
        blocks = list(_blocks(file))
        self._has_stations = any(map(_is_station, blocks))
        for block in blocks:
            self._take(block)

    def _take(self, block: _Block) -> None:
        words = block.words
        if INSTRUMENT_HEIGHT in words:
            self._from_height = self._length(block, INSTRUMENT_HEIGHT)
        if TARGET_HEIGHT in words:
            self._to_height = self._length(block, TARGET_HEIGHT)
        if CODE in words:
            if NAME in words and HEIGHT in words and not self._has_stations:
                self._by_code.append(_name(words[NAME]))
                self._set_up(block, _name(words[NAME]))
                height = words[HEIGHT]._replace(unit="0")  # codes have no units: millimetres
                self._from_height = self._length(block._replace(words={HEIGHT: height}), HEIGHT)
            return
        if STATION in words and HORIZONTAL not in words:
            self._set_up(block, _name(words[STATION]))
        if POINT not in words:
            return
        name = _name(words[POINT])
        if _is_station(block):
            self._keep(block, name, PLACE)
            self._set_up(block, name)
        elif HORIZONTAL in words or VERTICAL in words:
            self._sight(block, name)
        if TARGET[0] in words and TARGET[1] in words:
            self._keep(block, name, TARGET)

    def _set_up(self, block: _Block, name: str) -> None:
        """The instrument stands on a point now, with a circle of its own."""
        self._origin = self._columns.point(self._file, block.line, name)
        self._station = self._columns.open_station(self._origin, Orientation.VERT)

    def _keep(self, block: _Block, name: str, axes: tuple[str, str, str]) -> None:
        """First values of a point; those of its first block count."""
        x, y, z = (self._length(block, axis) if axis in block.words else math.nan for axis in axes)
        self._places.setdefault(name, (x, y, z))
        self._lines.setdefault(name, block.line + 1)

    def _sight(self, block: _Block, name: str) -> None:
        """The observations of a block."""
        if self._origin < 0:
            raise self._file.error(
                block.line,
                "nothing before this sight says where the instrument stands: a block with the coordinates of "
                "the station (84, 85), its name (16), or a code (41) with its name (42) and height (43)",
            )
        target = self._columns.point(self._file, block.line, name)
        if target == self._origin:
            self._idle.append(f"{self._file.name}:{block.line + 1}")
            return
        words = block.words
        if HORIZONTAL in words:
            self._add(block, HZ, target, self._angle(block, HORIZONTAL))
        if VERTICAL in words:
            self._add(block, ZEN, target, self._angle(block, VERTICAL))
        kind, word = (DIST, SLOPE) if SLOPE in words else (DIST_HZ, FLAT)
        length = self._length(block, word) if word in words else 0.0
        if length > 0.0:
            self._add(block, kind, target, length)

    def _add(self, block: _Block, kind: ObservationKind, target: int, value: float) -> None:
        name = NAME_OF[kind]
        problem = lacking(name, self._given)
        if problem:
            raise self._file.error(block.line, f"{kind.words}: {problem}")
        heights = (self._from_height, self._to_height) if kind in (ZEN, DIST) else (0.0, 0.0)
        relative = self._given.get("distance-ppm", 0.0) if name == "distance" else 0.0
        station = self._station if kind.needs_station else -1
        measure = Measure(
            kind, self._origin, target, value, self._given[name], True, relative, *heights, station=station
        )
        self._columns.append(measure, self._number, block.line)

    def _length(self, block: _Block, word: str) -> float:
        """A length in metres."""
        found = block.words[word]
        if found.unit not in LENGTHS:
            raise self._file.error(block.line, f"word {word}: {found.unit!r} is no unit of lengths")
        return self._digits(block, word) * LENGTHS[found.unit]

    def _angle(self, block: _Block, word: str) -> float:
        """An angle in radians."""
        found = block.words[word]
        if found.unit in ANGLES:
            return self._digits(block, word) * ANGLES[found.unit]
        if found.unit != SEXAGESIMAL:
            raise self._file.error(block.line, f"word {word}: {found.unit!r} is no unit of angles")
        tenths = abs(int(self._digits(block, word)))
        degrees, minutes, seconds = tenths // 100_000, tenths // 1000 % 100, tenths % 1000 / 10.0
        if minutes >= 60 or seconds >= 60.0:
            raise self._file.error(block.line, f"word {word}: minutes and seconds are below 60")
        return math.copysign(degrees * 3600 + minutes * 60 + seconds, self._digits(block, word)) * SECOND

    def _digits(self, block: _Block, word: str) -> float:
        found = block.words[word]
        if not (found.text.isascii() and found.text.isdigit()):
            raise self._file.error(block.line, f"word {word}: {found.text[:20]!r} is no whole number")
        return float(f"{found.sign}{int(found.text)}")

    def project(self) -> Project:
        """The network, once all files are read."""
        if not len(self._columns):
            raise InputError(f"{', '.join(self._columns.files)}: no sight is in it (words 21 and 22)")
        names = list(dict.fromkeys([*self._places, *self._columns.names]))
        unknown = (math.nan, math.nan, math.nan)
        places = np.array([self._places.get(name, unknown) for name in names]).reshape(-1, 3)
        free, file = np.full_like(places, np.nan), self._columns.files[0]
        points = points_of_lines(names, places, free, file, self._lines)
        book = self._columns.field_book()
        return Project(
            points,
            replace(book, warnings=(*book.warnings, *self._told())),
            stochastic=self._model,
            centred=tuple(range(len(self._columns))),
        )

    def _told(self) -> Iterator[str]:
        files = ", ".join(self._columns.files)
        if self._by_code:
            yield (
                f"{files}: {len(self._by_code)} codes with a name (42) and a height (43) are set-ups here: "
                f"{listed(self._by_code, SHOWN)}"
            )
        if self._places:
            yield f"{files}: coordinates of {len(self._places)} points are first values, no known ones"
        if self._idle:
            idle = listed(self._idle, SHOWN)
            yield f"{files}: {len(self._idle)} sights of a station to itself are left out: {idle}"


def _is_station(block: _Block) -> bool:
    """Whether a block says by its words where the instrument stands."""
    words = block.words
    return HORIZONTAL not in words and (STATION in words or {*PLACE[:2]} <= words.keys())


def _blocks(file: TextFile) -> Iterator[_Block]:
    """The blocks of a file; several may stand in a line."""
    for index, line in enumerate(file.lines):
        words: dict[str, _Word] = {}
        for number, word in _words(file, index, line):
            if number in (POINT, CODE) and words:
                yield _Block(index, words)
                words = {}
            words.setdefault(number, word)
        if words:
            yield _Block(index, words)


def _words(file: TextFile, index: int, line: str) -> Iterator[tuple[str, _Word]]:
    """The words of a line, of the width that its first character says."""
    text = line.strip()
    width = LONG if text.startswith("*") else SHORT
    text = text.removeprefix("*")
    for place in range(0, len(text), width):
        found = _WORD.fullmatch(text[place : place + width].rstrip())
        if found is None:
            raise file.error(
                index, f"no word of GSI at character {place + 1}: {text[place : place + width]!r}"
            )
        yield found[1], _Word(found[3], found[4], found[5].strip())


def _name(word: _Word) -> str:
    """The name of a point, without the zeros that fill its word."""
    return word.text.lstrip("0").replace(" ", "_") or "0"
