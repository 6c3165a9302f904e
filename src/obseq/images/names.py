"""Names outside, numbers inside: one way to go from the one to the other."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import RowError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from obseq.arrays import BoolArray, IntArray


LONGEST_ENDING = 4
"""Letters of `tiff` and `jpeg`."""


def unique_names(names: Sequence[str], what: str) -> tuple[str, ...]:
    """The names, checked to be different.

    Raises:
        RowError: one comes twice; the message begins with `what`.
    """
    seen: set[str] = set()
    for row, name in enumerate(names):
        if name in seen:
            raise RowError(f"{what} {name!r} is given twice", row)
        seen.add(name)
    return tuple(names)


def index_of(known: Sequence[str], wanted: Sequence[str], what: str) -> IntArray:
    """(n,) positions of names among those known.

    Raises:
        RowError: one is not known; the message begins with `what`, and gives the nearest names.
    """
    place = {name: number for number, name in enumerate(known)}
    try:
        return np.array([place[name] for name in wanted], dtype=np.int64)
    except KeyError as error:
        name = error.args[0]
        raise RowError(
            f"{what} {name!r} is not known ({_alike(name, known)})", list(wanted).index(name)
        ) from None


def _alike(name: str, known: Sequence[str]) -> str:
    """The names that one may be meant for: it may differ in case, or in the ending of a file."""
    folded = {other.casefold(): other for other in known}
    same = [other for key, other in folded.items() if _stem(key) == _stem(name.casefold())]
    if same:
        return f"{', '.join(map(repr, same[:3]))} is: names count with case and ending"
    near = difflib.get_close_matches(name.casefold(), folded, n=3)
    return ", ".join(repr(folded[key]) for key in near) or "none alike"


def _stem(name: str) -> str:
    """A name without the ending of an image file."""
    stem, dot, ending = name.rpartition(".")
    return stem if dot and ending.isalnum() and len(ending) <= LONGEST_ENDING else name


def numbered(names: Sequence[str]) -> tuple[tuple[str, ...], IntArray]:
    """The different names in the order they come in, and (n,) the number of each name among them."""
    place: dict[str, int] = {}
    numbers = [place.setdefault(name, len(place)) for name in names]
    return tuple(place), np.array(numbers, dtype=np.int64)


def are_among(names: Sequence[str], others: Iterable[str]) -> BoolArray:
    """(n,) whether each name is among others."""
    known = set(others)
    if not known:
        return np.zeros(len(names), dtype=bool)
    return np.array([name in known for name in names], dtype=bool)
