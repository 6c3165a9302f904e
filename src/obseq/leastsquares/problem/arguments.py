"""Checks of what a user gives: numbers, names and choices, with errors in the words of the call."""

from __future__ import annotations

import operator
import sys
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import Array, BoolArray, FloatArray
from obseq.errors import InputError


def plain(given: object, what: str) -> Array:
    """An array of what is given, of whatever type.

    Raises:
        InputError: it is no array, or some of it is masked.
    """
    try:
        array = np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what}: not an array of numbers: {error}") from None
    if "numpy.ma" in sys.modules and isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        row = np.argwhere(np.atleast_1d(np.ma.getmaskarray(given)))[0]
        raise InputError(f"{what}: row {row[0]} is masked; leave masked rows out, or give `active`")
    return array


def real(given: object, what: str) -> FloatArray:
    """A float64 array of real numbers, never the array given itself.

    Raises:
        InputError: it is something else.
    """
    array = plain(given, what)
    if array.size and array.dtype.kind not in "fiu":
        raise InputError(f"{what}: real numbers are wanted, not {_described(given, array)}")
    return np.array(array, dtype=np.float64)


def finite(given: ArrayLike, shape: tuple[int, ...], what: str) -> FloatArray:
    """Values as a float64 array of the shape expected; an error that says what is not finite or not right."""
    array = real(given, what)
    if array.shape != shape:
        raise InputError(f"{what}: values have shape {array.shape}; expected {shape}")
    if not are_finite(array):
        raise InputError(f"{what}: row {np.argwhere(~np.isfinite(array))[0][0]} is not finite")
    return array


def are_finite(numbers: FloatArray) -> bool:
    """Whether all numbers are finite; of few ones it is known in half the time that `all` takes."""
    return bool(np.count_nonzero(np.isfinite(numbers)) == numbers.size)


def table_of_rows(given: ArrayLike, n: int, what: str) -> FloatArray:
    """Values as a float64 array (n, k)."""
    array = real(given, what)
    if array.ndim != 2 or len(array) != n:
        raise InputError(f"{what}: values have shape {array.shape}; expected {n} rows")
    return finite(array, array.shape, what)


def truths(given: ArrayLike, shape: tuple[int, ...], what: str) -> BoolArray:
    """A boolean array of the shape expected; zeros and ones are taken for False and True."""
    array = plain(given, what)
    if array.shape != shape:
        raise InputError(f"{what} has shape {array.shape}; expected {shape}")
    if array.dtype.kind == "b":
        return array.astype(np.bool_)
    if array.dtype.kind not in "iu" or not np.isin(array, (0, 1)).all():
        raise InputError(f"{what}: True or False are wanted, not {_described(given, array)}")
    return array.astype(np.bool_)


def texts(given: object, what: str) -> tuple[str, ...]:
    """Several names.

    Raises:
        InputError: it is one text, or some of it is no text.
    """
    names = tuple(listed(given, what))
    try:
        "".join(names)  # the quickest look at many
    except TypeError:
        row = next(row for row, name in enumerate(names) if not isinstance(name, str))
        raise InputError(f"{what}: row {row} is no name: {names[row]!r}") from None
    return names


def block_names(given: object, what: str) -> tuple[str, ...]:
    """Names of blocks of unknowns: texts, none of them empty."""
    names = texts(given, what)
    if "" in names:
        raise InputError(f"{what}: row {names.index('')} has an empty name")
    return names


def listed(given: object, what: str) -> list[Any]:
    """The items of a list.

    Raises:
        InputError: it is no list of anything.
    """
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise InputError(f"{what}: a list is wanted, not {given!r}")
    return list(given)


def text(given: object, what: str) -> str:
    """One name."""
    if not isinstance(given, str):
        raise InputError(f"{what}: a name is wanted, not {given!r}")
    return given


def whole(given: object, what: str) -> int:
    """A whole number; True and False are none."""
    if isinstance(given, bool | np.bool_):
        raise InputError(f"{what}: a whole number is wanted, not {given!r}")
    try:
        return operator.index(given)  # type: ignore[arg-type]  # what has no index raises
    except TypeError:
        raise InputError(f"{what}: a whole number is wanted, not {given!r}") from None


def number(given: object, what: str) -> float:
    """A finite number."""
    if isinstance(given, bool) or not isinstance(given, (int, float, np.integer, np.floating)):
        raise InputError(f"{what}: a number is wanted, not {given!r}")
    if not np.isfinite(given):
        raise InputError(f"{what}: a finite number is wanted, not {given!r}")
    return float(given)


def callback(given: Callable[..., object] | None, what: str) -> None:
    """Refuses what cannot be called; None is no callback."""
    if given is not None and not callable(given):
        raise InputError(f"{what}: a function is wanted, not {given!r}")


def frozen(array: Array) -> Array:
    """The array, which nobody can write to any more."""
    array.setflags(write=False)
    return array


def _described(given: object, array: Array) -> str:
    if array.ndim == 0:
        return repr(given)
    return "texts" if array.dtype.kind in "US" else f"an array of {array.dtype}"
