"""Networks from tables in memory, and results as tables: dictionaries of columns, or data frames.

A table is anything that gives its columns by name: a dictionary of lists or arrays, a pandas data frame. A
column that is a single value has it in all rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError
from obseq.formats.columns import Columns, Measure
from obseq.formats.tables.clusters import Clusters, Member
from obseq.formats.tables.reader import BARYCENTRES, TYPES
from obseq.formats.tables.table import CLUSTERED, OFF
from obseq.printable import composed
from obseq.survey.model import FieldBook, Orientation, Points, points_of_lines

if TYPE_CHECKING:
    from obseq.survey.kinds.kind import ObservationKind

Cell = Any
"""A number or a text, as tables hold them."""

Table = Mapping[str, Sequence[Cell]]
"""Columns by name; a data frame of pandas is one too."""

ANGLE_UNITS = {"rad": 1.0, "gon": math.pi / 200.0, "degree": math.pi / 180.0}
POINT_COLUMNS = ("name", "x", "y", "z", "sx", "sy", "sz")
OBSERVATION_COLUMNS = (
    "type",
    "from",
    "to",
    "value",
    "sigma",
    "setup",
    "orientation",
    "instrument",
    "relative_sigma",
    "from_height",
    "to_height",
    "backsight",
    *CLUSTERED,
    "active",
)
NOT_GIVEN = ("NAType", "NaTType")
"""Types of what pandas has for a missing value (pandas.NA, whose comparisons have no truth)."""
POINTS, FILE = "points", "observations"
"""What messages call the tables: their rows count from 1, as lines do."""

_KINDS = {kind.name: kind for kind in TYPES.values() if kind not in BARYCENTRES}


def points_of(table: Table) -> Points:
    """Points from a table: `name`, `x`, `y`, `z`, and `sx`, `sy`, `sz` of known coordinates.

    A missing or empty sigma (None, NaN, "") means a free coordinate, 0 one that is held; a missing coordinate
    is computed from the observations. Metres, or the units of the system of the points.

    Raises:
        InputError: A column is missing or not known, a name is empty, a value is no finite number, or a
            coordinate that is not given has a sigma.
    """
    columns = _columns(POINTS, table, POINT_COLUMNS, ("name",))
    n = len(columns["name"])
    numbers = {name: _numbers(POINTS, name, columns.get(name), n, math.nan) for name in POINT_COLUMNS[1:]}
    coordinates = np.column_stack([numbers[name] for name in "xyz"])
    sigmas = np.column_stack([numbers[f"s{name}"] for name in "xyz"])
    names = [_name(POINTS, row, "name", cell) for row, cell in enumerate(columns["name"])]
    for is_wrong, problem in (
        (sigmas < 0.0, "a sigma is negative"),
        (np.isnan(coordinates) & ~np.isnan(sigmas), "a coordinate that is not given has a sigma"),
    ):
        if is_wrong.any():
            row = int(is_wrong.any(axis=1).argmax())
            raise InputError(f"{POINTS}, row {row + 1} ({names[row]}): {problem}")
    lines: dict[str, int] = {}
    for row, name in enumerate(names, start=1):
        if lines.setdefault(name, row) != row:
            raise InputError(f"{POINTS}, row {row}: point {name} is given twice, first in row {lines[name]}")
    return points_of_lines(names, coordinates, sigmas, POINTS, lines)


def observations_of(table: Table, angles: str = "rad") -> FieldBook:
    """Observations from a table, in metres and in the unit of angles.

    Columns: `type` (`Hz`, `Zen`, `Dist`, `DH`...: `obseq.survey.KINDS`), `from`, `to`, `value`, `sigma`; and
    where they are needed `setup` (what tells set-ups of one point apart), `orientation` of the set-up
    (`VERT`, the default, `FIX`, `BASC`), `instrument` (a name, for unknowns of its own), `relative_sigma`,
    `from_height`, `to_height`, `backsight`, `active` (1 or 0). Correlated rows have the same `cluster`, and
    `covariances` (or `correlations`): numbers, one for each row of the cluster before, in a list or with
    blanks between them. No cell of the first five columns is empty.

    Args:
        table: The columns.
        angles: Unit of angles and of their sigmas: "rad", "gon" or "degree".

    Raises:
        InputError: A column is missing or not known, or a value is not what it must be; the row is named.
    """
    if angles not in ANGLE_UNITS:
        raise InputError(f"unknown unit of angles {angles!r}; known: {', '.join(ANGLE_UNITS)}")
    columns = _columns(FILE, table, OBSERVATION_COLUMNS, OBSERVATION_COLUMNS[:5])
    return _Book(columns, ANGLE_UNITS[angles]).filled()


class _Book:
    """A field book that is filled from columns, set-up by set-up."""

    def __init__(self, columns: Mapping[str, list[Cell]], unit: float) -> None:
        self._given = columns
        self._unit = unit
        self._n = len(columns["type"])
        self._book = Columns()
        self._book.files.append(FILE)
        self._setups: dict[tuple[int, Cell, Orientation, bool], int] = {}
        self._clusters = Clusters()

    def filled(self) -> FieldBook:
        """The book with all rows."""
        for row, measure in enumerate(self._measures()):
            self._book.append(measure, 0, row)
            self._correlate(row, measure)
        self._clusters.give(self._book)
        return self._book.field_book()

    def _measures(self) -> Iterator[Measure]:
        names = ("value", "sigma", "relative_sigma", "from_height", "to_height")
        numbers = {name: _numbers(FILE, name, self._given.get(name), self._n, 0.0) for name in names}
        for row in range(self._n):
            kind, is_active = self._kind(row), self._is_active(row)
            factor = self._unit if kind.is_angle else 1.0
            for name in names[:2]:
                if not self._has(row, name):
                    raise InputError(f"{self._place(row)}: the {name} is missing")
            value, sigma, relative, from_height, to_height = (float(numbers[name][row]) for name in names)
            if not (sigma > 0.0 or (sigma == 0.0 and relative > 0.0)):
                raise InputError(f"{self._place(row)}: the sigma {sigma:g} is not positive")
            problem = kind.problem(factor * value) if is_active else None
            if problem is not None:
                raise InputError(f"{self._place(row)}: the {kind.words} {problem}; correct it, or active 0")
            origin, target = self._point(row, "from"), self._point(row, "to")
            if origin == target and not kind.is_absolute:
                raise InputError(f"{self._place(row)}: {kind.words}: it needs two different points")
            yield Measure(
                kind=kind,
                origin=origin,
                target=target,
                value=factor * value,
                sigma=factor * sigma,
                is_active=is_active,
                relative=relative,
                from_height=from_height,
                to_height=to_height,
                station=self._station(row, kind) if kind.needs_station else -1,
                group=self._book.instrument(str(self._given["instrument"][row]))
                if self._has(row, "instrument")
                else -1,
                backsight=self._point(row, "backsight") if self._has(row, "backsight") else -1,
            )

    def _correlate(self, row: int, measure: Measure) -> None:
        given = [name for name in CLUSTERED[1:] if self._has(row, name)]
        if len(given) > 1 or (given and not self._has(row, "cluster")) or (given and measure.relative):
            raise InputError(
                f"{self._place(row)}: a correlated row has covariances or correlations, the name of its "
                "cluster and no relative_sigma"
            )
        if self._has(row, "cluster"):
            numbers = self._listed(row, given[0]) if given else []
            unit = self._unit if measure.kind.is_angle else 1.0
            member = Member(row, measure.sigma, unit, self._place(row))
            self._clusters.add(str(self._given["cluster"][row]), member, numbers, given == ["correlations"])

    def _listed(self, row: int, name: str) -> list[float]:
        """The numbers of a cell: a text, a list or a single one."""
        cell = self._given[name][row]
        parts = cell.split() if isinstance(cell, str) else np.atleast_1d(cell).tolist()
        return _numbers(FILE, name, parts, len(parts), 0.0).tolist()

    def _place(self, row: int) -> str:
        return f"{FILE}, row {row + 1} ({self._given['from'][row]} -> {self._given['to'][row]})"

    def _kind(self, row: int) -> ObservationKind:
        name = str(self._given["type"][row])
        if name not in _KINDS:
            raise InputError(f"{self._place(row)}: unknown type {name!r}; known: {', '.join(_KINDS)}")
        return _KINDS[name]

    def _has(self, row: int, name: str) -> bool:
        return name in self._given and not _is_empty(self._given[name][row])

    def _is_active(self, row: int) -> bool:
        """Whether a row is not switched off: by 1 and 0, True and False, or their words; nothing means 1."""
        if not self._has(row, "active"):
            return True
        cell = self._given["active"][row]
        word = (cell if isinstance(cell, str) else f"{cell:g}").strip().lower()
        if word not in OFF:
            raise InputError(f"{self._place(row)}: active is {cell!r}; 1 or 0 is needed")
        return OFF[word]

    def _point(self, row: int, name: str) -> int:
        text = _name(FILE, row, name, self._given[name][row])
        return self._book.names.setdefault(text, len(self._book.names))

    def _station(self, row: int, kind: ObservationKind) -> int:
        """The set-up of an observation: one for each point, entry of `setup` and orientation."""
        origin, setup = (
            self._point(row, "from"),
            self._given["setup"][row] if self._has(row, "setup") else None,
        )
        orientation = self._orientation(row, kind)
        key = (origin, setup, orientation, kind.is_from_north)
        if key not in self._setups:
            self._setups[key] = self._book.open_station(origin, orientation)
        return self._setups[key]

    def _orientation(self, row: int, kind: ObservationKind) -> Orientation:
        if not self._has(row, "orientation"):
            return Orientation.FIX if kind.is_from_north else Orientation.VERT
        word = str(self._given["orientation"][row])
        name = word.removeprefix("#").upper()
        if name not in Orientation.__members__:
            known = ", ".join(Orientation.__members__)
            raise InputError(f"{self._place(row)}: unknown orientation {word!r}; known: {known}")
        return Orientation[name]


def _columns(what: str, table: Table, known: Sequence[str], wanted: Sequence[str]) -> dict[str, list[Cell]]:
    """The columns as lists of one length; those that are missing or unknown are an error."""
    if not hasattr(table, "keys"):
        kind = type(table).__name__
        raise InputError(f"{what}: a data frame or a dictionary of columns is wanted, not {kind}")
    names = [str(name) for name in table.keys()]  # noqa: SIM118  # a data frame gives its columns by keys()
    missing = [name for name in wanted if name not in names]
    unknown = [name for name in names if name not in known]
    if missing or unknown:
        said = f"lacks {', '.join(missing)}" if missing else f"has {', '.join(unknown)}, which nothing uses"
        raise InputError(f"{what}: the table {said}; its columns may be {', '.join(known)}")
    columns = {name: table[name] for name in names}
    single = {name for name, cells in columns.items() if _is_single(cells)}
    listed = {name: list(cells) for name, cells in columns.items() if name not in single}
    if not listed:
        raise InputError(f"{what}: every column is a single value; at least one must be a list")
    lengths = {name: len(cells) for name, cells in listed.items()}
    n = min(lengths.values())
    if n != max(lengths.values()):
        said = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"{what}: the columns have different lengths: {said}")
    return {name: [cells] * n if name in single else listed[name] for name, cells in columns.items()}


def _is_single(cells: object) -> bool:
    """Whether a column is one value, that of all its rows."""
    return isinstance(cells, str) or not hasattr(cells, "__iter__") or getattr(cells, "ndim", 1) == 0


def _numbers(
    what: str, name: str, values: Sequence[Cell] | None, n: int, empty: float
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """(n,) numbers of a column; what is empty, or a missing column, has the value given."""
    found = np.full(n, empty)
    for row, value in enumerate(values or ()):
        try:
            found[row] = empty if _is_empty(value) else float(value)
        except (TypeError, ValueError):
            raise InputError(f"{what}, row {row + 1}: {name} is {value!r}, not a number") from None
        if math.isinf(found[row]):
            raise InputError(f"{what}, row {row + 1}: {name} is {value!r}, not a finite number")
    return found


def _name(what: str, row: int, column: str, cell: Cell) -> str:
    """The name of a point."""
    if _is_empty(cell):
        raise InputError(f"{what}, row {row + 1}: {column} is empty; the name of a point is needed")
    return composed(str(cell))


def _is_empty(value: Cell) -> bool:
    if value is None or type(value).__name__ in NOT_GIVEN:
        return True
    return bool(value == "") or (isinstance(value, float) and math.isnan(value))
