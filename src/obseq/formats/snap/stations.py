"""Coordinate files of SNAP (`.crd`): stations with their geoid, orders and classes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import CrsError
from obseq.formats.dynadjust.records import Place, radians_of_parts
from obseq.formats.snap.systems import System, system_of
from obseq.reading.angles import SECOND
from obseq.reading.text import TextFile, quoted, read_text

SIDES = {"N": 1.0, "S": -1.0, "E": 1.0, "W": -1.0}
OPTIONS = ("orthometric_heights", "ellipsoidal_heights", "deflections", "geoid_heights", "station_orders")
"""Words of the third line; with `no_` before them they are off."""


@dataclass(frozen=True, eq=False)
class Mark:
    """A station.

    Attributes:
        name: Its code.
        geodetic: Longitude, latitude (degrees) and height above the ellipsoid.
        geoid: Height of the geoid (m), deflections to the east and to the north (rad).
        classes: Its order and other classes, by name in small letters.
        description: Its name in words.
        place: Where it is written.
    """

    name: str
    geodetic: tuple[float, float, float]
    geoid: tuple[float, float, float]
    classes: Mapping[str, str]
    description: str
    place: Place


@dataclass(frozen=True)
class Layout:
    """What stands in the lines of a file.

    Attributes:
        system: Of its coordinates.
        is_orthometric: Whether heights are above the geoid.
        has_deflections: Whether deflections stand after the height.
        has_geoid: Whether geoid heights stand after them.
        is_decimal: Whether latitudes and longitudes are decimal degrees.
        classes: Names of the classes after them.
    """

    system: System
    is_orthometric: bool
    has_deflections: bool
    has_geoid: bool
    is_decimal: bool
    classes: tuple[str, ...]


class Geoid:
    """Geoid heights and deflections as the stations have them."""

    def __init__(self, marks: Mapping[str, Mark]) -> None:
        self._marks = marks

    def at(self, names: Sequence[str], longitudes: FloatArray, latitudes: FloatArray) -> FloatArray:
        """(n, 3) geoid height (m), east and north deflection (rad) of stations."""
        return np.array([self._marks[name].geoid for name in names]).reshape(-1, 3)


def read_marks(path: Path, encoding: str) -> tuple[System, list[Mark]]:
    """The system and the stations of a coordinate file.

    Raises:
        InputError: Naming file and line, what is wrong.
    """
    file = read_text(path, encoding)
    lines = [(index, text) for index, line in enumerate(file.lines) if (text := _data(line))]
    if len(lines) < 2:
        raise file.error(0, "a coordinate file of SNAP begins with a title and the code of its system")
    index, code = lines[1]
    try:
        system = system_of(code)
    except CrsError as error:
        raise file.error(index, str(error)) from error
    layout, first = Layout(system, True, True, True, False, ()), 2
    if len(lines) > 2 and _is_options(lines[2][1]):
        layout, first = _layout(file, lines[2][0], lines[2][1].split(), system), 3
    return system, _marks(file, lines[first:], layout)


def _data(line: str) -> str:
    """A line without its comment."""
    text = line.strip()
    return "" if text.startswith("!") else text.partition(" !")[0].strip()


def _is_options(text: str) -> bool:
    word = text.split()[0].lower()
    return word == "options" or word.removeprefix("no_") in (*OPTIONS, "geoid", "degrees") or "c=" in word


def _layout(file: TextFile, index: int, words: list[str], system: System) -> Layout:
    on: dict[str, bool] = {}
    classes = []
    for word in words[words[0].lower() == "options" :]:
        name = word.lower()
        plain, is_on = name.removeprefix("no_"), not name.startswith("no_")
        if name.startswith("c="):
            classes.append(name[2:])
        elif plain == "station_orders":
            classes += ["order"] * is_on
        elif plain == "geoid":
            on |= {"deflections": is_on, "geoid_heights": is_on}
        elif plain in (*OPTIONS, "degrees"):
            on[plain] = is_on
        else:
            raise file.error(
                index, f"{quoted(word)!r} is no option of a coordinate file ({', '.join(OPTIONS)})"
            )
    return Layout(
        system,
        not on.get("ellipsoidal_heights", False),
        on.get("deflections", False),
        on.get("geoid_heights", False),
        on.get("degrees", False),
        tuple(classes),
    )


def _marks(file: TextFile, lines: Sequence[tuple[int, str]], layout: Layout) -> list[Mark]:
    """The stations; coordinates are brought to longitude and latitude together."""
    found = [_fields(file, index, text.split(), layout) for index, text in lines]
    given = np.array([numbers[:3] for _, numbers, _, _ in found]).reshape(-1, 3)
    geodetic = layout.system.geodetic(given)
    marks = []
    for (index, _), (name, numbers, classes, words), place in zip(
        lines, found, geodetic.tolist(), strict=True
    ):
        north, east, undulation = numbers[3:]
        rise = undulation if layout.is_orthometric and not layout.system.is_geocentric else 0.0
        geoid = undulation, east * SECOND, north * SECOND
        where = place[0], place[1], place[2] + rise
        marks.append(Mark(name, where, geoid, classes, words, Place(file.name, index + 1)))
    return marks


def _fields(
    file: TextFile, index: int, words: list[str], layout: Layout
) -> tuple[str, list[float], dict[str, str], str]:
    """Name, six numbers (three coordinates, deflections to north and east, geoid height), classes, words."""
    name, *rest = words
    file.check_name(index, name)

    def number() -> float:
        if not rest:
            raise file.error(index, f"station {name}: the line ends before its coordinates do")
        return file.number(index, rest.pop(0), "coordinates: {}")

    def angle(sides: str) -> float:
        if layout.is_decimal:
            return number()
        try:
            size = math.degrees(radians_of_parts(number(), number(), number()))
        except ValueError as error:
            raise file.error(index, f"station {name}: {error}") from error
        side = rest.pop(0).upper() if rest else ""
        if side not in sides.split():
            raise file.error(
                index, f"station {name}: {sides.replace(' ', ' or ')} is missing after the angle"
            )
        return size * SIDES[side]

    if layout.system.is_geocentric or layout.system.projection:
        numbers = [number(), number(), number()]
    else:
        latitude, longitude = angle("N S"), angle("E W")
        numbers = [longitude, latitude, number()]
    numbers += [number(), number()] if layout.has_deflections else [0.0, 0.0]
    numbers.append(number() if layout.has_geoid else 0.0)
    if len(rest) < len(layout.classes):
        raise file.error(index, f"station {name}: {', '.join(layout.classes)} are announced and missing")
    classes = dict(zip(layout.classes, rest, strict=False))
    return name, numbers, classes, " ".join(rest[len(layout.classes) :])
