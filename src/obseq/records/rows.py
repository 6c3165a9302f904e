"""Long lists of records as columns: a record is made when somebody asks for it.

A list of half a million observations is some 22 arrays; as records it is ten million Python objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from operator import attrgetter
from types import GenericAlias
from typing import (
    TYPE_CHECKING,
    Generic,
    NamedTuple,
    SupportsIndex,
    TypeAlias,
    TypeVar,
    get_args,
    get_origin,
    overload,
)

import msgspec

from obseq.errors import InputError
from obseq.records.columns import (
    NO_CODE,
    Lazy,
    Texts,
    cells,
    chosen,
    column_of,
    fields_of,
    joined,
    names_of,
    needed,
    records_of,
)
from obseq.records.record import Record

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    from obseq.arrays import BoolArray, FloatArray
    from obseq.records.columns import Column, Columns, Values

Row = TypeVar("Row", bound=Record)
CHUNK = 8192
"""Records that are made at a time when one goes through all: 10 MB of them."""


AnyRows: TypeAlias = "Rows[Any]"
"""A list of records of some class."""


class Stored(NamedTuple):
    """Columns of a file, of which it is not known yet what they are of.

    Attributes:
        columns: By name.
        size: Rows that each has.
        path: Of the file.
    """

    columns: Columns
    size: int
    path: str


class Rows(Sequence[Row], Generic[Row]):
    """A list of records, held as records or as columns; whichever is not there is made when asked for.

    Args:
        kind: The class of the records.
        records: All of them.

    Attributes:
        kind: The class of the records.
        whole: The list that this one was taken from; itself where it is one.

    Example:
        >>> from obseq.records.adjustment import IterationRecord
        >>> steps = Rows(IterationRecord, [IterationRecord(2.5, 0.1), IterationRecord(1.0, None)])
        >>> steps.numbers("max_step").tolist(), steps[-1].sigma0
        ([0.1, nan], 1.0)
    """

    def __init__(self, kind: type[Row], records: Iterable[Row] = ()) -> None:
        self.kind = kind
        self._records: tuple[Row, ...] | None = tuple(records)
        self._size = len(self._records)
        self._made_once: dict[str, Column] = {}
        self._columns: Columns = Lazy(names_of(fields_of(kind)), self._gathered)
        self.whole = self

    @classmethod
    def of(cls, kind: type[Row], columns: Columns, size: int, whole: Rows[Row] | None = None) -> Rows[Row]:
        """A list that is held as columns (see `obseq.records.columns`); fields without any have defaults.

        Args:
            kind: The class of the records.
            columns: By name, all (n, ...).
            size: Their n.
            whole: The list that they were taken from, if any.
        """
        found = cls(kind)
        found._records, found._columns, found._size = None, columns, size
        found.whole = found if whole is None else whole
        return found

    @classmethod
    def from_plain(cls, plain: object, kind: type[Row]) -> Rows[Row]:
        """The list whose plain form is given, or whose columns are.

        Raises:
            msgspec.ValidationError: It is no list of such records.
            InputError: A column is missing.
        """
        if not isinstance(plain, Stored):
            return cls(kind, msgspec.convert(plain, GenericAlias(list, (kind,))))
        missing = [name for name in needed(fields_of(kind)) if name not in plain.columns]
        if missing and plain.size:
            raise InputError(f"{plain.path}: the column {missing[0]} of {kind.__name__} is missing")
        return cls.of(kind, plain.columns, plain.size)

    @classmethod
    def joined(cls, kind: type[Row], parts: Sequence[Rows[Row]]) -> Rows[Row]:
        """Lists one after the other; a column is put together when it is asked for."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else cls(kind)
        names = dict.fromkeys(name for part in parts for name in part.columns)

        def together(name: str) -> Column:
            return joined([part.filled(name) for part in parts])

        return cls.of(kind, Lazy(names, together), sum(map(len, parts)))

    @property
    def columns(self) -> Columns:
        """The columns by name."""
        return self._columns

    def _gathered(self, name: str) -> Column:
        """A column of records, made once."""
        if name not in self._made_once:
            self._made_once[name] = column_of(fields_of(self.kind), list(self._records or ()), name)
        return self._made_once[name]

    def filled(self, name: str) -> Column:
        """A column, of defaults where there is none."""
        return self._columns[name] if name in self._columns else self._by_default(name)

    def _by_default(self, name: str) -> Column:
        few = records_of(self.kind, {key: chosen(self._columns[key], [0]) for key in self._columns}, 1)
        return chosen(column_of(fields_of(self.kind), few, name), [0] * len(self))

    def __len__(self) -> int:
        return self._size

    @overload
    def __getitem__(self, row: SupportsIndex) -> Row: ...
    @overload
    def __getitem__(self, row: slice) -> Rows[Row]: ...
    def __getitem__(self, row: SupportsIndex | slice) -> Row | Rows[Row]:
        if isinstance(row, slice):
            return self.take(range(*row.indices(len(self))))
        if self._records is not None:
            return self._records[row]
        at = range(len(self))[row]
        return self._made(self._columns, slice(at, at + 1))[0]

    def __iter__(self) -> Iterator[Row]:
        if self._records is not None:
            yield from self._records
            return
        columns = dict(self._columns)
        for start in range(0, len(self), CHUNK):
            yield from self._made(columns, slice(start, start + CHUNK))

    def _made(self, columns: Columns, part: slice) -> list[Row]:
        few = {name: chosen(columns[name], part) for name in columns}
        return records_of(self.kind, few, len(range(*part.indices(len(self)))))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Rows | tuple | list) or len(other) != len(self):
            return NotImplemented if not isinstance(other, Rows | tuple | list) else False
        return all(mine == its for mine, its in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((self.kind, len(self)))

    def __repr__(self) -> str:
        return f"Rows of {self.kind.__name__}: {len(self)}"

    def take(self, rows: Iterable[int]) -> Rows[Row]:
        """Some of the rows, in the order of their numbers."""
        import numpy as np

        places = np.fromiter(rows, np.int64)
        if self._records is not None:
            found = Rows(self.kind, map(self._records.__getitem__, places.tolist()))
            found.whole = self.whole
            return found
        few = {name: chosen(self._columns[name], places) for name in self._columns}
        return Rows.of(self.kind, few, len(places), self.whole)

    def changed(self, columns: Columns) -> Rows[Row]:
        """The list with other columns in the places of some."""
        mine = self._columns

        def found(name: str) -> Column:
            return columns[name] if name in columns else mine[name]

        return Rows.of(self.kind, Lazy([*mine, *columns], found), len(self))

    def without(self, *names: str) -> Rows[Row]:
        """The list without the values of some fields: their defaults, or None."""
        gone = tuple(f"{name}." for name in names)
        kept = [name for name in self._columns if name not in names and not name.startswith(gone)]
        return Rows.of(self.kind, Lazy(kept, self._columns.__getitem__), len(self))

    def numbers(self, name: str) -> FloatArray:
        """(n,) a column of numbers, or (n, k) of several; NaN where there is none."""
        import numpy as np

        column = self._column(name)
        if column is None or isinstance(column, Texts):
            return np.full(len(self), np.nan)
        if column.dtype.kind == "f":
            return column
        none = column < 0 if column.dtype == np.int8 else column == np.iinfo(np.int64).min
        return np.where(none, np.nan, column)

    def truths(self, name: str) -> BoolArray:
        """(n,) which rows are true; those without a value are not."""
        import numpy as np

        column = self._column(name)
        return np.zeros(len(self), bool) if column is None else np.asarray(column) > 0

    def texts(self, name: str) -> Texts:
        """A column of texts."""
        import numpy as np

        column = self._column(name)
        return column if isinstance(column, Texts) else Texts(np.full(len(self), NO_CODE, np.int32), ())

    def distinct(self, name: str, rows: BoolArray | None = None) -> dict[str, int]:
        """The different texts of a column, and how often each comes; of some rows (n,) only, if given."""
        import numpy as np

        codes, names = self.texts(name)
        codes = codes if rows is None else codes[rows]
        counts = np.bincount(codes[codes >= 0], minlength=len(names)).tolist()
        return {text: count for text, count in zip(names, counts, strict=True) if count}

    def values(self, name: str) -> Values:
        """A column as Python has it: None where there is none."""
        if self._records is not None:
            return list(map(attrgetter(name), self._records))
        field = next(item for item in fields_of(self.kind) if name in (item.name, item.column))
        return cells(field, self._columns, len(self), field.column)

    def _column(self, name: str) -> Column | None:
        """A column by either name of its field."""
        own = next((field.column for field in fields_of(self.kind) if field.name == name), name)
        return self._columns.get(own)


def hold_as_columns(record: Record) -> None:
    """Makes `Rows` of the lists of a record that are given as tuples of records."""
    for name, kind in _kinds_of_rows(type(record)).items():
        given = getattr(record, name)
        if given is not None and not isinstance(given, Rows):
            msgspec.structs.force_setattr(record, name, Rows(kind, given))


@cache
def _kinds_of_rows(record: type[Record]) -> dict[str, type[Record]]:
    hints = {field.name: (field.type, *get_args(field.type)) for field in msgspec.structs.fields(record)}
    return {
        name: get_args(part)[0] for name, parts in hints.items() for part in parts if get_origin(part) is Rows
    }
