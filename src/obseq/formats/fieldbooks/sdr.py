"""Field books of Sokkia (SDR2x, SDR33), and of the instruments that write the same: records of fixed columns.

A record begins with two digits that say what it is, and two letters of where it comes from. The header (00)
ends with six digits: units of angles and lengths, then pressure, temperature, order of coordinates and sense
of the circle. Names have 16 columns, numbers as many; 4 and 10 in SDR2x.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from obseq.formats.fieldbooks.book import Book, Sight, from_horizon, reader_of, shown, unfilled
from obseq.reading.angles import ANGLES, FOOT, SURVEY_FOOT
from obseq.reading.text import TextFile

NOWHERE = "a station record (02)"
HEADER, INSTRUMENT, STATION, TARGET, BACK, PLACE, SIGHT, JOB = "00", "01", "02", "03", "07", "08", "09", "10"
UNITS_OF_ANGLES = {"1": "deg", "2": "gon", "4": "mil"}
UNITS_OF_LENGTHS = {"1": 1.0, "2": FOOT, "3": SURVEY_FOOT}
ORDERS = {"1": (1, 0), "2": (0, 1)}
"""Where east and north stand among the first two coordinates."""
CLOCKWISE = "1"
HORIZON = "2"
FACES = ("F1", "F2")
PASSED = {
    "MC": "observations (09MC) that the instrument has reduced to the marks",
    "11": "reduced observations (11)",
}
ALPHANUMERIC = 20
"""Column (from 0) of the job record that says how wide names are."""


class _Widths(NamedTuple):
    """Columns of names and of numbers."""

    name: int
    number: int


WIDE, NARROW = _Widths(16, 16), _Widths(4, 10)


class _Sdr:
    """One file, record by record."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file, self._widths = book, file, WIDE
        self._angle, self._metre, self._axes, self._is_clockwise = ANGLES["deg"], 1.0, ORDERS["1"], True
        self._is_from_horizon, self._station = False, ""
        book.open(file)

    def read(self) -> None:
        """Takes all records."""
        for index, line in enumerate(self._file.lines):
            kind, origin, rest = line[:2], line[2:4], line[4:]
            if kind == HEADER:
                self._header(index, line.rstrip())
            elif kind == INSTRUMENT:
                self._is_from_horizon = line[50:51] == HORIZON
                self._book.use(rest[:16].strip(" :"))
            elif kind == JOB and line[ALPHANUMERIC : ALPHANUMERIC + 1] in ("1", "2"):
                self._widths = WIDE if line[ALPHANUMERIC] == "1" else NARROW
            elif kind == STATION:
                self._stand(index, rest)
            elif kind == TARGET:
                self._book.target_height = self._length(index, rest[: self._widths.number], "height") or 0.0
            elif kind == BACK:
                names, numbers = self._fields(rest, 2, 2)
                if names[0] == self._station and numbers[1].strip():
                    self._book.reference(index, names[1], self._circle(index, numbers[1]))
            elif kind == PLACE:
                names, numbers = self._fields(rest, 1, 3)
                self._book.place(index, names[0], self._xyz(index, numbers))
            elif kind == SIGHT and origin in FACES:
                self._sight(index, rest)
            elif (passed := PASSED.get(origin if kind == SIGHT else kind)) is not None:
                self._book.leave_out(index, passed)

    def _header(self, index: int, line: str) -> None:
        """Units; names of SDR2x are narrow."""
        self._widths = WIDE if line[4:9] == "SDR33" else NARROW
        angle, metre, *_, order, sense = tuple(line[-6:].rjust(6))
        if angle not in UNITS_OF_ANGLES or metre not in UNITS_OF_LENGTHS or order not in ORDERS:
            raise self._file.error(
                index, f"the header ends with {shown(line[-6:])}, which are no six digits of units"
            )
        self._angle, self._metre = ANGLES[UNITS_OF_ANGLES[angle]], UNITS_OF_LENGTHS[metre]
        self._axes, self._is_clockwise = ORDERS[order], sense == CLOCKWISE

    def _fields(self, text: str, names: int, numbers: int) -> tuple[list[str], list[str]]:
        """The first names and numbers of a record."""
        width, wide = self._widths
        starts = range(0, names * width, width)
        begin = names * width
        return (
            [unfilled(text[k : k + width]) for k in starts],
            [text[k : k + wide] for k in range(begin, begin + numbers * wide, wide)],
        )

    def _stand(self, index: int, rest: str) -> None:
        names, numbers = self._fields(rest, 1, 4)
        self._station = names[0]
        self._book.place(index, names[0], self._xyz(index, numbers[:3]))
        self._book.set_up(index, names[0], self._length(index, numbers[3], "height") or 0.0)

    def _sight(self, index: int, rest: str) -> None:
        names, (slope, vertical, circle) = self._fields(rest, 2, 3)
        if self._station != names[0]:
            raise self._file.error(
                index, f"it is from {shown(names[0])}, and the station is {self._station or 'none'}"
            )
        zenith = self._book.read(index, vertical, self._angle, "vertical angle") if vertical.strip() else None
        if zenith is not None and self._is_from_horizon:
            zenith = from_horizon(zenith)
        direction = self._circle(index, circle) if circle.strip() else None
        distance = self._length(index, slope, "distance")
        self._book.sight(index, names[1], Sight(direction, zenith, distance))

    def _circle(self, index: int, text: str) -> float:
        angle = self._book.read(index, text, self._angle, "horizontal angle")
        return angle if self._is_clockwise else -angle

    def _length(self, index: int, text: str, what: str) -> float | None:
        return self._book.length(index, text, self._metre, what)

    def _xyz(self, index: int, numbers: list[str]) -> tuple[float, float, float]:
        read = [self._length(index, text, "coordinate") for text in numbers]
        values = [math.nan if value is None else value for value in read]
        return values[self._axes[0]], values[self._axes[1]], values[2]


read_sdr = reader_of(NOWHERE, _Sdr)
"""Reads field books, one after the other."""
