"""Lists of records as tables: columns by name, rows with typed fields, data frames, CSV."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from obseq.errors import InputError
from obseq.packages import require
from obseq.records.record import Record
from obseq.records.rows import Rows
from obseq.writing import write_text

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pandas as pd

Row = TypeVar("Row", bound=Record)
Cells = list[Any]
"""A column: its values, None where a row has none."""


class Table(Mapping[str, Cells], Generic[Row]):
    """A table of a result: `table["residual"]` is a column, `table.rows[0].residual` a typed value.

    Attributes:
        rows: One record each, in the order of the result.

    Example:
        >>> from obseq.records.adjustment import IterationRecord
        >>> steps = Table(IterationRecord, (IterationRecord(2.5, 0.1), IterationRecord(1.0, 0.0)))
        >>> list(steps), steps["sigma0"], steps.where(max_step=0.0).rows[0].sigma0
        (['sigma0', 'max_step'], [2.5, 1.0], 1.0)
    """

    def __init__(self, kind: type[Row], rows: Sequence[Row]) -> None:
        self.rows: tuple[Row, ...] = tuple(rows)
        self._fields = {field.encode_name: field.name for field in msgspec.structs.fields(kind)}
        self._kind = kind

    def __getitem__(self, column: str) -> Cells:
        return [getattr(row, self._name(column)) for row in self.rows]

    def __iter__(self) -> Iterator[str]:
        """Names of the columns of which some row has a value."""
        for column, name in self._fields.items():
            if any(getattr(row, name) is not None for row in self.rows):
                yield column

    def __len__(self) -> int:
        """How many columns there are."""
        return sum(1 for _ in self)

    def __repr__(self) -> str:
        return f"Table of {len(self.rows)} rows: {', '.join(self)}"

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def where(self, **values: object) -> Table[Row]:
        """The rows whose columns have some values: `points.where(name="P1")`."""
        names = {self._name(column): value for column, value in values.items()}
        kept = [row for row in self.rows if all(getattr(row, name) == v for name, v in names.items())]
        return Table(self._kind, kept)

    def frame(self) -> pd.DataFrame:
        """A data frame.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        require("a data frame", "pandas", "pandas")
        import pandas as pd

        return pd.DataFrame(dict(self))

    def csv(self) -> str:
        """The text of a CSV file with a line of names: metres and radians, at full precision."""
        from obseq.spreadsheets import csv_text

        columns = dict(self)
        return csv_text(
            [list(columns), *zip(*(map(_cell, cells) for cells in columns.values()), strict=True)]
        )

    def save(self, path: str | Path) -> None:
        """Writes it as CSV.

        Raises:
            InputError: The name does not end in .csv, or the file cannot be written.
        """
        if not str(path).lower().endswith(".csv"):
            raise InputError(f"{path}: a table is saved as CSV: end the name in .csv (frame() is for others)")
        write_text(path, self.csv())

    def _name(self, column: str) -> str:
        """The field of a column, which may be named by either."""
        if column in self._fields.values():
            return column
        if column not in self._fields:
            raise InputError(f"the table has no column {column!r}; it has {', '.join(self)}")
        return self._fields[column]


AnyTable: TypeAlias = "Table[Any]"


def table_of(record: Record, name: str) -> AnyTable:
    """One list of a record.

    Args:
        record: A whole result.
        name: Of the list.

    Raises:
        InputError: The record has no such list.
    """
    kinds = kinds_of_tables(type(record))
    if name not in kinds:
        raise InputError(f"the result has no table {name!r}; it has {', '.join(kinds)}")
    return Table(kinds[name], getattr(record, name) or ())


@cache
def kinds_of_tables(kind: type[Record]) -> dict[str, type[Record]]:
    """The lists of records that a record has, and of what."""
    found = {name: _row_of(hint) for name, hint in get_type_hints(kind).items()}
    return {name: row for name, row in found.items() if row is not None}


def _row_of(hint: object) -> type[Record] | None:
    """What a tuple of any length holds, where these are records."""
    parts = (hint, *get_args(hint))
    rows = [get_args(part)[0] for part in parts if get_origin(part) in (tuple, Rows)]
    return next((row for row in rows if isinstance(row, type) and issubclass(row, Record)), None)


def _cell(value: object) -> object:
    """A cell: truths as 1 and 0, lists with blanks between, records as JSON, nothing where nothing is."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, tuple):
        return " ".join(str(_cell(item)) for item in value)
    return msgspec.json.encode(value).decode() if isinstance(value, Record) else value
