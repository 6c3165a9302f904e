"""Field books of Topcon: GTS-7 (labels and commas; South writes the same) and GTS-210 (a stream of marks).

In GTS-7 the point of a sight (BS, FS, SS) stands before its readings (HV, SD, HD). In GTS-210 `_'` begins a
station, `_+` a target, `_ ?` its slope distance, vertical and horizontal angle, `_ <` its angles with the
tilt of the instrument, `_,` its height.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from obseq.formats.fieldbooks.book import Book, Sight, named, reader_of, shown, unfilled
from obseq.reading.angles import ANGLES, FOOT
from obseq.reading.text import TextFile

NOWHERE = "a station (STN)"
LABEL = 8
"""Columns of a label in GTS-7."""
UNITS_OF_LENGTHS = {"M": 1.0, "F": FOOT}
UNITS_OF_ANGLES = {"D": "dms", "G": "gon"}
TARGETS = ("BS", "FS", "SS")
READINGS = ("HV", "SD", "HD")
STREAM = "_'"
FRAME = "\x02\x03\x04"
"""Marks around what is sent."""
_COUNTED = re.compile(r"\d{4}\s*")
"""What ends each line of a stream that was sent in several: its number, and a sum to check it."""
_SIGHT = re.compile(r" (?:\?\+(\d{8})([mf])|<)(\d{7})\+(\d{7})(?:[+-][*\d]{4})?([dg])")
THOUSANDTH = 1e-3


class _Labels:
    """A file of GTS-7, line by line."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file = book, file
        self._metre, self._angle = 1.0, ANGLES["dms"]
        self._placed = self._target = ""

    def read(self) -> None:
        """Takes all lines."""
        for index, line in enumerate(self._file.lines):
            label, fields = line[:LABEL].strip(), [field.strip() for field in line[LABEL:].split(",")]
            if label == "UNITS":
                self._units(index, fields)
            elif label == "INST":
                self._book.use(fields[0])
            elif label == "STN":
                self._placed = named(fields[0])
                self._book.set_up(index, self._placed, self._length(index, fields, 1) or 0.0)
            elif label == "BKB":
                self._placed = named(fields[0])
                if self._placed and len(fields) > 2 and fields[2]:
                    reading = self._book.read(index, fields[2], self._angle, "circle")
                    self._book.reference(index, self._placed, reading)
            elif label == "XYZ" and self._placed:
                x, y, z = (self._length(index, fields, k) for k in range(3))
                if x is not None and y is not None and z is not None:
                    self._book.place(index, self._placed, (x, y, z))
            elif label in TARGETS:
                self._placed = self._target = named(fields[0])
                self._book.target_height = self._length(index, fields, 1) or 0.0
            elif label in READINGS:
                self._sight(index, label, fields)

    def _units(self, index: int, fields: list[str]) -> None:
        length, angle, *_ = (*fields, "", "")
        if length not in UNITS_OF_LENGTHS or angle not in UNITS_OF_ANGLES:
            raise self._file.error(index, "units are M or F, then D or G")
        self._metre, self._angle = UNITS_OF_LENGTHS[length], ANGLES[UNITS_OF_ANGLES[angle]]

    def _length(self, index: int, fields: list[str], place: int) -> float | None:
        text = fields[place] if place < len(fields) else ""
        return self._book.length(index, text, self._metre, "length")

    def _sight(self, index: int, label: str, fields: list[str]) -> None:
        if not self._target:
            raise self._file.error(index, f"no {', '.join(TARGETS)} before it names its target")
        direction = self._book.read(index, fields[0], self._angle, "horizontal angle")
        zenith = None
        if label != "HD":
            text = fields[1] if len(fields) > 1 else ""
            zenith = self._book.read(index, text, self._angle, "vertical angle")
        slope = self._length(index, fields, 2) if label == "SD" else None
        flat = self._length(index, fields, 1) if label == "HD" else None
        self._book.sight(index, self._target, Sight(direction, zenith, slope, flat))


class _Stream:
    """A file of GTS-210, mark by mark."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file = book, file
        self._station = self._target = ""
        self._sight: tuple[int, Sight] | None = None

    def read(self) -> None:
        """Takes all marks; each with the line in which it begins."""
        for index, mark in self._marks():
            self._take(index, mark[:1], mark[1:], mark)
        self._finish()

    def _marks(self) -> Iterator[tuple[int, str]]:
        """The marks of the stream, whose lines may end anywhere."""
        framed = enumerate(line.strip(FRAME) for line in self._file.lines)
        lines = [(index, line) for index, line in framed if line.strip()]
        if len(lines) > 1:
            for index, line in lines:
                if not _COUNTED.fullmatch(line[-4:]):
                    raise self._file.error(index, "the line does not end with its number and its sum")
            lines = [(index, line[:-4]) for index, line in lines]
        begun, mark = 0, ""
        for index, line in lines:
            first, *others = line.split("_")
            mark += first
            for other in others:
                yield begun, mark
                begun, mark = index, other
        yield begun, mark

    def _take(self, index: int, kind: str, rest: str, mark: str) -> None:
        if kind == "'":
            self._finish()
            self._station = unfilled(rest)
        elif kind == ")":
            height = self._book.length(index, rest, 1.0, "height of the instrument") or 0.0
            self._book.set_up(index, self._station, height)
        elif kind == "+":
            self._finish()
            self._target = named(rest)
        elif kind == ",":
            self._book.target_height = self._book.length(index, rest, 1.0, "target height") or 0.0
            self._finish()
        elif kind == " " and rest.strip():
            self._sight = index, self._readings(index, mark)

    def _readings(self, index: int, mark: str) -> Sight:
        found = _SIGHT.match(mark)
        if found is None:
            self._book.leave_out(index, f"readings in a mode that is not known ({shown(mark[:3])})")
            return Sight()
        slope, length, vertical, circle, unit = found.groups()
        angle = ANGLES[UNITS_OF_ANGLES[unit.upper()]]
        direction, zenith = (
            self._book.read(index, f"{text[:3]}.{text[3:]}", angle, "angle") for text in (circle, vertical)
        )
        metre = UNITS_OF_LENGTHS[(length or "m").upper()] * THOUSANDTH
        return Sight(direction, zenith, float(slope) * metre if slope else None)

    def _finish(self) -> None:
        """Takes a sight, whose target height stands behind it."""
        if self._sight is not None:
            index, sight = self._sight
            self._sight = None
            self._book.sight(index, self._target, sight)


def _file(book: Book, file: TextFile) -> _Labels | _Stream:
    book.open(file)
    return (_Stream if file.lines[0].lstrip(FRAME).startswith(STREAM) else _Labels)(book, file)


read_gts = reader_of(NOWHERE, _file)
"""Reads field books, one after the other."""
