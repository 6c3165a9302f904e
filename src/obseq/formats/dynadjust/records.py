"""What files of DynAdjust hold, DNA and DynaML alike: stations and measurements, as they are written."""

from __future__ import annotations

import math
from typing import NamedTuple

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.reading.xml import Element

ANGLES = "ABKVZD"
"""Types whose value is an angle in degrees, minutes and seconds, and whose sigma is in seconds."""
GEOGRAPHIC = "PQIJ"
"""Types whose value is a latitude or a longitude in degrees, minutes and seconds."""
LENGTHS = "CEMSLHR"
VECTORS = "GXY"
THREE_POINTS = "A"
ONE_POINT = "HRPQIJY"
TYPES = ANGLES + GEOGRAPHIC + LENGTHS + VECTORS


class Place(NamedTuple):
    """A place in a file, for messages.

    Attributes:
        file: Its name.
        line: Line, from 1.
    """

    file: str
    line: int

    @classmethod
    def of(cls, element: Element) -> Place:
        """Where an element of XML begins."""
        return cls(element.file.name, element.line)

    def error(self, problem: str) -> InputError:
        """An error about it."""
        return InputError(f"{self.file}:{self.line}: {problem}")


class Header(NamedTuple):
    """What a file says of all its records.

    Attributes:
        frame: Name of the reference frame; empty when it gives none.
        epoch: Decimal year; NaN when it gives none.
    """

    frame: str = ""
    epoch: float = math.nan


class StationRecord(NamedTuple):
    """A station.

    Attributes:
        name: Its name.
        constraints: Three letters C or F, in the order of the coordinates.
        system: LLH, LLh, UTM or XYZ.
        coordinates: As written: packed degrees, or metres.
        zone: Hemisphere and zone, of UTM.
        description: Words about it.
        place: Where it is written.
    """

    name: str
    constraints: str
    system: str
    coordinates: tuple[float, float, float]
    zone: str
    description: str
    place: Place


class Member(NamedTuple):
    """A direction of a set, or a vector or position of a cluster.

    Attributes:
        names: Points that it names, the first one of a direction being the instrument's.
        values: An angle (rad), or three numbers.
        sigma: Of an angle (rad).
        covariance: (3, 3) of the three numbers; None for an angle.
        crossed: (3, 3) covariances with each later member.
        is_active: False when its line is switched off.
        place: Where it is written.
    """

    names: tuple[str, ...]
    values: tuple[float, ...]
    sigma: float
    covariance: FloatArray | None
    crossed: tuple[FloatArray, ...]
    is_active: bool
    place: Place


class MeasurementRecord(NamedTuple):
    """A measurement; lengths in metres, angles in radians.

    Attributes:
        code: Letter of its type.
        is_active: False when the file switches it off.
        names: Points that it names: one, two, or three (at, backsight, foresight).
        value: Of a single measurement.
        sigma: Of a single measurement.
        heights: Of instrument and target.
        members: Of a set of directions or of a cluster.
        scales: Of variances: v of all, then of latitude, longitude and height.
        system: Coordinates of a cluster of points: LLH or XYZ.
        header: Reference frame and epoch, of this record or of its file.
        place: Where it begins.
    """

    code: str
    is_active: bool
    names: tuple[str, ...]
    value: float = math.nan
    sigma: float = math.nan
    heights: tuple[float, float] = (0.0, 0.0)
    members: tuple[Member, ...] = ()
    scales: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    system: str = "XYZ"
    header: Header = Header()
    place: Place = Place("", 0)


def radians_of_packed(value: float) -> float:
    """Radians of ddd.mmssss.

    Raises:
        ValueError: minutes or seconds are 60 or more.
    """
    size = abs(value)
    degrees = math.floor(size + 1e-12)
    minutes_seconds = (size - degrees) * 100.0
    minutes = math.floor(minutes_seconds + 1e-9)
    seconds = (minutes_seconds - minutes) * 100.0
    return math.copysign(radians_of_parts(degrees, minutes, max(seconds, 0.0)), value)


def radians_of_parts(degrees: float, minutes: float, seconds: float) -> float:
    """Radians of degrees, minutes and seconds.

    Raises:
        ValueError: minutes or seconds are 60 or more.
    """
    if not (0.0 <= minutes < 60.0 and -1e-9 <= seconds < 60.0 + 1e-7):
        raise ValueError(f"{degrees:g} {minutes:g} {seconds:g} has minutes or seconds of 60 or more")
    return math.copysign(math.radians(abs(degrees) + minutes / 60.0 + seconds / 3600.0), degrees)


def decimal_year(text: str) -> float:
    """Decimal year of dd.mm.yyyy; NaN of nothing.

    Raises:
        ValueError: it is no date.
    """
    if not text.strip():
        return math.nan
    from datetime import date

    parts = text.strip().split(".")
    if len(parts) != 3 or not all(part.isdecimal() for part in parts):
        raise ValueError(f"{text.strip()!r} is not a date dd.mm.yyyy")
    day, month, year = (int(part) for part in parts)
    begin, end = date(year, 1, 1), date(year + 1, 1, 1)
    return year + (date(year, month, day) - begin).days / (end - begin).days
