"""Field books of Geodimeter and Trimble (.job, .are): lines `label=value`.

2 sets the instrument up, 5 and 62 begin a target, 3 and 6 are the heights of instrument and target, 7 and 24
the circle in the first face, 17 in the second one, 8, 25 and 18 the vertical angles, 9 and 11 the slope and
the horizontal distance, 21 the reading that the circle was set to at a reference, 37 to 39 north, east and
height. Angles are gon or ddd.mmss, as label 23 says; a file without it is told by its readings.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from obseq.formats.fieldbooks.book import Book, Sight, named, reader_of, shown
from obseq.reading.angles import ANGLES, dms
from obseq.reading.text import TextFile

NOWHERE = "a station (2=)"
STATION, HEIGHT, TARGET, REFERENCE, LIFT, UNITS, CIRCLE_SET = "2", "3", "5", "62", "6", "23", "21"
INSTRUMENT = "55"
FIRST_CIRCLE, FIRST_VERTICAL = ("7", "24"), ("8", "25")
SECOND_CIRCLE, SECOND_VERTICAL = ("17",), ("18",)
SLOPE, FLAT = ("9",), ("11",)
PLACE = ("38", "37", "39")
READINGS = (*FIRST_CIRCLE, *FIRST_VERTICAL, *SECOND_CIRCLE, *SECOND_VERTICAL)
OF_UNITS = {"1": "gon", "2": "dms", "3": "deg", "4": "mil"}
"""Units of angles by the first digit of label 23."""


class _Geodimeter:
    """One file, label by label."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file = book, file
        self._name = self._label = ""
        self._found: dict[str, tuple[int, str]] = {}
        book.open(file)
        self._rows = [(k, *self._split(k, line)) for k, line in enumerate(file.lines) if line.strip()]
        self._angle = self._unit_of_angles()

    def _split(self, index: int, line: str) -> tuple[str, str]:
        label, equal, value = line.partition("=")
        if not equal or not label.strip().isdigit():
            raise self._file.error(index, "a line is a label, = and a value")
        return label.strip(), value.strip()

    def _unit_of_angles(self) -> Callable[[str], float]:
        """As label 23 says; else degrees, minutes and seconds if all readings can be such."""
        for index, label, value in self._rows:
            if label == UNITS:
                if value[:1] not in OF_UNITS:
                    raise self._file.error(index, f"{shown(value)} says no unit of angles")
                return ANGLES[OF_UNITS[value[0]]]
        readings = [value for _, label, value in self._rows if label in READINGS]
        unit = "dms" if all(map(_can_be_dms, readings)) else "gon"
        if readings:
            words = {"dms": "degrees, minutes and seconds", "gon": "gon"}[unit]
            self._book.note(f"no label 23 says the units: by its readings angles are {words}, lengths metres")
        return ANGLES[unit]

    def read(self) -> None:
        """Takes all points."""
        for index, label, value in self._rows:
            if label in (STATION, TARGET, REFERENCE):
                self._finish()
                self._name, self._label, self._found = named(value), label, {}
                if label == STATION:
                    self._book.set_up(index, self._name)
            elif label == HEIGHT and self._book.is_set_up:
                self._book.lift(index, self._file.number(index, value))
            elif label == LIFT:
                self._book.target_height = self._file.number(index, value)
            elif label == INSTRUMENT:
                self._book.use(value)
            else:
                self._found[label] = index, value
        self._finish()

    def _finish(self) -> None:
        """Takes what was found of a point."""
        if not self._name:
            return
        if PLACE[0] in self._found and PLACE[1] in self._found:
            index = self._found[PLACE[0]][0]
            x, y, z = (self._length((axis,)) for axis in PLACE)
            self._book.place(index, self._name, (x or 0.0, y or 0.0, math.nan if z is None else z))
        if self._label == STATION:
            return
        if CIRCLE_SET in self._found and self._book.is_set_up:
            index, text = self._found[CIRCLE_SET]
            self._book.reference(index, self._name, self._book.read(index, text, self._angle, "circle"))
        self._sight(FIRST_CIRCLE, FIRST_VERTICAL, self._length(SLOPE), self._length(FLAT))
        self._sight(SECOND_CIRCLE, SECOND_VERTICAL, None, None)

    def _sight(
        self, circle: tuple[str, ...], vertical: tuple[str, ...], slope: float | None, flat: float | None
    ) -> None:
        """What one face gave."""
        given = [self._found[label] for label in (*circle, *vertical) if label in self._found]
        if not given and not slope and not flat:
            return
        index = (given or [next(iter(self._found.values()))])[0][0]
        sight = Sight(self._reading(circle), self._reading(vertical), slope, flat)
        self._book.sight(index, self._name, sight)

    def _reading(self, labels: tuple[str, ...]) -> float | None:
        found = [self._found[label] for label in labels if label in self._found]
        return self._book.read(*found[0], self._angle, "angle") if found else None

    def _length(self, labels: tuple[str, ...]) -> float | None:
        found = [self._found[label] for label in labels if label in self._found]
        return self._file.number(*found[0]) if found else None


def _can_be_dms(text: str) -> bool:
    """Whether a text can be degrees, minutes and seconds."""
    try:
        dms(text)
    except ValueError:
        return False
    return True


read_geodimeter = reader_of(NOWHERE, _Geodimeter)
"""Reads field books, one after the other."""
