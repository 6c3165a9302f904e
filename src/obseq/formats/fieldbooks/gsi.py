"""Field books of Leica (GSI-8, GSI-16): set-ups, directions, zenith angles, distances, heights of both ends.

A line holds words of 16 or 24 characters: two digits that say what it is, four of which the last is the unit,
a sign, and 8 or 16 characters. A block begins with the number of its point (11) or a code (41). A block with
the coordinates of the station (84, 85), or its name (16), sets the instrument up. Where a file has neither, a
code with a name (42) and a height (43) does it, as many code lists have it. Coordinates are first values.
Digital levels write readings of the staff (331, 332, 335, 336) with their distances (32).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from obseq.formats.fieldbooks.book import SHOWN, Book, Sight, reader_of, unfilled
from obseq.printable import listed
from obseq.reading.angles import FOOT, of_sixty
from obseq.reading.text import TextFile

NOWHERE = (
    "a block with the coordinates of the station (84, 85), its name (16), or a code (41) with its name (42) "
    "and height (43)"
)
SHORT, LONG = 16, 24
"""Characters of a word of GSI-8 and GSI-16, the blank after it included."""
POINT, INSTRUMENT, STATION, CODE, NAME, HEIGHT = "11", "12", "16", "41", "42", "43"
HORIZONTAL, VERTICAL, SLOPE, FLAT = "21", "22", "31", "32"
STAFF = "33"
BACK, STAFFS, OTHER_STAFFS = ("1", "5"), ("1", "2", "5", "6"), ("0", "3", "4")
"""Third characters of readings of a levelling staff: backwards, in both senses, of no turn."""
TARGET, PLACE = ("81", "82", "83"), ("84", "85", "86")
TARGET_HEIGHT, INSTRUMENT_HEIGHT = "87", "88"
LENGTHS = {"0": 1e-3, "1": FOOT * 1e-3, "6": 1e-4, "7": FOOT * 1e-4, "8": 1e-5}
"""Metres in the last digit of a length, by its unit."""
MILLIMETRE = 1e-3
"""Heights in codes, which have no units (m)."""
ANGLES = {"2": math.pi / 200.0 * 1e-5, "3": math.pi / 180.0 * 1e-5, "5": math.pi / 3200.0 * 1e-4}
"""Radians in the last digit of an angle, by its unit."""
SEXAGESIMAL = "4"
"""Unit of angles that are written dddmmss, and a tenth of a second."""
_WORD = r"\d\d[0-9.]{4}[+-]"
_SHORT_LINE, _LONG_LINE = (
    re.compile(rf"(?:{_WORD}.{{{digits}}} )*(?:{_WORD}.{{1,{digits}}})?") for digits in (8, 16)
)


class _Block(NamedTuple):
    """Words by number, whole as they are written, and the line (from 0) that the block begins in."""

    line: int
    words: dict[str, str]


UNIT, SIGN, VALUE = 5, 6, 7
"""Places in a word: of its unit, its sign, and of what it holds."""


class _Gsi:
    """One file, block by block."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file, self._height = book, file, 0.0
        self._by_code: list[str] = []
        book.open(file)

    def read(self) -> None:
        """Takes all blocks."""
        blocks = list(_blocks(self._file))
        self._has_stations = any(map(_is_station, blocks))
        for block in blocks:
            self._take(block)
        if self._by_code:
            names = listed(self._by_code, SHOWN)
            self._book.note(
                f"{len(self._by_code)} codes with a name (42) and a height (43) are set-ups here: {names}"
            )

    def _take(self, block: _Block) -> None:
        words, book = block.words, self._book
        if INSTRUMENT in words:
            book.use(_text(words[INSTRUMENT]))
        if INSTRUMENT_HEIGHT in words:
            self._height = self._length(block, INSTRUMENT_HEIGHT)
            if book.is_set_up:
                book.lift(block.line, self._height)
        if TARGET_HEIGHT in words:
            book.target_height = self._length(block, TARGET_HEIGHT)
        if CODE in words:
            if NAME in words and HEIGHT in words and not self._has_stations:
                self._by_code.append(_text(words[NAME]))
                self._height = self._digits(block, HEIGHT) * MILLIMETRE
                book.set_up(block.line, _text(words[NAME]), self._height)
            return
        if STATION in words and HORIZONTAL not in words:
            book.set_up(block.line, _text(words[STATION]), self._height)
        if POINT in words:
            self._point(block, _text(words[POINT]))

    def _point(self, block: _Block, name: str) -> None:
        words, book = block.words, self._book
        staff = words[STAFF][2] if STAFF in words else ""
        if _is_station(block):
            self._keep(block, name, PLACE)
            book.set_up(block.line, name, self._height)
        elif staff in STAFFS:
            distance = self._length(block, FLAT) if FLAT in words else 0.0
            book.staff(block.line, name, self._length(block, STAFF), distance, is_back=staff in BACK)
        elif staff in OTHER_STAFFS:
            book.leave_out(block.line, "intermediate readings of a levelling staff")
        elif TARGET[2] in words and TARGET[0] not in words:  # the result of a turn
            book.end_turn()
        elif HORIZONTAL in words or VERTICAL in words:
            horizontal = self._angle(block, HORIZONTAL) if HORIZONTAL in words else None
            zenith = self._angle(block, VERTICAL) if VERTICAL in words else None
            slope = self._length(block, SLOPE) if SLOPE in words else None
            flat = self._length(block, FLAT) if FLAT in words else None
            book.sight(block.line, name, Sight(horizontal, zenith, slope, flat))
        if TARGET[0] in words and TARGET[1] in words:
            self._keep(block, name, TARGET)

    def _keep(self, block: _Block, name: str, axes: tuple[str, str, str]) -> None:
        """First values of a point; dashes stand for a number that there is not."""
        x, y, z = (
            self._length(block, axis)
            if axis in block.words and not block.words[axis].rstrip().endswith("-----")
            else math.nan
            for axis in axes
        )
        self._book.place(block.line, name, (x, y, z))

    def _length(self, block: _Block, number: str) -> float:
        """A length in metres."""
        unit = block.words[number][UNIT]
        if unit not in LENGTHS:
            raise self._file.error(block.line, f"word {number}: {unit!r} is no unit of lengths")
        return self._digits(block, number) * LENGTHS[unit]

    def _angle(self, block: _Block, number: str) -> float:
        """An angle in radians."""
        unit, value = block.words[number][UNIT], self._digits(block, number)
        if unit in ANGLES:
            return value * ANGLES[unit]
        if unit != SEXAGESIMAL:
            raise self._file.error(block.line, f"word {number}: {unit!r} is no unit of angles")
        tenths = abs(int(value))
        try:
            angle = of_sixty(tenths // 100_000, tenths // 1000 % 100, tenths % 1000 / 10.0)
        except ValueError as error:
            raise self._file.error(block.line, f"word {number}: {error}") from error
        return math.copysign(angle, value)

    def _digits(self, block: _Block, number: str) -> float:
        word = block.words[number]
        text = word[VALUE:].strip()
        if not (text.isascii() and text.isdigit()):
            raise self._file.error(block.line, f"word {number}: {text[:20]!r} is no whole number")
        return -float(text) if word[SIGN] == "-" else float(text)


def _text(word: str) -> str:
    return unfilled(word[VALUE:])


def _is_station(block: _Block) -> bool:
    """Whether a block says by its words where the instrument stands."""
    words = block.words
    return HORIZONTAL not in words and (STATION in words or {*PLACE[:2]} <= words.keys())


def _blocks(file: TextFile) -> Iterator[_Block]:
    """The blocks of a file; several may stand in a line, of words as wide as its first character says."""
    for index, line in enumerate(file.lines):
        text = line.strip()
        is_long = text.startswith("*")
        width, pattern = (LONG, _LONG_LINE) if is_long else (SHORT, _SHORT_LINE)
        found = pattern.match(text, is_long)
        if found is None or found.end() < len(text):
            place = found.end() if found else is_long
            place -= (place - is_long) % width
            wrong = text[place : place + width]
            raise file.error(index, f"no word of GSI at character {place - is_long + 1}: {wrong!r}")
        words: dict[str, str] = {}
        for place in range(is_long, len(text), width):
            number = text[place : place + 2]
            if words and number in (POINT, CODE):
                yield _Block(index, words)
                words = {}
            words.setdefault(number, text[place : place + width])
        if words:
            yield _Block(index, words)


read_gsi = reader_of(NOWHERE, _Gsi)
"""Reads field books, one after the other."""
