"""Records: what results are made of, their plain form (what JSON holds) and back.

Errors say where in the file a value is wrong. A field that has its default is left out of the plain form.
Records with `omit_defaults=False` have all their keys there.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, TypeVar, get_args, get_origin

import msgspec
from msgspec import structs

from obseq.errors import InputError

Kind = TypeVar("Kind")


class Record(msgspec.Struct, frozen=True, omit_defaults=True):
    """Named values that never change; `msgspec.structs.replace` makes another one of it."""


def to_plain(record: Record) -> dict[str, Any]:
    """The plain form of what a file of ours holds: its `format` and `version` come first."""
    import json

    plain: dict[str, Any] = json.loads(encoded(record))
    return {key: plain.pop(key) for key in ("format", "version") if key in plain} | plain


def from_plain(kind: type[Kind], value: object, what: str) -> Kind:
    """The record whose plain form is given; keys that it does not know are left aside.

    Args:
        kind: the class.
        value: its plain form.
        what: how messages call it.

    Raises:
        InputError: something is missing or is not what it must be; the message says where.
    """
    try:
        return msgspec.convert(value, kind, dec_hook=partial(_listed, kind))
    except msgspec.ValidationError as error:
        problem, _, place = str(error).partition(" - at `$")
        where = place.strip(".`")
        raise InputError(f"{what}: {where}: {problem}" if where else f"{what}: {problem}") from None


def encoded(value: object) -> str:
    """Its JSON; what JSON cannot write (infinities, not-a-numbers) is null."""
    try:
        return msgspec.json.encode(value, enc_hook=_plain).decode()
    except UnicodeEncodeError:  # the name of a file that is no text
        import json

        return json.dumps(msgspec.to_builtins(value, enc_hook=_plain))


def _plain(value: Any) -> object:
    """A number of NumPy as one of Python, columns as lists."""
    return list(value) if isinstance(value, Sequence) else value.item()


def _listed(record: type, kind: Any, value: object) -> object:
    """What a list of a file becomes that a record holds as columns."""
    whole, rows = get_origin(kind) or kind, get_args(kind)[0]
    if isinstance(value, whole):
        return value
    try:
        found: object = whole.from_plain(value, rows)
        return found
    except msgspec.ValidationError as error:
        problem, _, place = str(error).partition(" - at `$")
        fields = (field for field in structs.fields(record) if kind in (field.type, *get_args(field.type)))
        name = next((field.encode_name for field in fields), rows.__name__)
        raise msgspec.ValidationError(f"{problem} - at `$.{name}{place.strip('`')}`") from None
