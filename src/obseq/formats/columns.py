"""The columns of a field book while files are read."""

from __future__ import annotations

from array import array
from dataclasses import replace
from struct import Struct
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.reading.text import TextFile
from obseq.survey.kinds.directions import AZIM
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.model import (
    Cluster,
    FieldBook,
    Group,
    GroupKind,
    Observations,
    Orientation,
    Stations,
    group_by_station,
)


class Measure(NamedTuple):
    """One observation as read, in metres and radians.

    Attributes:
        kind: Its kind.
        origin: Row of the point it is measured from.
        target: Row of the point it is measured to.
        value: As read.
        sigma: Its absolute part.
        is_active: False when the file switches it off.
        relative: What is added to the sigma (see `Observations.relative_sigmas`).
        from_height: Height of the instrument.
        to_height: Height of the target.
        station: Its station; -1 for none.
        group: Its group; -1 for none.
        backsight: Row of the third point, of an angle; -1 for none.
    """

    kind: ObservationKind
    origin: int
    target: int
    value: float
    sigma: float
    is_active: bool = True
    relative: float = 0.0
    from_height: float = 0.0
    to_height: float = 0.0
    station: int = -1
    group: int = -1
    backsight: int = -1


class Columns:
    """Collects observations, stations and groups of one file after another."""

    def __init__(self) -> None:
        self.names: dict[str, int] = {}
        self.files: list[str] = []
        self.warnings: list[str] = []
        self.groups: list[Group] = []
        self._clusters: list[Cluster] = []
        self._instruments: dict[str, int] = {}
        self._group_names: dict[str, int] = {}
        self._rows = bytearray()
        self._origins, self._orientations = array("i"), array("b")

    def __len__(self) -> int:
        return len(self._rows) // _ROW.size

    def open_file(self, file: TextFile) -> int:
        """Index of a file whose lines follow."""
        self.files.append(file.name)
        return len(self.files) - 1

    def point(self, file: TextFile, index: int, name: str) -> int:
        """Row of a point, which line `index` names."""
        row = self.names.get(name)
        if row is None:
            file.check_name(index, name)
            row = self.names[name] = len(self.names)
        return row

    def open_station(self, origin: int, orientation: Orientation) -> int:
        """Index of a new station."""
        self._origins.append(origin)
        self._orientations.append(orientation)
        return len(self._origins) - 1

    def station_of(self, kind: ObservationKind, origin: int, plumb: dict[int, int]) -> int:
        """Station of an observation: azimuths have their own, others share the plumb one of their point.

        Args:
            kind: What is observed.
            origin: Row of its point.
            plumb: Plumb stations by the row of their point; takes the one that is opened.

        Returns:
            Its index; -1 where the kind is read on no instrument.
        """
        if not kind.needs_station:
            return -1
        if kind is AZIM:
            return self.open_station(origin, Orientation.FIX)
        if origin not in plumb:
            plumb[origin] = self.open_station(origin, Orientation.VERT)
        return plumb[origin]

    def open_group(self, name: str, parent: int = -1, numbers: tuple[float, ...] = ()) -> int:
        """Index of a new group of observations that share unknowns, or numbers that their formula takes."""
        return self._add_group(Group(name, parent, numbers))

    def _add_group(self, group: Group) -> int:
        """Index of a group, whose name gets a number where there is one of that name already."""
        seen = self._group_names[group.name] = self._group_names.get(group.name, 0) + 1
        unnamed = group.numbers or seen == 1
        self.groups.append(group if unnamed else replace(group, name=f"{group.name} ({seen})"))
        return len(self.groups) - 1

    def open_barycentre(self, members: tuple[int, ...], weights: tuple[float, ...]) -> int:
        """Index of a new group: the conditions of one barycentre."""
        self.groups.append(Group("barycentre", members=members, weights=weights))
        return len(self.groups) - 1

    def open_normal_row(self, members: tuple[int, ...], coefficients: tuple[float, ...]) -> int:
        """Index of a new group: the points of a row of normal equations, and three coefficients of each."""
        self.groups.append(Group("normal equations", members=members, weights=coefficients))
        return len(self.groups) - 1

    def open_frame(self, name: str) -> int:
        """Index of a new group of the distances of a polar frame."""
        return self._add_group(Group(name, kind=GroupKind.FRAME))

    def instrument(self, name: str) -> int:
        """Index of the group of an instrument, which several files may name; -1 for no name."""
        if not name:
            return -1
        if name not in self._instruments:
            self._instruments[name] = len(self.groups)
            self.groups.append(Group(name, kind=GroupKind.INSTRUMENT))
        return self._instruments[name]

    def append(self, measure: Measure, file: int, index: int) -> None:
        """Adds an observation, read in line `index` (from 0) of a file."""
        kind, origin, target, value, sigma, is_active, *more, station, group, third = measure
        integers = (kind.code, origin, target, third, station, group, file, index + 1)
        self.add(integers, (value, abs(sigma), *more), is_active)

    def add(self, integers: tuple[int, ...], numbers: tuple[float, ...], is_active: bool) -> None:
        """Adds an observation without a `Measure`, in less time.

        Args:
            integers: Code, rows of its points (from, to, backsight), station, group, file, line (from 1).
            numbers: Value, sigma, relative sigma, heights of instrument and target.
            is_active: False when the file switches it off.
        """
        self._rows += _ROW.pack(*integers, *numbers, is_active)

    def correlate(self, rows: list[int], covariance: FloatArray) -> None:
        """Gives observations that have been added a covariance (k, k), in the order of their rows."""
        self._clusters.append(Cluster(np.array(rows, np.int64), covariance))

    def field_book(self) -> FieldBook:
        """Everything read; stations without an active observation are dropped."""
        rows = np.frombuffer(bytes(self._rows), _ROWS)
        columns = {name: rows[name].copy() for name in (*_INTEGERS, *_NUMBERS, "active")}
        active, declared = columns["active"], columns["stations"]
        used = np.zeros(len(self._origins) + 1, np.bool_)
        used[declared[active]] = True
        used[-1] = False
        order = np.where(used, np.cumsum(used) - 1, -1).astype(np.int32)
        stations, kept = order[declared], used[:-1]
        starts, members = group_by_station(stations, int(kept.sum()))
        return FieldBook(
            point_names=tuple(self.names),
            observations=Observations(
                **columns | {"types": columns["types"].astype(np.int16), "stations": stations}
            ),
            stations=Stations(
                origins=np.array(self._origins, np.int32)[kept],
                orientations=np.array(self._orientations, np.int8)[kept],
                starts=starts,
                members=members,
            ),
            files=tuple(self.files),
            groups=tuple(self.groups),
            clusters=tuple(self._clusters),
            warnings=tuple(self.warnings),
        )


_INTEGERS = (
    "types",
    "from_points",
    "to_points",
    "backsights",
    "stations",
    "groups",
    "file_indices",
    "lines",
)
_NUMBERS = ("values", "sigmas", "relative_sigmas", "from_heights", "to_heights")
_ROW = Struct(f"={len(_INTEGERS)}i{len(_NUMBERS)}d?")
"""One observation in the bytes of `Columns`."""
_ROWS = np.dtype(
    [*((name, "i4") for name in _INTEGERS), *((name, "f8") for name in _NUMBERS), ("active", "?")]
)
"""The same, for NumPy."""
