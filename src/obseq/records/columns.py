"""Columns: what lists of records are made of, one array or one list of texts for each field.

Which columns a list has follows from the annotations of its records:

| field | column |
|---|---|
| float | float64; where it may be None, NaN is None |
| int | int64; the smallest one is None |
| bool | int8; -1 is None |
| str | codes (int32) of a table of texts; -1 is None |
| tuple of numbers | float64 (n, k); a column `NAME.there` where it may be None |
| record | its own columns, as `NAME.FIELD`; a column `NAME.there` where it may be None |
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from types import UnionType
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, Union, cast, get_args, get_origin

import msgspec

from obseq.errors import InputError
from obseq.records.record import Record

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import Any

    import numpy as np
    from numpy.typing import NDArray

    from obseq.arrays import Array, FloatArray, IndexArray, IntArray

What = Literal["number", "integer", "truth", "text", "numbers", "record"]
THERE = "there"
"""Last part of the name of the column that says which rows have a value."""
NO_INTEGER = -(2**63)
NO_CODE = -1


class Texts(NamedTuple):
    """A column of texts.

    Attributes:
        codes: (n,) int32, positions in `names`; -1 where there is none.
        names: The texts, each once.
    """

    codes: IndexArray | NDArray[np.int8]
    names: Sequence[str]


Column: TypeAlias = "Array | Texts"
Columns: TypeAlias = Mapping[str, Column]
Values: TypeAlias = "list[Any]"
"""A column as Python has it, or records."""
Places: TypeAlias = "slice | list[int] | IntArray"
"""Of some rows."""


class Field(NamedTuple):
    """A field of a record.

    Attributes:
        name: As Python calls it.
        column: As files call it.
        what: What it holds.
        optional: Whether it may be None.
        inner: Fields of the record that it holds.
        kind: The class of that.
        default: Of a field that is not given; `msgspec.NODEFAULT` of others.
    """

    name: str
    column: str
    what: What
    optional: bool
    inner: tuple[Field, ...]
    kind: type[Record] | None
    default: object


@cache
def fields_of(kind: type[Record]) -> tuple[Field, ...]:
    """The fields of a record whose lists can be columns.

    Raises:
        TypeError: One holds something else than the table above names.
    """
    return tuple(_field(item) for item in msgspec.structs.fields(kind))


def _field(given: msgspec.structs.FieldInfo) -> Field:
    options = get_args(given.type) if get_origin(given.type) in (Union, UnionType) else (given.type,)
    held = [option for option in options if option is not type(None)]
    what = _what(held[0]) if len(held) == 1 else None
    if what is None:
        raise TypeError(f"{given.name}: no column holds {given.type}")
    kind = held[0] if what == "record" else None
    inner = fields_of(kind) if kind else ()
    return Field(given.name, given.encode_name, what, len(options) > 1, inner, kind, given.default)


def _what(held: object) -> What | None:
    plain: dict[object, What] = {float: "number", int: "integer", bool: "truth", str: "text"}
    if held in plain:
        return plain[held]
    if get_origin(held) is tuple:
        return "numbers" if get_args(held)[0] in (float, float | None) else None
    return "record" if isinstance(held, type) and issubclass(held, Record) else None


def names_of(fields: Iterable[Field], before: str = "") -> Iterator[str]:
    """The names of the columns of some fields, those that say what is there behind the others."""
    for field in fields:
        name = before + field.column
        if field.what == "record":
            yield from names_of(field.inner, f"{name}.")
        else:
            yield name
        if field.optional and field.what in ("record", "numbers"):
            yield f"{name}.{THERE}"


def needed(fields: Iterable[Field]) -> list[str]:
    """The names of the columns without which there are no records."""
    return [
        field.column
        for field in fields
        if field.default is msgspec.NODEFAULT and not field.optional and field.what != "record"
    ]


class Lazy(Mapping[str, Column]):
    """Columns that are made when they are asked for, and not kept.

    Args:
        names: Of the columns.
        make: A column, by its name.
    """

    def __init__(self, names: Iterable[str], make: Callable[[str], Column]) -> None:
        self._names, self._make = dict.fromkeys(names), make

    def __getitem__(self, name: str) -> Column:
        if name not in self._names:
            raise KeyError(name)
        return self._make(name)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def chosen(column: Column, rows: Places) -> Column:
    """Some rows of a column: positions or a slice."""
    if isinstance(column, Texts):
        return Texts(column.codes[rows], column.names)
    some: Array = column[rows]
    return some


def joined(parts: Sequence[Column]) -> Column:
    """Columns one after the other; equal texts have one code."""
    import numpy as np

    texts = [part for part in parts if isinstance(part, Texts)]
    if not texts:
        return _stacked(cast("list[Array]", parts))
    names: dict[str, int] = {}
    codes = []
    for part in texts:
        places = [names.setdefault(name, len(names)) for name in part.names]
        codes.append(np.array([*places, NO_CODE], np.int32)[part.codes])
    return Texts(np.concatenate(codes), list(names))


def _stacked(parts: list[Array]) -> Array:
    """Numbers one after the other; what has none in any row gets as many columns as the others have."""
    import numpy as np

    width = max(part[:1].size for part in parts)
    empty = [part.ndim == 2 and part.shape[1] < width for part in parts]
    pairs = zip(parts, empty, strict=True)
    return np.concatenate([np.full((len(part), width), np.nan) if lacks else part for part, lacks in pairs])


def texts_of(values: Sequence[str | None]) -> Texts:
    """The column of some texts."""
    import numpy as np

    names: dict[str, int] = {}
    codes = [NO_CODE if value is None else names.setdefault(value, len(names)) for value in values]
    return Texts(np.array(codes, np.int32), list(names))


def column_of(fields: Sequence[Field], records: Values, name: str) -> Column:
    """A column of some records, None among them where they are parts of others.

    Raises:
        InputError: Tuples of the records are not all of one length.
    """
    first, _, rest = name.partition(".")
    field = next(item for item in fields if item.column == first)
    values = [None if record is None else getattr(record, field.name) for record in records]
    if rest == THERE:
        return _truths([value is not None for value in values])
    return column_of(field.inner, values, rest) if rest else _of_values(field, values, name)


def _of_values(field: Field, values: Values, name: str) -> Column:
    import numpy as np

    if field.what == "text":
        return texts_of(values)
    if field.what == "number":
        return np.array(values, np.float64)  # None is NaN
    if field.what == "integer":
        return np.array([NO_INTEGER if value is None else value for value in values], np.int64)
    if field.what == "truth":
        return _truths(values)
    widths = {len(value) for value in values if value is not None}
    if len(widths) > 1:
        raise InputError(f"{name}: its lists of numbers have different lengths, {min(widths)} and more")
    width = widths.pop() if widths else 0
    rows = [(None,) * width if value is None else value for value in values]
    return np.array(rows, np.float64).reshape(len(rows), width)


def _truths(values: Iterable[bool | None]) -> NDArray[np.int8]:
    import numpy as np

    return np.array([-1 if value is None else value for value in values], np.int8)


def records_of(kind: type[Record], columns: Columns, count: int, before: str = "") -> Values:
    """The records of columns, all of them: cut the columns first."""
    values = [cells(field, columns, count, before + field.column) for field in fields_of(kind)]
    return list(map(kind, *values))


def cells(field: Field, columns: Columns, count: int, name: str) -> Values:
    """The values of a field, row by row."""
    if field.kind is not None:
        return _parts(field, columns, count, name)
    if name not in columns:
        return [_default(field, name)] * count
    column = columns[name]
    if isinstance(column, Texts):
        names = [*column.names, None]
        return [names[code] for code in column.codes.tolist()]
    if field.what == "numbers":
        return _tuples(column, _are_there(columns, name))
    if field.what == "truth":
        return [None if value < 0 else value > 0 for value in column.tolist()]
    values: Values = column.tolist()
    if not field.optional:
        return values
    if field.what == "integer":
        return [None if value == NO_INTEGER else value for value in values]
    return without_nan(values)


def _default(field: Field, name: str) -> object:
    """What a row holds that has no column for a field."""
    if field.default is not msgspec.NODEFAULT:
        return field.default
    if not field.optional:
        raise InputError(f"the column {name} is missing")
    return None


def without_nan(values: Values) -> Values:
    """Numbers, None where they are not known."""
    return [None if value != value else value for value in values]


def _tuples(column: FloatArray, there: list[bool] | None) -> list[tuple[float | None, ...] | None]:
    rows = [tuple(without_nan(row)) for row in column.tolist()]
    if there is None:
        return [*rows]
    return [row if is_there else None for row, is_there in zip(rows, there, strict=True)]


def _are_there(columns: Columns, name: str) -> list[bool] | None:
    """Which rows have a value; None: all."""
    there = columns.get(f"{name}.{THERE}")
    return None if there is None or isinstance(there, Texts) else (there > 0).tolist()


def _parts(field: Field, columns: Columns, count: int, name: str) -> Values:
    assert field.kind is not None
    if not any(f"{name}.{inner}" in columns for inner in names_of(field.inner)):
        return [_default(field, name)] * count
    there = _are_there(columns, name)
    if there is None:
        return records_of(field.kind, columns, count, f"{name}.")
    rows = [row for row, is_there in enumerate(there) if is_there]
    few = {key: chosen(columns[key], rows) for key in columns if key.startswith(f"{name}.")} if rows else {}
    found: Values = [None] * count
    if rows:
        for row, record in zip(rows, records_of(field.kind, few, len(rows), f"{name}."), strict=True):
            found[row] = record
    return found
