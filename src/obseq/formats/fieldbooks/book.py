"""A field book: set-ups, heights of both ends, readings, first values; and what observations it makes.

Every reader of field books fills one. Readings stay as the instrument gave them: faces are folded, sets
reduced, and means taken where the network is put together (`survey/checks/both_faces`).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.formats.default_sigmas import lacking
from obseq.formats.levelled_points import hold_plans
from obseq.formats.project import Project, Reader, Reading
from obseq.formats.stochastic import NAME_OF, StochasticModel
from obseq.printable import listed
from obseq.reading.angles import FULL_TURN, RIGHT_ANGLE
from obseq.reading.text import TextFile, quoted, read_text
from obseq.survey.kinds.directions import HZ, ZEN
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.kinds.registry import codes
from obseq.survey.model import points_of_lines

SHOWN = 5
"""Names or places that a warning lists."""
LIFTED = frozenset(codes(DIST, ZEN, DH))
"""Kinds that the heights of both ends have a part in, and that say something of heights."""
KILOMETRE = 1000.0


class Sight(NamedTuple):
    """What one pointing of the telescope gave, in radians and metres; None for what was not read.

    Attributes:
        direction: Reading of the horizontal circle, clockwise.
        zenith: Of the vertical circle, from the zenith; beyond half a turn in the second face.
        slope: Slope distance, corrected for prism and atmosphere; none where it is not above zero.
        flat: Horizontal distance, where there is no slope distance.
    """

    direction: float | None = None
    zenith: float | None = None
    slope: float | None = None
    flat: float | None = None


class _Staff(NamedTuple):
    """A reading of a levelling staff: its line, point, reading and distance (m), whether it is backwards."""

    line: int
    name: str
    reading: float
    length: float
    is_back: bool


class _Worth(NamedTuple):
    """Of a kind of observation: its sigmas, and whether heights of ends have a part."""

    sigma: float
    relative: float
    is_lifted: bool


class _SetUp:
    """A set-up of the instrument: row of its point, stations once it needs one, points sighted so far."""

    def __init__(self, origin: int, height: float) -> None:
        self.origin, self.height = origin, height
        self.stations: dict[int, int] = {}
        self.sighted: set[int] = set()
        self.reference: tuple[int, int, float] | None = None


class Book:
    """Set-ups and sights, as readers find them.

    Attributes:
        target_height: Of the sights that follow (m).
        file: The file that is read.
    """

    def __init__(self, reading: Reading, nowhere: str) -> None:
        """Begins a book.

        Args:
            reading: How the files are read.
            nowhere: What such files set an instrument up with, for the error about sights before it.
        """
        self._columns, self._nowhere = Columns(), nowhere
        self._model = StochasticModel(reading.sigmas, reading.instruments)
        self._known_elsewhere = reading.has_points
        self._places: dict[str, tuple[float, float, float]] = {}
        self._lines: dict[str, int] = {}
        self._held: set[str] = set()
        self._left_out: dict[str, list[str]] = defaultdict(list)
        self._notes: list[str] = []
        self._set_ups: dict[str, _SetUp] = {}
        self._set_up: _SetUp | None = None
        self._staffs: list[_Staff] = []
        self._instruments: dict[str, tuple[int, Mapping[str, float], dict[int, _Worth]]] = {}
        self.use("")

    def open(self, file: TextFile) -> None:
        """Begins a file; the set-up of the one before ends."""
        self._end()
        self.file, self._number = file, self._columns.open_file(file)
        self._set_up, self._set_ups, self.target_height = None, {}, 0.0

    def use(self, instrument: str) -> None:
        """The instrument of the sights that follow; "" for one without a name."""
        name = named(instrument) if instrument.strip() else ""
        if name not in self._instruments:
            self._instruments[name] = self._columns.instrument(name), self._model.of(name), {}
        self._group, self._given, self._worth = self._instruments[name]

    def set_up(self, index: int, name: str, height: float = 0.0, key: str = "") -> None:
        """The instrument stands on a point now, with a circle of its own.

        Args:
            index: Line (from 0).
            name: Of the point.
            height: Of the instrument above it (m).
            key: What the file calls the set-up; one that it comes back to goes on.
        """
        self._end()
        if key and key in self._set_ups:
            self._set_up = self._set_ups[key]
            return
        origin = self._columns.point(self.file, index, name)
        self._set_up = _SetUp(origin, height)
        self._set_ups[key] = self._set_up

    @property
    def is_set_up(self) -> bool:
        """Whether the instrument stands somewhere."""
        return self._set_up is not None

    def lift(self, index: int, height: float) -> None:
        """The height of the instrument of the set-up that is open (m)."""
        self._standing(index).height = height

    def take_down(self) -> None:
        """The set-up ends; what follows is of another one."""
        self._end()
        self._set_up = None

    def reference(self, index: int, name: str, reading: float) -> None:
        """The circle was set to a reading (rad) at a point: a sight, unless the set-up has others of it."""
        self._standing(index).reference = index, self._columns.point(self.file, index, name), reading

    def sight(self, index: int, name: str, sight: Sight) -> None:
        """Takes the readings of a sight in line `index` (from 0)."""
        set_up = self._standing(index)
        target = self._columns.point(self.file, index, name)
        if target == set_up.origin:
            self.leave_out(index, "sights of a station to itself")
            return
        set_up.sighted.add(target)
        if sight.direction is not None:
            self._add(set_up, index, HZ, target, sight.direction % FULL_TURN)
        if sight.zenith is not None:
            self._add(set_up, index, ZEN, target, sight.zenith % FULL_TURN)
        if sight.slope is not None and sight.slope > 0.0:
            self._add(set_up, index, DIST, target, sight.slope)
        elif sight.flat is not None and sight.flat > 0.0:
            self._add(set_up, index, DIST_HZ, target, sight.flat)

    def observe(
        self, index: int, name: str, kind: ObservationKind, value: float, *, is_active: bool = True
    ) -> None:
        """Takes one observation of a point from the set-up, one that the file switches off too."""
        set_up = self._standing(index)
        target = self._columns.point(self.file, index, name)
        set_up.sighted.add(target)
        self._add(set_up, index, kind, target, value, is_active)

    def staff(self, index: int, name: str, reading: float, length: float, *, is_back: bool) -> None:
        """Takes a reading of a levelling staff and its distance (m); a backsight elsewhere begins a turn."""
        if is_back and any(staff.is_back and staff.name != name for staff in self._staffs):
            self.end_turn()
        self._staffs.append(_Staff(index, name, reading, length, is_back))

    def end_turn(self) -> None:
        """Ends a turn of a level: its height difference is the mean of its readings."""
        back, fore = ([s for s in self._staffs if s.is_back == is_back] for is_back in (True, False))
        self._staffs = []
        if not (back and fore):
            return
        rise = sum(s.reading for s in back) / len(back) - sum(s.reading for s in fore) / len(fore)
        length = sum(s.length for s in back) / len(back) + sum(s.length for s in fore) / len(fore)
        self._level(fore[0].line, back[0].name, fore[0].name, rise, length)

    def _level(self, index: int, origin: str, target: str, rise: float, length: float) -> None:
        """Takes a height difference of one turn, between two staffs, and the length of its sights (m)."""
        ends = [self._columns.point(self.file, index, name) for name in (origin, target)]
        names = ("height-per-turn", *(["height-per-km"] if length > 0.0 else []), "height")
        name = next((name for name in names if name in self._given), names[-1])
        share = math.sqrt(length / KILOMETRE) if name == "height-per-km" else 1.0
        sigma = self._sigma(index, DH, name) * share
        measure = Measure(DH, ends[0], ends[1], rise, sigma, group=self._group)
        self._columns.append(measure, self._number, index)

    def place(self, index: int, name: str, xyz: tuple[float, float, float], is_known: bool = False) -> None:
        """Coordinates of a point: east, north, height (m), NaN where there are none; the first ones count.

        Args:
            index: Line (from 0).
            name: Of the point.
            xyz: Its coordinates.
            is_known: Whether the file calls them control: they are held then, unless other files say what is.
        """
        if name not in self._places:
            self.file.check_name(index, name)
            self._places[name], self._lines[name] = xyz, index + 1
        if is_known and not self._known_elsewhere:
            self._held.add(name)

    def leave_out(self, index: int, what: str) -> None:
        """Counts what has no part, to be told."""
        self._left_out[what].append(self.file.place(index))

    def note(self, text: str) -> None:
        """Something to be told."""
        self._notes.append(f"{self.file.name}: {text}")

    def read(self, index: int, text: str, reader: Callable[[str], float], what: str) -> float:
        """A number of line `index` as a reader takes it; the error names it otherwise."""
        try:
            return reader(text)
        except ValueError as error:
            raise self.file.error(index, f"{what}: {error}") from error

    def length(self, index: int, text: str, metre: float, what: str) -> float | None:
        """A length in metres; None for an empty text."""
        return self.file.number(index, text, f"{what}: {{}}") * metre if text.strip() else None

    def _standing(self, index: int) -> _SetUp:
        if self._set_up is None:
            raise self.file.error(
                index, f"nothing before this sight says where the instrument stands: {self._nowhere}"
            )
        return self._set_up

    def _end(self) -> None:
        """Ends a set-up: the reading to its reference counts where nothing else was read there."""
        self.end_turn()
        if self._set_up is None or self._set_up.reference is None:
            return
        index, target, reading = self._set_up.reference
        self._set_up.reference = None
        if target not in self._set_up.sighted and target != self._set_up.origin and self._set_up.sighted:
            self._set_up.sighted.add(target)
            self._add(self._set_up, index, HZ, target, reading % FULL_TURN)

    def _add(
        self, set_up: _SetUp, index: int, kind: ObservationKind, target: int, value: float, is_on: bool = True
    ) -> None:
        sigma, relative, is_lifted = self._worth.get(kind.code) or self._look_up(index, kind)
        lifts = (set_up.height, self.target_height) if is_lifted else (0.0, 0.0)
        station = self._columns.station_of(kind, set_up.origin, set_up.stations)
        places = (kind.code, set_up.origin, target, -1, station, self._group, self._number, index + 1)
        self._columns.add(places, (value, sigma, relative, *lifts), is_on)

    def _look_up(self, index: int, kind: ObservationKind) -> _Worth:
        """What observations of a kind are worth, once for each instrument."""
        relative = self._given.get("distance-ppm", 0.0) if kind in (DIST, DIST_HZ) else 0.0
        sigma = self._sigma(index, kind, NAME_OF[kind])
        found = self._worth[kind.code] = _Worth(sigma, relative, kind.code in LIFTED)
        return found

    def _sigma(self, index: int, kind: ObservationKind, name: str) -> float:
        problem = lacking(name, self._given)
        if problem:
            raise self.file.error(index, f"{kind.words}: {problem}")
        return self._given[name]

    def project(self) -> Project:
        """The network, once all files are read.

        Raises:
            InputError: No observation is in them.
        """
        self._end()
        if not len(self._columns):
            passed = "; ".join(self._told())
            raise InputError(f"{', '.join(self._columns.files)}: no sight is in it. {passed}".strip())
        names = list(self._columns.names)
        self._drop_carried(self._columns.names.keys())
        unknown = (math.nan, math.nan, math.nan)
        places = np.array([self._places.get(name, unknown) for name in names]).reshape(-1, 3)
        sigmas = np.full_like(places, np.nan)
        held = np.array([name in self._held for name in names])
        sigmas[held] = np.where(np.isnan(places[held]), np.nan, 0.0)
        book = self._columns.field_book()
        if not np.isin(book.observations.types, tuple(LIFTED)).any():
            places[:, 2], sigmas[:, 2] = 0.0, 0.0  # a book in plan
        points = points_of_lines(names, places, sigmas, self._columns.files[0], self._lines)
        return Project(
            hold_plans(points, book),
            replace(book, warnings=(*book.warnings, *self._notes, *self._told())),
            stochastic=self._model,
            centred=tuple(range(len(self._columns))),
        )

    def _drop_carried(self, names: Collection[str]) -> None:
        """Takes the coordinates from points that have those of an earlier one.

        An instrument that moved on with its old coordinates says no place, and a sight between equal
        places has no direction.
        """
        first: dict[tuple[float, float, float], str] = {}
        carried = {
            name: at
            for name, place in self._places.items()
            if name in names and not math.isnan(place[0])
            if (at := first.setdefault(place, name)) != name and name not in self._held
        }
        for name in carried:
            del self._places[name]
        if carried:
            shown = listed([f"{name} as {at}" for name, at in carried.items()], SHOWN)
            self.note(
                f"coordinates that an earlier point has already say no place, and do not count: {shown}"
            )

    def _told(self) -> Iterator[str]:
        files, seen = ", ".join(self._columns.files), self._columns.names.keys()
        placed = self._places.keys() & seen
        held = sorted(self._held & seen)
        if placed - self._held:
            count = len(placed - self._held)
            yield f"{files}: coordinates of {count} points are first values, no known ones"
        if held:
            yield f"{files}: {len(held)} control points are held: {listed(held, SHOWN)}"
        if len(placed) < len(self._places):
            unseen = listed([name for name in self._places if name not in seen], SHOWN)
            count = len(self._places) - len(placed)
            yield f"{files}: {count} points with coordinates that nothing observes have no part: {unseen}"
        for what, places in self._left_out.items():
            yield f"{len(places)} {what} are left out: {listed(places, SHOWN)}"


class _File(Protocol):
    """A file of a format, which fills a book."""

    def read(self) -> None:
        """Takes all of it."""


def reader_of(nowhere: str, opened: Callable[[Book, TextFile], _File]) -> Reader:
    """What reads field books of a format, one after the other, into one.

    Args:
        nowhere: What such files set an instrument up with.
        opened: Opens a file for a book.
    """

    def read(paths: tuple[Path, ...], reading: Reading) -> Project:
        book = Book(reading, nowhere)
        for path in paths:
            opened(book, read_text(path, reading.encoding)).read()
        return book.project()

    return read


def named(text: str) -> str:
    """The name of a point as files of networks can hold it: blanks inside become underscores."""
    return "_".join(text.split())


def unfilled(text: str) -> str:
    """A name without the zeros that fill its field."""
    return named(text.lstrip(" 0")) or "0"


def from_horizon(angle: float) -> float:
    """Zenith angle (rad) of one that is counted from the horizon."""
    return (RIGHT_ANGLE - angle) % FULL_TURN


def shown(text: str) -> str:
    """A text of a file in a message."""
    return repr(quoted(text)[:40])
