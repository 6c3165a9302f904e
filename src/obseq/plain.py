"""Dataclasses as plain values (what JSON holds) and back, with errors that say where a value is wrong.

A field is called in the plain form as in the class, unless its metadata gives another `key` (`from` is no
name in Python). A field that has a default is left out while it is None, unless its metadata has `null`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from obseq.dataclass import dataclass
from obseq.errors import InputError

if TYPE_CHECKING:
    import json
    from collections.abc import Hashable

Record = TypeVar("Record")
Reader = Callable[[object], object]
_SIMPLE = frozenset((float, int, bool, str, type(None)))
"""Types whose values are plain as they are."""


class _WrongValueError(Exception):
    """A value is not what its field takes; the path to it is completed on the way up."""

    def __init__(self, problem: str, path: str = "") -> None:
        super().__init__(problem)
        self.problem = problem
        self.path = path


@dataclass(frozen=True)
class _Layout:
    """The fields of a class: their keys, which must be there, which are written when None, their readers."""

    keys: tuple[str, ...]
    names: tuple[str, ...]
    required: tuple[bool, ...]
    written: tuple[bool, ...]
    values: Callable[[object], tuple[object, ...]]
    readers: tuple[Reader, ...]


def to_plain(record: object) -> dict[str, object]:
    """The fields of a dataclass by key, dataclasses inside as dictionaries and tuples as lists."""
    kind: object = type(record)
    layout = _layout(kind)
    rows = zip(layout.keys, layout.values(record), layout.written, strict=True)
    return {
        key: value if type(value) in _SIMPLE else _plain(value)
        for key, value, written in rows
        if written or value is not None
    }


def to_labelled(record: object) -> dict[str, object]:
    """The plain form of what a file of ours holds: its `format` and `version` come first."""
    plain = to_plain(record)
    return {key: plain.pop(key) for key in ("format", "version")} | plain


def from_plain(kind: type[Record], value: object, what: str) -> Record:
    """The dataclass whose plain form is given; keys that it does not know are left aside.

    Args:
        kind: the class.
        value: its plain form.
        what: how messages call it.

    Raises:
        InputError: something is missing or is not what it must be; the message says where.
    """
    try:
        return cast("Record", _reader(cast("Hashable", kind))(value))
    except _WrongValueError as error:
        raise InputError(f"{what}: {error.path.lstrip('.') or 'it'} {error.problem}") from None


def encoded(value: object, encoder: json.JSONEncoder) -> str:
    """JSON of an encoder that refuses what JSON cannot write: null stands for that."""
    try:
        return encoder.encode(value)
    except ValueError:  # something is not finite: rare, and looking for it first would cost more than writing
        return encoder.encode(finite(value))


def finite(value: object) -> object:
    """The value with None for what JSON cannot write: infinities and not-a-numbers."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        if _SIMPLE.issuperset(map(type, value)):
            return [None if type(item) is float and not math.isfinite(item) else item for item in value]
        return [finite(item) for item in value]
    return value


def _plain(value: object) -> object:
    if isinstance(value, list | tuple):
        return list(value) if _SIMPLE.issuperset(map(type, value)) else [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return value if value is None or isinstance(value, str | float | int) else to_plain(value)


@functools.cache
def _layout(kind: type) -> _Layout:
    fields = dataclasses.fields(kind)
    hints = get_type_hints(kind)
    names = tuple(field.name for field in fields)
    get = attrgetter(*names)
    required = tuple(field.default is MISSING and field.default_factory is MISSING for field in fields)
    return _Layout(
        tuple(field.metadata.get("key", field.name) for field in fields),
        names,
        required,
        tuple(must or "null" in field.metadata for must, field in zip(required, fields, strict=True)),
        get if len(names) > 1 else lambda record: (get(record),),
        tuple(_reader(hints[name]) for name in names),
    )


@functools.cache
def _reader(hint: object) -> Reader:
    """What turns the plain form into a value of this type."""
    if dataclasses.is_dataclass(hint):
        return functools.partial(_read_record, hint)
    if get_origin(hint) is types.UnionType:
        return functools.partial(_read_optional, _reader(get_args(hint)[0]))
    if get_origin(hint) is tuple:
        return functools.partial(_read_items, _reader(get_args(hint)[0]))
    if get_origin(hint) is dict:
        return functools.partial(_read_entries, _reader(get_args(hint)[1]))
    return _SCALARS[hint]


def _read_record(kind: Any, value: object) -> object:
    if not isinstance(value, dict):
        raise _WrongValueError("is not an object with named fields")
    layout, found = _layout(kind), {}
    for key, name, required, read in zip(
        layout.keys, layout.names, layout.required, layout.readers, strict=True
    ):
        if key in value:
            found[name] = _inside(f".{key}", read, value[key])
        elif required:
            raise _WrongValueError("is missing", f".{key}")
    return kind(**found)


def _read_optional(read: Reader, value: object) -> object:
    return None if value is None else read(value)


def _read_items(read: Reader, value: object) -> tuple[object, ...]:
    if not isinstance(value, list):
        raise _WrongValueError("is not a list")
    try:
        return tuple(map(read, value))
    except _WrongValueError:
        return tuple(_inside(f"[{k}]", read, item) for k, item in enumerate(value))


def _read_entries(read: Reader, value: object) -> dict[str, object]:
    if not isinstance(value, dict):
        raise _WrongValueError("is not an object with named fields")
    return {key: _inside(f".{key}", read, item) for key, item in value.items()}


def _inside(place: str, read: Reader, value: object) -> object:
    try:
        return read(value)
    except _WrongValueError as error:
        raise _WrongValueError(error.problem, place + error.path) from None


def _read_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise _WrongValueError("is not a finite number")
    return float(value)


def _read_whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _WrongValueError("is not a whole number")
    return value


def _read_text(value: object) -> str:
    if not isinstance(value, str):
        raise _WrongValueError("is not a text")
    return value


def _read_truth(value: object) -> bool:
    if not isinstance(value, bool):
        raise _WrongValueError("is neither true nor false")
    return value


_SCALARS: dict[object, Reader] = {
    float: _read_number,
    int: _read_whole,
    str: _read_text,
    bool: _read_truth,
}
