"""Field books of Carlson SurvCE and of the TDS family (.rw5): records and fields of two letters, with commas.

`OC` sets the instrument up, `LS` has the heights of both ends, `BK` the reading of the circle at the
backsight, from which angles to the right (`AR`) are read. Angles are ddd.mmsss, or gon.
"""

from __future__ import annotations

import math

from obseq.formats.fieldbooks.book import Book, Sight, from_horizon, named, reader_of, shown
from obseq.reading.angles import ANGLES, FOOT, HALF_TURN, SURVEY_FOOT
from obseq.reading.text import TextFile

NOWHERE = "an occupied point (OC)"
SIGHTS = ("SS", "TR", "BD", "BR", "FD", "FR")
LENGTHS = {"0": FOOT, "1": 1.0, "2": SURVEY_FOOT}
UNITS_OF_ANGLES = {"0": "dms", "1": "gon"}
AXES = ("E ", "N ", "EL")
NOTE = "--"
LEFT_OUT = {
    "GPS": "GNSS positions (GPS)",
    "GS": "positions on the map (GS)",
    "BR": "bearings (BR)",
    "CE": "changes in elevation (CE)",
}


class _Rw5:
    """One file, record by record."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file, self._height = book, file, 0.0
        self._metre: float | None = None
        self._angle = ANGLES["dms"]
        self._back = 0.0
        book.open(file)

    def read(self) -> None:
        """Takes all records; lines that begin with two hyphens are notes, but for the mode."""
        for index, line in enumerate(self._file.lines):
            text = line.strip()
            if text.startswith(NOTE):
                text = text[len(NOTE) :].strip() if text[len(NOTE) :].startswith("MO,") else ""
            kind, _, rest = text.partition(",")
            fields = {field[:2]: field[2:].strip() for field in rest.split(",")}
            if kind == "MO":
                self._mode(index, fields)
            elif kind == "LS":
                self._heights(index, fields)
            elif kind in ("SP", "OC"):
                self._place(index, kind, fields)
            elif kind == "BK":
                self._backsight(index, fields)
            elif kind in SIGHTS:
                self._sight(index, fields)
            elif kind in LEFT_OUT:
                self._book.leave_out(index, LEFT_OUT[kind])

    def _mode(self, index: int, fields: dict[str, str]) -> None:
        length, angle = fields.get("UN", ""), fields.get("AU", "0")
        if length not in LENGTHS or angle not in UNITS_OF_ANGLES:
            raise self._file.error(index, "UN is 0 (feet), 1 (metres) or 2 (US survey feet), AU is 0 or 1")
        self._metre, self._angle = LENGTHS[length], ANGLES[UNITS_OF_ANGLES[angle]]

    def _heights(self, index: int, fields: dict[str, str]) -> None:
        instrument, target = (self._length(index, fields, name) for name in ("HI", "HR"))
        if target is not None:
            self._book.target_height = target
        if instrument is not None:
            self._height = instrument
            if self._book.is_set_up:
                self._book.lift(index, instrument)

    def _place(self, index: int, kind: str, fields: dict[str, str]) -> None:
        name = named(fields.get("OP" if kind == "OC" else "PN", ""))
        if not name:
            raise self._file.error(index, f"{kind} names no point")
        found = [self._length(index, fields, axis) for axis in AXES]
        x, y, z = (math.nan if value is None else value for value in found)
        self._book.place(index, name, (x, y, z))
        if kind == "OC":
            self._back = 0.0
            self._book.set_up(index, name, self._height)

    def _backsight(self, index: int, fields: dict[str, str]) -> None:
        self._back = self._read(index, fields, "BC") or 0.0
        if fields.get("BP", "0") not in ("", "0"):
            self._book.reference(index, named(fields["BP"]), self._back)

    def _sight(self, index: int, fields: dict[str, str]) -> None:
        name = named(fields.get("FP", ""))
        if not name:
            raise self._file.error(index, "the sight names no point (FP)")
        for unread in ("BR", "CE"):
            if unread in fields:
                self._book.leave_out(index, LEFT_OUT[unread])
        zenith, vertical = (self._read(index, fields, key) for key in ("ZE", "VA"))
        if zenith is None and vertical is not None:
            zenith = from_horizon(vertical)
        slope, flat = (self._length(index, fields, key) for key in ("SD", "HD"))
        self._book.sight(index, name, Sight(self._direction(index, fields), zenith, slope, flat))

    def _direction(self, index: int, fields: dict[str, str]) -> float | None:
        """The circle reading of a sight: azimuths are readings of a circle set to the azimuth."""
        for key, sign, start in (
            ("AR", 1, 0.0),
            ("AZ", 1, 0.0),
            ("AL", -1, 2.0 * self._back),
            ("DR", 1, self._back + HALF_TURN),
            ("DL", -1, self._back + HALF_TURN),
        ):
            angle = self._read(index, fields, key)
            if angle is not None:
                return start + sign * angle
        return None

    def _read(self, index: int, fields: dict[str, str], key: str) -> float | None:
        text = fields.get(key, "")
        return self._book.read(index, text, self._angle, key) if text else None

    def _length(self, index: int, fields: dict[str, str], key: str) -> float | None:
        text = fields.get(key, "")
        if not text:
            return None
        if self._metre is None:
            raise self._file.error(
                index, f"{key} {shown(text)}: no mode record (MO) says the unit of lengths"
            )
        return self._book.length(index, text, self._metre, key)


read_rw5 = reader_of(NOWHERE, _Rw5)
"""Reads field books, one after the other."""
