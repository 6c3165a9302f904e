"""Field books of Zeiss and Trimble (M5, R5, R4): lines of fields between bars, each value with its unit.

A line has an address, an information of 27 columns (`PI` of a point, `TI` a text) and three values. The
station is the point of code S; sights of its orientation may stand before it, after `KN STAT` or `UN STAT`.
Digital levels write the same: readings of the staff backwards (Rb) and forwards (Rf) make height differences.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from obseq.formats.fieldbooks.book import Book, Sight, named, reader_of, shown
from obseq.reading.angles import ANGLES, FOOT, RIGHT_ANGLE
from obseq.reading.text import TextFile

NOWHERE = "a point with the code S"
LENGTHS = {"m": 1.0, "ft": FOOT, "mm": 1e-3, "in": FOOT / 12.0}
UNITS_OF_ANGLES = {"dms": "dms", "gon": "gon", "grd": "gon", "deg": "deg", "mil": "mil"}
WORDS = {"Lr": "Rb", "Lv": "Rf", "Lz": "Rz", "E": "HD", "N_": "X", "E_": "Y", "Z_": "Z"}
"""The same types in another language of the instrument."""
NEW_SET_UP = ("KN STAT", "UN STAT", "OR.COOR")
STATION = "S"
NAME_ENDS = 27
"""Column of the information at which names end, if they end it; else a code follows them."""
_LINE = re.compile(r"For[ _](M5|R5|R4)\|(?:Adr\s*\d*\|)?(\w\w)(.?)\s(.*)")
_VALUE = re.compile(r"\s*([A-Za-z0-9_]{1,2})\s+(-?[\d.]+)\s*([A-Za-z]*)\s*")


class _Value(NamedTuple):
    """A value, as text, and its unit."""

    text: str
    unit: str


class _Line(NamedTuple):
    """A line: whether it is of a point, its information, its values by type."""

    is_point: bool
    info: str
    values: dict[str, _Value]


class _M5:
    """One file, line by line."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file, self._height = book, file, 0.0
        self._waiting: list[tuple[int, str, float, Sight]] = []
        book.open(file)

    def read(self) -> None:
        """Takes all lines."""
        for index, line in enumerate(self._file.lines):
            if not line.strip() or line.startswith("END"):
                continue
            found = _LINE.match(line)
            if found is None:
                raise self._file.error(index, "no line of M5: it begins with 'For M5|'")
            info, *rest = found[4].split("|")
            parts = [part for part in map(_VALUE.fullmatch, rest) if part is not None]
            values = {WORDS.get(part[1], part[1]): _Value(part[2], part[3].lower()) for part in parts}
            self._take(index, _Line(found[2] in ("PI", "KD", "KR"), info, values))
        if self._waiting:
            self._book.leave_out(self._waiting[0][0], "orientations without a station that follows")

    def _take(self, index: int, line: _Line) -> None:
        values = line.values
        if "ih" in values:
            self._height = self._length(index, values["ih"])
            if self._book.is_set_up:
                self._book.lift(index, self._height)
        if "th" in values:
            self._book.target_height = self._length(index, values["th"])
        if not line.is_point:
            if line.info.strip() in NEW_SET_UP:
                self._book.take_down()
            return
        name, code = _name_and_code(line.info, "Rb" in values or "Rf" in values)
        if not name:
            return
        if "Rb" in values or "Rf" in values:
            self._staff(index, name, values)
            return
        self._book.end_turn()
        if "X" in values and "Y" in values:
            z = self._length(index, values["Z"]) if "Z" in values else math.nan
            self._book.place(
                index, name, (self._length(index, values["Y"]), self._length(index, values["X"]), z)
            )
        if code == STATION and not values.keys() & {"Hz", "SD", "HD"}:
            self._stand(index, name)
        elif values.keys() & {"Hz", "V1", "V3", "SD", "HD"}:
            self._sight(index, name, self._readings(index, values))

    def _stand(self, index: int, name: str) -> None:
        """The station, and the sights of its orientation that stood before it."""
        self._book.set_up(index, name, self._height)
        target_height = self._book.target_height
        for line, target, lift, sight in self._waiting:
            self._book.target_height = lift
            self._book.sight(line, target, sight)
        self._waiting, self._book.target_height = [], target_height

    def _sight(self, index: int, name: str, sight: Sight) -> None:
        if self._book.is_set_up:
            self._book.sight(index, name, sight)
        else:
            self._waiting.append((index, name, self._book.target_height, sight))

    def _readings(self, index: int, values: dict[str, _Value]) -> Sight:
        direction, zenith, vertical = (
            self._angle(index, values[key]) if key in values else None for key in ("Hz", "V1", "V3")
        )
        if zenith is None and vertical is not None:
            zenith = RIGHT_ANGLE - vertical
        slope, flat = (self._length(index, values[key]) if key in values else None for key in ("SD", "HD"))
        return Sight(direction, zenith, slope, flat)

    def _staff(self, index: int, name: str, values: dict[str, _Value]) -> None:
        """A reading of a levelling staff."""
        kind = "Rb" if "Rb" in values else "Rf"
        length = self._length(index, values["HD"]) if "HD" in values else 0.0
        self._book.staff(index, name, self._length(index, values[kind]), length, is_back=kind == "Rb")

    def _length(self, index: int, value: _Value) -> float:
        if value.unit not in LENGTHS:
            raise self._file.error(index, f"{shown(value.unit)} is no unit of lengths: {', '.join(LENGTHS)}")
        return self._file.number(index, value.text) * LENGTHS[value.unit]

    def _angle(self, index: int, value: _Value) -> float:
        if value.unit not in UNITS_OF_ANGLES:
            known = ", ".join(UNITS_OF_ANGLES)
            raise self._file.error(index, f"{shown(value.unit)} is no unit of angles: {known}")
        return self._book.read(index, value.text, ANGLES[UNITS_OF_ANGLES[value.unit]], "angle")


def _name_and_code(info: str, is_levelled: bool) -> tuple[str, str]:
    """Name and code of a point: the code stands before a name that ends the field, else after it."""
    words = info.split()
    if not words:
        return "", ""
    if is_levelled:
        return named(words[0]), ""
    is_last = len(info.rstrip()) >= NAME_ENDS or len(info) < NAME_ENDS
    if is_last:
        return named(words[-1]), words[0] if len(words) > 1 else ""
    if len(words) > 1:
        return named(words[0]), words[-1]
    return named(info[:20]), info[20:].strip()


read_m5 = reader_of(NOWHERE, _M5)
"""Reads field books, one after the other."""
