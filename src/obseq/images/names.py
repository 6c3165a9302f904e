"""What is given to make parts of a block: names outside become numbers inside; rows of numbers and sigmas."""

from __future__ import annotations

import difflib
import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import InputError, RowError
from obseq.leastsquares.problem.arguments import real

LONGEST_ENDING = 4
"""Letters of `tiff` and `jpeg`."""


def as_names(given: Iterable[object], what: str) -> tuple[str, ...]:
    """Names as texts; a whole number becomes its digits, as in tables of a survey.

    Raises:
        InputError: it is one text, or no list; the message begins with `what`.
        RowError: one is empty, or no name.
    """
    if isinstance(given, str) or not hasattr(given, "__iter__"):
        raise InputError(f"{what}: a list of names is wanted, not {given!r}")
    names = tuple(given)
    if set(map(type, names)) <= {str} and "" not in names:  # the quickest look at many
        return cast("tuple[str, ...]", names)
    return tuple(_as_name(name, what, row) for row, name in enumerate(names))


def _as_name(given: object, what: str, row: int) -> str:
    is_number = isinstance(given, numbers.Integral) and not isinstance(given, bool)
    name = str(given) if is_number or isinstance(given, str) else ""
    if not name:
        raise RowError(f"{what}: {given!r} (row {row + 1}) is no name", row)
    return name


def unique_names(given: Iterable[object], what: str) -> tuple[str, ...]:
    """The names as texts (`as_names`), checked to be different.

    Raises:
        RowError: one comes twice; the message begins with `what`.
    """
    names = as_names(given, what)
    seen: set[str] = set()
    for row, name in enumerate(names):
        if name in seen:
            raise RowError(f"{what} {name!r} is given twice", row)
        seen.add(name)
    return names


def index_of(known: Sequence[str], wanted: Sequence[str], what: str) -> IntArray:
    """(n,) positions of names among those known.

    Raises:
        RowError: one is not known; the message begins with `what`, and gives the nearest names.
    """
    place = {name: number for number, name in enumerate(known)}
    try:
        return np.array([place[name] for name in wanted], dtype=np.int64)
    except (KeyError, TypeError):
        names = as_names(wanted, what)
    row = next((row for row, name in enumerate(names) if name not in place), None)
    if row is not None:
        raise RowError(f"{what} {names[row]!r} is not known ({_alike(names[row], known)})", row)
    return np.array([place[name] for name in names], dtype=np.int64)


def _alike(name: str, known: Sequence[str]) -> str:
    """The names that one may be meant for: it may differ in case, or in folder and ending of a file."""
    folded = {other.casefold(): other for other in known}
    same = [other for key, other in folded.items() if _stem(key) == _stem(name.casefold())]
    if same:
        return f"{', '.join(map(repr, same[:3]))} is: names count with folder, case and ending"
    near = difflib.get_close_matches(name.casefold(), folded, n=3)
    return ", ".join(repr(folded[key]) for key in near) or "none alike"


def _stem(name: str) -> str:
    """A name without the folder and the ending of an image file."""
    name = re.split(r"[\\/]", name)[-1]
    stem, dot, ending = name.rpartition(".")
    return stem if dot and ending.isalnum() and len(ending) <= LONGEST_ENDING else name


def no_parameter(parameters: str, cameras: str, known: Mapping[str, Sequence[str]]) -> InputError:
    """That two patterns match no parameter of a camera, and what there is to match.

    Args:
        parameters: pattern of parameters.
        cameras: pattern of cameras.
        known: names of the parameters of each camera.
    """
    of_all: dict[tuple[str, ...], list[str]] = {}
    for name, of_one in known.items():
        of_all.setdefault(tuple(of_one), []).append(name)
    listed = "; ".join(f"camera {', '.join(names)}: {', '.join(of)}" for of, names in of_all.items())
    return InputError(
        f"no camera parameter matches {parameters!r} of cameras {cameras!r} as a whole; "
        f"there are {listed or 'none'}"
    )


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


def expression(pattern: str) -> re.Pattern[str]:
    """A regular expression.

    Raises:
        InputError: it is none.
    """
    try:
        return re.compile(pattern)
    except (re.error, TypeError) as error:
        raise InputError(f"{pattern!r} is not a regular expression: {error}") from None


def rows_of(given: ArrayLike, n: int, width: int, what: str) -> FloatArray:
    """Numbers as an array (n, width), one row for each of n things; a copy.

    Raises:
        InputError: they have another shape; rows that were given as columns are told as that.
    """
    array = real(given, what)
    if not array.size and not n:
        return np.zeros((0, width))
    if array.shape != (n, width):
        turned = ": transpose them" if array.shape == (width, n) else ""
        raise InputError(f"{what} have shape {array.shape}, not ({n}, {width}){turned}")
    return array


def sigmas_of(given: ArrayLike, n: int, width: int, what: str) -> FloatArray:
    """Sigmas as an array (n, width), of one for all, one for each of n things (n,), or (n, width); a copy.

    Raises:
        InputError: they have another shape.
    """
    array = real(given, what)
    if array.ndim and array.shape not in ((n,), (n, width)):
        raise InputError(f"{what} have shape {array.shape}; one number, ({n},) or ({n}, {width}) is wanted")
    return np.array(np.broadcast_to(array[:, None] if array.ndim == 1 else array, (n, width)))
