"""Field books of Nikon (RAW V2.00), and of Ruide and others that write the same: records with commas.

Comments (`CO`) say the units. `ST` sets the instrument up: point, backsight, height, azimuth, reading of the
circle. `F1`, `F2` and `SS` are sights: point, target height, slope distance, circle, vertical angle. A `*`
before a record has replaced it.
"""

from __future__ import annotations

import math
import re

from obseq.formats.fieldbooks.book import Book, Sight, from_horizon, named, reader_of, shown
from obseq.reading.angles import ANGLES, FOOT, SURVEY_FOOT
from obseq.reading.text import TextFile

NOWHERE = "a station (ST)"
PLACES = ("UP", "MP", "CC", "RE", "MC")
LAYOUTS = {"F1": 2, "F2": 2, "SS": 2, "CP": 3, "SO": 3}
"""Field of the target height in the sights, which distance and angles follow."""
UNITS_OF_LENGTHS = {
    "metres": 1.0,
    "meters": 1.0,
    "feet": FOOT,
    "i-feet": FOOT,
    "feet(int)": FOOT,
    "us-feet": SURVEY_FOOT,
    "feet(us)": SURVEY_FOOT,
}
UNITS_OF_ANGLES = {"dddmmss": "dms", "gons": "gon", "gon": "gon", "dec.degrees": "deg", "mils": "mil"}
ORDERS = {"NEZ": (1, 0), "ENZ": (0, 1)}
_SAID = re.compile(
    r"\s*(Dist Units|Angle Units|Coord Order|Zero VA|VA|Instrument)\s*:\s*(.*?)\s*", re.IGNORECASE
)
_RESECTION = re.compile(r"\s*Start of Resection from Pt:\s*(\S+)\s*", re.IGNORECASE)
REPLACED = "records with a *, which the instrument has replaced,"


class _Nikon:
    """One file, record by record."""

    def __init__(self, book: Book, file: TextFile) -> None:
        self._book, self._file = book, file
        self._metre, self._angle, self._axes = 1.0, ANGLES["dms"], ORDERS["NEZ"]
        self._is_from_horizon, self._back = False, ""
        book.open(file)

    def read(self) -> None:
        """Takes all records."""
        for index, line in enumerate(self._file.lines):
            kind, *fields = [field.strip() for field in line.split(",")]
            fields += [""] * (8 - len(fields))
            if kind == "CO":
                self._say(index, line.partition(",")[2])
            elif kind == "ST":
                self._stand(index, fields)
            elif kind in PLACES:
                self._place(index, fields)
            elif kind in LAYOUTS:
                self._sight(index, kind, fields)
            elif kind.startswith("*"):
                self._book.leave_out(index, REPLACED)

    def _say(self, index: int, text: str) -> None:
        """What a comment says of units, or of where the instrument stands."""
        resection = _RESECTION.fullmatch(text)
        if resection is not None:
            self._book.set_up(index, named(resection[1]))
        said = _SAID.fullmatch(text)
        if said is None:
            return
        what, value = said[1].lower(), said[2].lower().replace(" ", "")
        if what == "instrument":
            self._book.use(said[2])
        elif what == "dist units":
            self._metre = UNITS_OF_LENGTHS[self._known(index, value, UNITS_OF_LENGTHS)]
        elif what == "angle units":
            self._angle = ANGLES[UNITS_OF_ANGLES[self._known(index, value, UNITS_OF_ANGLES)]]
        elif what == "coord order":
            self._axes = ORDERS[self._known(index, value.upper(), ORDERS)]
        else:
            self._is_from_horizon = value.startswith("hor")

    def _known(
        self, index: int, value: str, known: dict[str, float] | dict[str, str] | dict[str, tuple[int, int]]
    ) -> str:
        if value not in known:
            raise self._file.error(index, f"{shown(value)} is none of {', '.join(known)}")
        return value

    def _stand(self, index: int, fields: list[str]) -> None:
        name, _, back, _, height, _, circle = fields[:7]
        if not name:
            raise self._file.error(index, "the station has no name")
        self._back = back
        self._book.set_up(index, named(name), self._book.length(index, height, self._metre, "height") or 0.0)
        if back and circle:
            self._book.reference(index, named(back), self._book.read(index, circle, self._angle, "circle"))

    def _place(self, index: int, fields: list[str]) -> None:
        read = [self._book.length(index, text, self._metre, "coordinate") for text in fields[2:5]]
        values = [math.nan if value is None else value for value in read]
        if fields[0]:
            xyz = values[self._axes[0]], values[self._axes[1]], values[2]
            self._book.place(index, named(fields[0]), xyz)

    def _sight(self, index: int, kind: str, fields: list[str]) -> None:
        start = LAYOUTS[kind] - 1
        name = fields[0] or (self._back if kind in ("F1", "F2") else "")
        if not name:
            self._book.leave_out(index, "sights of a backsight without a name")
            return
        lift, slope, circle, vertical = fields[start : start + 4]
        height = self._book.length(index, lift, self._metre, "target height")
        self._book.target_height = height or 0.0
        direction, zenith = (
            self._book.read(index, text, self._angle, what) if text else None
            for text, what in ((circle, "circle"), (vertical, "vertical angle"))
        )
        if zenith is not None and self._is_from_horizon:
            zenith = from_horizon(zenith)
        distance = self._book.length(index, slope, self._metre, "distance")
        self._book.sight(index, named(name), Sight(direction, zenith, distance))


read_nikon = reader_of(NOWHERE, _Nikon)
"""Reads field books, one after the other."""
