"""What public functions may be given: a wrong kind of argument is refused in our words, at the door."""

from __future__ import annotations

import functools
import math
import numbers
import os
from collections.abc import Callable, Collection, Mapping, Sequence
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.printable import printable_line

P = ParamSpec("P")
R = TypeVar("R")
LONGEST_QUOTE = 60
EXTREME = 1e12
"""Largest sigma; the smallest is its inverse: products of weights stay in the range of numbers."""


@dataclass(frozen=True)
class Expected:
    """What an argument must be.

    Attributes:
        what: in words, after "must be".
        holds: whether a value is that.
    """

    what: str
    holds: Callable[[Any], bool]

    def __or__(self, other: Expected) -> Expected:
        return Expected(f"{self.what} or {other.what}", lambda value: self.holds(value) or other.holds(value))


def expecting(**expected: Expected) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A function that refuses arguments of another kind than expected; those not mentioned are not looked at.

    Raises:
        InputError: when called; it names the function, the argument and what was given.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        code = cast("FunctionType", function).__code__
        places = {name: code.co_varnames.index(name) for name in expected}
        name = function.__qualname__

        @functools.wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            for argument, place in places.items():
                if place < len(args):
                    require(name, argument, args[place], expected[argument])
                elif argument in kwargs:
                    require(name, argument, kwargs[argument], expected[argument])
            return function(*args, **kwargs)

        return call

    return decorate


def require(name: str, argument: str, value: object, expected: Expected) -> None:
    """Raises InputError when a value is not what is expected.

    Args:
        name: of the function or class that takes it.
        argument: what it is called there.
        value: what was given.
        expected: what it must be.
    """
    if not expected.holds(value):
        raise InputError(f"{name}: {argument} must be {expected.what}, not {_described(value)}")


def instance(*kinds: type, what: str = "") -> Expected:
    """An object of one of these classes."""
    names = what or " or ".join(kind.__name__ for kind in kinds)
    return Expected(names, lambda value: isinstance(value, kinds))


def sequence(item: Expected, plural: str) -> Expected:
    """A sequence of items: a list or a tuple, for instance; no text."""

    def holds(value: Any) -> bool:
        return isinstance(value, Sequence) and not _is_text(value) and all(map(item.holds, value))

    return Expected(f"a sequence of {plural}", holds)


def _is_text(value: object) -> bool:
    return isinstance(value, str | bytes)


def _is_number(value: object) -> bool:
    if not isinstance(value, numbers.Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _is_whole(value: object) -> bool:
    return isinstance(value, numbers.Integral) and not isinstance(value, bool) and abs(int(value)) < 2**63


def _is_path(value: object) -> bool:
    return isinstance(value, str | os.PathLike) and "\0" not in os.fspath(value)


def _is_numeric_array(value: object) -> bool:
    import numpy as np

    try:
        array = np.asarray(value)
        return array.dtype.kind in "fiu" or (array.dtype.kind == "O" and not array.size)
    except (TypeError, ValueError, OverflowError):
        return False


def _described(value: object) -> str:
    if value is None:
        return "None"
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python prints
        text = "a huge number"
    shown = text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."
    return f"{printable_line(shown)} ({type(value).__name__})"


NOTHING = Expected("None", lambda value: value is None)
TEXT = Expected("a text", lambda value: isinstance(value, str))
TRUTH = Expected("True or False", lambda value: isinstance(value, bool) or type(value).__name__ == "bool")
NUMBER = Expected("a finite number", _is_number)
WHOLE = Expected("a whole number", _is_whole)
SEED = Expected("a whole number, 0 or more", lambda value: _is_whole(value) and value >= 0)
PATH = Expected("the path of a file", _is_path)
PATHS = PATH | Expected("a sequence of paths", sequence(PATH, "paths").holds)
TEXTS = sequence(TEXT, "texts")
WORDS = Expected(
    "a collection of texts",
    lambda value: isinstance(value, Collection) and not _is_text(value) and all(map(TEXT.holds, value)),
)
ARRAY = Expected("an array of real numbers", _is_numeric_array)
FUNCTION = Expected("a function", callable)
TABLE = Expected("a mapping", lambda value: isinstance(value, Mapping))


def weights_factor(factor: float | None, sigma: float | None) -> float:
    """What multiplies sigmas: a factor, or 1 where a sigma takes their place.

    Raises:
        InputError: Both are given or none, or it is beyond `EXTREME`.
    """
    if (factor is None) == (sigma is None):
        raise InputError("weights: give either a factor of the sigmas or a sigma")
    if not 1.0 / EXTREME <= (factor or sigma or 0.0) <= EXTREME:
        raise InputError(f"weights: a sigma, or what multiplies it, must be positive, at most {EXTREME:g}")
    return 1.0 if factor is None else factor
