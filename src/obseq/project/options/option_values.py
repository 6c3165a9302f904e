"""Values of MMVII's options as it writes them: words, numbers, and lists in brackets, `[[a,1],[b,2]]`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import TypeAlias

from obseq.errors import InputError

Value: TypeAlias = "str | list[Value]"


def parse_value(text: str, name: str) -> Value:
    """A word, or a list of values in brackets: `[[a,1],[b,2]]`."""
    value, rest = _read(text, name)
    if rest:
        raise InputError(f"{name}={text}: {rest!r} is left over; lists are [a,b,[c,d]]")
    return value


def _read(text: str, name: str) -> tuple[Value, str]:
    if not text.startswith("["):
        return text, ""
    items: list[Value] = []
    rest = text[1:]
    while not rest.startswith("]"):
        if rest.startswith("["):
            item, rest = _read(rest, name)
        else:
            end = min((place for place in (rest.find(c) for c in ",]") if place >= 0), default=-1)
            if end < 0:
                raise InputError(f"{name}={text}: a bracket is not closed")
            item, rest = rest[:end], rest[end:]
        items.append(item)
        if rest.startswith(","):
            rest = rest[1:]
        elif not rest.startswith("]"):
            raise InputError(f"{name}={text}: a bracket is not closed")
    return items, rest[1:]


def rows_of(given: Mapping[str, Value], name: str, least: int, most: int) -> list[list[Value]]:
    """The elements of an option that takes a list of lists; one list stands for itself."""
    value = given.get(name, [])
    if isinstance(value, list) and value and not isinstance(value[0], list):
        value = [value]
    if not isinstance(value, list):
        raise InputError(f"{name}={value}: a list in brackets is needed, [[...],...]")
    rows = [row for row in value if isinstance(row, list) and least <= len(row) <= most]
    if len(rows) < len(value):
        raise InputError(f"{name}: each element takes {least} to {most} values in brackets")
    return rows


def two_numbers(given: Mapping[str, Value], name: str) -> tuple[float, float] | None:
    """The two numbers of an option; None where it is not given."""
    value = given.get(name)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"{name} takes 2 numbers in brackets")
    return number_at(value, 0, name), number_at(value, 1, name)


def number_at(row: Sequence[Value], place: int, name: str) -> float:
    """A number of a list."""
    word = word_at(row, place)
    try:
        value = float(word)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise InputError(f"{name}: {word!r} is not a number")
    return value


def number_or(row: Sequence[Value], place: int, name: str, default: float) -> float:
    """A number of a list, or what stands for it where the list ends before, or is empty there."""
    return number_at(row, place, name) if len(row) > place and row[place] != "" else default


def flag_or(row: Sequence[Value], place: int, name: str, default: bool) -> bool:
    """A truth value of a list, the same way."""
    word = word_at(row, place) if len(row) > place else ""
    if word not in ("", "0", "1", "true", "false"):
        raise InputError(f"{name}: {word!r} is neither true nor false")
    return word in ("1", "true") if word else default


def word_at(row: Sequence[Value], place: int) -> str:
    """A word of a list."""
    value = row[place]
    if not isinstance(value, str):
        raise InputError(f"a name or a number is needed, not the list {value}")
    return value


def text_of(given: Mapping[str, Value], name: str) -> str | None:
    """The word of an option; None where it is not given, or `NONE`."""
    value = given.get(name)
    if isinstance(value, list):
        raise InputError(f"{name} takes one word, not a list")
    return None if value in (None, "NONE") else value


def whole_number(given: Mapping[str, Value], name: str) -> int | None:
    """The whole number above zero of an option; None where it is not given."""
    word = text_of(given, name)
    if word is None:
        return None
    if not (word.isdecimal() and int(word) > 0):
        raise InputError(f"{name}={word} is not a whole number above zero")
    return int(word)
