"""Networks from tables in memory: dictionaries of columns, or data frames, read as tables in files are.

A table is anything that gives its columns by name: a dictionary of lists or arrays, a pandas data frame. A
column that is a single value has it in all rows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from obseq.errors import InputError
from obseq.formats.columns import Columns
from obseq.formats.tables.clusters import Clusters
from obseq.formats.tables.reader import add_observations, points_in
from obseq.formats.tables.table import OF_POINTS, Table
from obseq.printable import composed
from obseq.reading.text import TextFile
from obseq.survey.model import FieldBook, Points, merge_points

Cell = Any
"""A number or a text, as tables hold them."""

Given = Mapping[str, Sequence[Cell]]
"""Columns by name; a data frame of pandas is one too."""

ANGLE_UNITS = {"rad": "rad", "gon": "gon", "degree": "deg"}
"""Units of angles, and what tables in files call them."""
NOT_GIVEN = ("NAType", "NaTType")
"""Types of what pandas has for a missing value (pandas.NA, whose comparisons have no truth)."""
POINTS, OBSERVATIONS = "points", "observations"
"""What messages call the tables: their rows count from 1, as lines do."""


def points_of(table: Given) -> Points:
    """Points from a table: `name`, `x`, `y`, `z`, and `sx`, `sy`, `sz` of known coordinates.

    A missing or empty sigma (None, NaN, "") means a free coordinate, 0 one that is held; a missing coordinate
    is computed from the observations. Metres, or the units of the system of the points.

    Raises:
        InputError: A column is missing or not known, a name is empty, a value is no finite number, or a
            coordinate that is not given has a sigma.
    """
    columns = _columns(POINTS, table)
    if "unit" in columns:
        raise InputError(f"{POINTS}: column unit is unknown; coordinates are in the units of their system")
    n = max(map(len, columns.values()))
    rows = _Rows(dict.fromkeys(OF_POINTS, [""] * n) | columns if "name" in columns else columns)
    found = points_in(Table(_Cells(POINTS, columns.get("name", []), True, "UTF-8"), rows), [])
    return merge_points([found])


def observations_of(table: Given, angles: str = "rad") -> FieldBook:
    """Observations from a table, in metres and in the unit of angles.

    Columns: `type` (`Hz`, `Zen`, `Dist`, `DH`...: `obseq.survey.KINDS`), `from`, `to`, `value`, `sigma`; and
    where they are needed `setup` (what tells set-ups of one point apart), `orientation` of the set-up
    (`VERT`, the default, `FIX`, `BASC`), `instrument` (a name, for unknowns of its own), `relative_sigma`,
    `from_height`, `to_height`, `backsight`, `unit`, `active` (1 or 0). Correlated rows have the same
    `cluster`, and `covariances` (or `correlations`): numbers, one for each row of the cluster before, in a
    list or with blanks between them. A barycentre has its members in `to`, and `weights`. A table of a
    formula of your own has `formula` in place of `type`.

    Args:
        table: The columns.
        angles: Unit of angles and of their sigmas, where `unit` says no other: "rad", "gon" or "degree".

    Raises:
        InputError: A column is missing or not known, or a value is not what it must be; the row is named.
    """
    if angles not in ANGLE_UNITS:
        raise InputError(f"unknown unit of angles {angles!r}; known: {', '.join(ANGLE_UNITS)}")
    columns = _columns(OBSERVATIONS, table)
    if "setup" in columns:
        columns["set"] = columns.pop("setup")
    ends = zip(columns.get("from", ()), columns.get("to", ()), strict=False)
    file = _Cells(OBSERVATIONS, [f"{origin} -> {target}" for origin, target in ends], True, "UTF-8")
    read, clusters = Columns(), Clusters()
    add_observations(Table(file, _Rows(columns), ANGLE_UNITS[angles]), read, clusters)
    clusters.give(read)
    return read.field_book()


class _Cells(TextFile):
    """What messages say of the rows of a table; `lines` holds what tells them apart."""

    def place(self, index: int) -> str:
        """What messages call a row (from 0), or the whole table (-1)."""
        said = self.lines[index] if 0 <= index < len(self.lines) else ""
        row = "" if index < 0 else f", row {index + 1}" + (f" ({said})" if said else "")
        return self.name + row

    def error(self, index: int, problem: str) -> InputError:
        """An error about a row (from 0)."""
        return InputError(f"{self.place(index)}: {problem}")


class _Rows:
    """Rows of texts under names of columns, as `reading.tables.Rows` are those of a file."""

    head, separator = -1, ","

    def __init__(self, columns: Mapping[str, list[str]]) -> None:
        self.names, self._columns = tuple(columns), columns

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        return ((k, list(cells)) for k, cells in enumerate(zip(*self._columns.values(), strict=True)))


def _columns(what: str, table: Given) -> dict[str, list[str]]:
    """The columns as texts, in lists of one length."""
    if not hasattr(table, "keys"):
        kind = type(table).__name__
        raise InputError(f"{what}: a data frame or a dictionary of columns is wanted, not {kind}")
    columns = {str(name): table[name] for name in table.keys()}  # noqa: SIM118  # a data frame has keys()
    single = {name for name, cells in columns.items() if _is_single(cells)}
    listed = {name: [_text(cell) for cell in cells] for name, cells in columns.items() if name not in single}
    if not listed:
        raise InputError(f"{what}: every column is a single value; at least one must be a list")
    lengths = {name: len(cells) for name, cells in listed.items()}
    n = min(lengths.values())
    if n != max(lengths.values()):
        said = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"{what}: the columns have different lengths: {said}")
    return {name: [_text(cells)] * n if name in single else listed[name] for name, cells in columns.items()}


def _is_single(cells: object) -> bool:
    """Whether a column is one value, that of all its rows."""
    return isinstance(cells, str) or not hasattr(cells, "__iter__") or getattr(cells, "ndim", 1) == 0


def _text(cell: Cell) -> str:
    """A cell as a file has it: numbers come back as they are, several have blanks between them."""
    if isinstance(cell, str):
        return composed(cell.strip())
    if cell is None or type(cell).__name__ in NOT_GIVEN:
        return ""
    if not _is_single(cell):
        return " ".join(map(_text, cell))
    try:
        number = float(cell)
    except (TypeError, ValueError):
        return composed(str(cell))
    if math.isnan(number):
        return ""
    return str(int(number)) if number.is_integer() else repr(number)
