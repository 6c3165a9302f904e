"""Loops: plain functions over arrays, called from Python, run as machine code outside its lock."""

from __future__ import annotations

import ctypes
import operator
from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast, overload

import numpy as np

from obseq.cached import cached_property
from obseq.compilation.digests import Function
from obseq.compilation.routines import Routine
from obseq.compilation.settings import FAILED, OBJECT_HEADER
from obseq.compilation.signatures import Parameter, signature_of

F = TypeVar("F", bound="Callable[..., Any]")
NUMBERS = {"int64": ctypes.c_int64, "float64": ctypes.c_double, "bool": ctypes.c_int64}
CONVERSIONS: dict[str, Callable[[Any], object]] = {"int64": operator.index, "float64": float, "bool": int}


class Loop(Function):
    """A compiled function: call it as if it were the plain one.

    Arrays must be C-contiguous and of the type that the annotations say; NamedTuples of them are taken as
    they are. The function is compiled, or found, when it is first called.
    """

    def __call__(self, *arguments: object) -> Any:
        """The result of the function; arrays are changed in place.

        Raises:
            TypeError: an argument is not what the annotation of its parameter says.
        """
        entry, result = self._entry, self._result() if self._has_result else None
        place = None if result is None else ctypes.byref(result)
        given = self._members(arguments) if self._records else arguments
        try:
            status = entry(place, NDARRAY, *given)
        except (ctypes.ArgumentError, TypeError):
            status = entry(place, NDARRAY, *self._converted(given))
        if status:
            self._refuse(status, given)
        return None if result is None else result.value

    @cached_property
    def routine(self) -> Routine:
        """The machine code."""
        return Routine(self, signature_of(self.python))

    @cached_property
    def _entry(self) -> Callable[..., int]:
        routine = self.routine
        kinds: list[Any] = [
            ctypes.py_object if parameter.dimensions else NUMBERS[parameter.type]
            for parameter in routine.signature.parameters
        ]
        prototype = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, *kinds)
        return cast("Callable[..., int]", prototype(routine.address))

    @cached_property
    def _has_result(self) -> bool:
        return self.routine.signature.result is not None

    @cached_property
    def _result(self) -> Any:
        return NUMBERS[self.routine.signature.result or "int64"]

    @cached_property
    def _records(self) -> tuple[int, ...]:
        """Positions of the arguments that are NamedTuples."""
        arguments = self.routine.signature.arguments
        return tuple(k for k, argument in enumerate(arguments) if argument.record)

    def _members(self, arguments: tuple[object, ...]) -> list[Any]:
        given: list[Any] = list(arguments)
        for k in reversed(self._records):
            given[k : k + 1] = given[k]
        return given

    def _converted(self, given: Sequence[object]) -> list[object]:
        """The same with numbers of any type as Python's own."""
        parameters = self.routine.signature.parameters
        if len(given) != len(parameters):
            raise TypeError(
                f"{self.name} takes {len(parameters)} arguments, members counted; not {len(given)}"
            )
        return [
            value if parameter.dimensions else CONVERSIONS[parameter.type](value)
            for parameter, value in zip(parameters, given, strict=True)
        ]

    def _refuse(self, status: int, given: Sequence[object]) -> None:
        if status == FAILED:
            raise RuntimeError(f"{self.name}: the compiled loop failed")
        parameter = self.routine.signature.parameters[status - 1]
        raise TypeError(
            f"{self.name}: {parameter} is wanted, C-contiguous, not {_described(given[status - 1])}"
        )


class QuickLoop(Loop):
    """A compiled function over arrays for work of microseconds, of which a usual call takes too large a part.

    Python calls its `builtin` as one of its own, and keeps its lock meanwhile.
    """

    def __call__(self, *arguments: object) -> Any:
        """The result of the function, 0; NamedTuples are taken as they are, and what is wrong is told.

        Raises:
            TypeError: an argument is not what the annotation of its parameter says.
            RuntimeError: the function did nothing: it returned another number than 0.
        """
        given = self._converted(self._members(arguments))
        wanted = self.routine.signature.parameters
        for number, (parameter, value) in enumerate(zip(wanted, given, strict=True), 1):
            if not _fits(parameter, value):
                self._refuse(number, given)
        if self.builtin(*given) is not given[-1]:
            raise RuntimeError(f"{self.name}: the compiled loop did nothing")
        return 0

    @cached_property
    def routine(self) -> Routine:
        """The machine code."""
        return Routine(self, signature_of(self.python, at_once=True))

    @cached_property
    def builtin(self) -> Callable[..., object]:
        """Takes the arrays; returns the last one, or the first one when it did nothing.

        It does nothing where an array is not as it must be, writeable included, and where the function
        returns another number than 0.
        """
        definition = _Method(self.name.encode(), self.routine.address, FAST_CALL, None)
        self._kept = definition  # builtins point to it
        return cast("Callable[..., object]", _new_builtin()(ctypes.byref(definition), np.ndarray, None))


class _Method(ctypes.Structure):
    """Definition of a builtin, `PyMethodDef` of Python's interface for C."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("documentation", ctypes.c_char_p),
    )


FAST_CALL = 0x80
"""Arguments are handed over as an array of objects and their number: `METH_FASTCALL`."""

HAS_BUILTINS = OBJECT_HEADER == 16
"""Whether objects are laid out as quick loops know them; in free-threaded Python they are not."""


def _new_builtin() -> Callable[..., object]:
    """Python's own function that makes a builtin."""
    prototype = ctypes.PYFUNCTYPE(
        ctypes.py_object, ctypes.POINTER(_Method), ctypes.py_object, ctypes.c_void_p
    )
    return prototype(("PyCFunction_NewEx", ctypes.pythonapi))


NDARRAY = id(np.ndarray)
"""What machine code compares the type of arrays with: it reads their fields."""


def _fits(parameter: Parameter, value: object) -> bool:
    """Whether a value is the array that a quick loop may change."""
    if not isinstance(value, np.ndarray) or type(value) is not np.ndarray:
        return False
    same = value.dtype == parameter.type and value.ndim == parameter.dimensions
    return same and value.flags.carray


def _described(value: object) -> str:
    if not isinstance(value, np.ndarray):
        return type(value).__name__
    order = "" if value.flags.c_contiguous else ", not contiguous"
    order += "" if value.flags.writeable else ", read only"
    return f"{type(value).__name__} of {value.dtype} with {value.ndim} dimensions{order}"


@overload
def compiled(function: F) -> F: ...
@overload
def compiled(
    *, flags: frozenset[str] = frozenset(), always_inline: bool = False, at_once: bool = False
) -> Callable[[F], F]: ...
def compiled(
    function: F | None = None,
    *,
    flags: frozenset[str] = frozenset(),
    always_inline: bool = False,
    at_once: bool = False,
) -> F | Callable[[F], F]:
    """Marks a function that is run as machine code: a loop, or a part of one.

    It may name constants, NumPy's functions, and other functions that are marked so, of any module. It
    neither allocates nor raises: what it needs is given.

    Args:
        function: the function.
        flags: freedom of floating-point arithmetic: `functions.SUMS`, `functions.CONTRACT`.
        always_inline: put the text where it is called, whatever its length.
        at_once: make a `QuickLoop`; the function takes arrays only and returns a whole number.
    """
    kind = QuickLoop if at_once else Loop

    def mark(function: F) -> F:
        return cast("F", kind(cast("Any", function), flags, always_inline))

    return mark if function is None else mark(function)
