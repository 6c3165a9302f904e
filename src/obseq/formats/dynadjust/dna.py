"""DNA files of DynAdjust: stations (.stn) and measurements (.msr) in fixed columns."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.formats.dynadjust.records import (
    ANGLES,
    GEOGRAPHIC,
    ONE_POINT,
    THREE_POINTS,
    TYPES,
    Header,
    MeasurementRecord,
    Member,
    Place,
    StationRecord,
    decimal_year,
    radians_of_packed,
    radians_of_parts,
)
from obseq.reading.angles import SECOND
from obseq.reading.text import TextFile, parse_number, quoted, read_text

Span = tuple[int, int]


@dataclass(frozen=True)
class Layout:
    """Columns of one version of the format, from 0.

    Attributes:
        station: Of stations: name, constraints, system, three coordinates, zone, description.
        value: Of a component of a vector.
        covariance: Of three covariances.
        scales: Of the four scales of variances.
        frame: Of the reference frame of a record.
        epoch: Of its epoch.
    """

    station: tuple[Span, ...]
    value: Span
    covariance: tuple[Span, Span, Span]
    scales: tuple[Span, Span, Span, Span]
    frame: Span
    epoch: Span


_FIRST = ((0, 20), (20, 23), (24, 27))
LAYOUTS = {
    "3.01": Layout(
        (*_FIRST, (27, 47), (47, 67), (67, 87), (87, 90), (91, 999)),
        (62, 82),
        ((82, 102), (102, 122), (122, 142)),
        ((62, 72), (72, 82), (82, 92), (92, 102)),
        (102, 122),
        (122, 142),
    ),
    "3.00": Layout(
        (*_FIRST, (27, 41), (41, 55), (55, 69), (69, 72), (73, 999)),
        (62, 76),
        ((76, 90), (90, 104), (104, 118)),
        ((62, 69), (69, 76), (76, 83), (83, 90)),
        (90, 104),
        (104, 118),
    ),
}
_NAMES = ((2, 22), (22, 42), (42, 62))
_LINEAR, _SIGMA, _HEIGHTS = (62, 76), (90, 99), ((99, 106), (106, 113))
_PARTS = ((76, 80), (80, 82), (82, 90))


class DnaFile:
    """One file, read line by line.

    Args:
        path: The file.
        encoding: Of its names.
        content: STN or MSR.

    Raises:
        InputError: it is not a DNA file of a known version with that content.
    """

    def __init__(self, path: Path, encoding: str, content: str) -> None:
        self.file: TextFile = read_text(path, encoding)
        first = self.file.lines[0]
        version = first[6:12].strip()
        if not first.startswith("!#=DNA") or version not in LAYOUTS:
            raise self.file.error(
                0,
                "a DNA file begins with `!#=DNA`, a version 3.00 or 3.01, and its content; write older files "
                "anew with DynAdjust (dnaimport)",
            )
        if first[12:15] != content:
            raise self.file.error(0, f"this file holds {first[12:15].strip() or 'nothing'}, not {content}")
        self.layout = LAYOUTS[version]
        self.header = Header(first[29:43].strip(), self._epoch(0, first[43:57]))

    def place(self, index: int) -> Place:
        """A line, from 0."""
        return Place(self.file.name, index + 1)

    def text(self, index: int, span: Span) -> str:
        """What stands in some columns of a line; a line that ends before them has nothing."""
        if index >= len(self.file.lines):
            raise self.place(index).error("the file ends in the middle of a measurement")
        return self.file.lines[index][span[0] : span[1]].strip()

    def number(self, index: int, span: Span, default: float | None = None) -> float:
        """The number in some columns of a line."""
        text = self.text(index, span)
        if not text and default is not None:
            return default
        try:
            return parse_number(text)
        except ValueError as error:
            raise self.file.error(index, f"columns {span[0] + 1} to {span[1]}: {error}") from error

    def name(self, index: int, span: Span) -> str:
        """The name of a point in some columns of a line."""
        name = self.text(index, span)
        if not name:
            raise self.file.error(
                index, f"columns {span[0] + 1} to {span[1]}: the name of a point is missing"
            )
        self.file.check_name(index, name)
        return name

    def _epoch(self, index: int, text: str) -> float:
        try:
            return decimal_year(text)
        except ValueError as error:
            raise self.file.error(index, f"epoch: {error}") from error

    def _records(self) -> Iterator[int]:
        for index in range(1, len(self.file.lines)):
            line = self.file.lines[index]
            if line.strip() and not line.startswith("*"):
                yield index

    def stations(self) -> Iterator[StationRecord]:
        """The stations."""
        for index in self._records():
            yield self._station(index)

    def _station(self, index: int) -> StationRecord:
        name, constraints, system, first, second, third, zone, words = self.layout.station
        coordinates = tuple(self.number(index, span) for span in (first, second, third))
        return StationRecord(
            self.name(index, name),
            self.text(index, constraints),
            self.text(index, system),
            (coordinates[0], coordinates[1], coordinates[2]),
            self.text(index, zone),
            self.text(index, words),
            self.place(index),
        )

    def measurements(self) -> Iterator[MeasurementRecord]:
        """The measurements, those that are switched off as well."""
        lines, index = self.file.lines, 1
        while index < len(lines):
            if not lines[index].strip() or lines[index].startswith("*"):
                index += 1
                continue
            record, index = self._measurement(index)
            yield record

    def _measurement(self, index: int) -> tuple[MeasurementRecord, int]:
        """A measurement, and the line after it."""
        code = self.file.lines[index][0]
        if code not in TYPES:
            raise self.file.error(
                index, f"{quoted(code)!r} is not a type of measurement ({', '.join(sorted(TYPES))})"
            )
        if code in "GXY":
            return self._cluster(index, code)
        if code == "D":
            return self._directions(index)
        count = 3 if code in THREE_POINTS else 1 if code in ONE_POINT else 2
        record = MeasurementRecord(
            code,
            self._is_on(index),
            tuple(self.name(index, span) for span in _NAMES[:count]),
            self._value(index, code),
            self.number(index, _SIGMA) * (SECOND if code in ANGLES + GEOGRAPHIC else 1.0),
            (self.number(index, _HEIGHTS[0], 0.0), self.number(index, _HEIGHTS[1], 0.0)),
            header=self.header,
            place=self.place(index),
        )
        return record, index + 1

    def _is_on(self, index: int) -> bool:
        return self.file.lines[index][1:2] != "*"

    def _value(self, index: int, code: str) -> float:
        if code in ANGLES:
            return self._angle(index)
        value = self.number(index, _LINEAR)
        if code not in GEOGRAPHIC:
            return value
        try:
            return radians_of_packed(value)
        except ValueError as error:
            raise self.file.error(index, str(error)) from error

    def _angle(self, index: int) -> float:
        degrees, minutes, seconds = (self.number(index, span, 0.0) for span in _PARTS)
        try:
            size = radians_of_parts(abs(degrees), minutes, seconds)
        except ValueError as error:
            raise self.file.error(index, str(error)) from error
        return -size if self.text(index, _PARTS[0]).startswith("-") else size

    def _count(self, index: int) -> int:
        text = self.text(index, _NAMES[2])
        if not text.isdecimal() or not 0 < int(text) <= len(self.file.lines):
            raise self.file.error(index, f"{quoted(text)!r} is not the number of members of this measurement")
        return int(text)

    def _directions(self, index: int) -> tuple[MeasurementRecord, int]:
        """A set: its header is the first direction."""
        station, target = self.name(index, _NAMES[0]), self.name(index, _NAMES[1])
        count, is_on = self._count(index), self._is_on(index)
        members = [self._direction(index, (station, target))]
        for line in range(index + 1, index + 1 + count):
            members.append(self._direction(line, (station, self.name(line, _NAMES[2]))))
        record = MeasurementRecord(
            "D",
            is_on,
            (station,),
            members=tuple(members),
            header=self.header,
            place=self.place(index),
        )
        return record, index + 1 + count

    def _direction(self, index: int, names: tuple[str, str]) -> Member:
        sigma = self.number(index, _SIGMA) * SECOND
        is_on = self._is_on(index)
        return Member(names, (self._angle(index),), sigma, None, (), is_on, self.place(index))

    def _cluster(self, index: int, code: str) -> tuple[MeasurementRecord, int]:
        """A vector, or a cluster of vectors or of positions, with its full covariance."""
        layout, start = self.layout, index
        count = 1 if code == "G" else self._count(index)
        members = []
        for number in range(count):
            if not self.text(index, (0, 1)) == code:
                raise self.file.error(index, f"member {number + 1} of {count} of a {code} is expected here")
            names = tuple(self.name(index, span) for span in _NAMES[: 1 if code == "Y" else 2])
            members.append(self._member(index + 1, names, count - number - 1, self._is_on(start)))
            index += 4 + 3 * (count - number - 1)
        scales = [self.number(start, span, 1.0) for span in layout.scales]
        record = MeasurementRecord(
            code,
            self._is_on(start),
            members[0].names,
            members=tuple(members),
            scales=(scales[0], scales[1], scales[2], scales[3]),
            system=self.text(start, _NAMES[1]) or "XYZ" if code == "Y" else "XYZ",
            header=self._frame(start),
            place=self.place(start),
        )
        return record, index

    def _frame(self, index: int) -> Header:
        """Frame and epoch of a record, or of its file."""
        epoch = self._epoch(index, self.text(index, self.layout.epoch))
        return Header(
            self.text(index, self.layout.frame) or self.header.frame,
            self.header.epoch if math.isnan(epoch) else epoch,
        )

    def _member(self, index: int, names: tuple[str, ...], later: int, is_on: bool) -> Member:
        values = tuple(self.number(index + row, self.layout.value) for row in range(3))
        covariance = np.zeros((3, 3))
        for row in range(3):
            for column in range(row + 1):
                entry = self.number(index + row, self.layout.covariance[column])
                covariance[row, column] = covariance[column, row] = entry
        crossed = tuple(self._block(index + 3 + 3 * block) for block in range(later))
        return Member(names, values, math.nan, covariance, crossed, is_on, self.place(index - 1))

    def _block(self, index: int) -> FloatArray:
        spans = self.layout.covariance
        return np.array([[self.number(index + row, span) for span in spans] for row in range(3)])
