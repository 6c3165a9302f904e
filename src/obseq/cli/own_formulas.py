"""Formulas of the user's, from files of Python that the command line names."""

import runpy
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from obseq.errors import InputError, ObseqError
from obseq.reading.text import read_bytes

if TYPE_CHECKING:
    from obseq.kernels import Kernel

_ADVICE = (
    ("truth value", "a formula has no branches: write it without `if` on its values"),
    ("to float", "take functions such as sqrt and sin from obseq.formulas.functions, not from math"),
    ("has no attribute", "correct the name: a Point3 has x, y and z"),
)
"""What to do about an exception whose text holds some words."""


def use_formulas(paths: Sequence[Path]) -> None:
    """Runs files, and lets tables of observations name the formulas that they define.

    Raises:
        InputError: One cannot be run, or defines no formula of one to three points, or one that cannot be
            compiled, or has the name of one of the catalogue or of another of these files.
    """
    places: dict[str, str] = {}
    for path in paths:
        for one in _classes(path, _names(path)):
            kernel = _compiled(path, one)
            place = _line_of(path, one)
            if kernel.name in places:
                raise InputError(
                    f"{place}: a formula {kernel.name} is defined at {places[kernel.name]} already; give "
                    "one of them another name"
                )
            places[kernel.name] = place
            _use(kernel)


def _use(kernel: "Kernel") -> None:
    from obseq.survey import kind_of_formula

    kind_of_formula(kernel)


def _names(path: Path) -> Mapping[str, object]:
    """What a file defines, once it is run."""
    try:
        compile(read_bytes(path), str(path), "exec")
        return runpy.run_path(str(path), run_name=path.stem)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except SyntaxError as error:
        raise InputError(f"{path}, line {error.lineno}: it is not Python: {error.msg}; correct it") from error
    except ObseqError:
        raise
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise InputError(f"{_place(path, error)}: it cannot be run: {what}") from error


def _classes(path: Path, names: Mapping[str, object]) -> list[type]:
    """The formulas that the file itself defines."""
    own = [
        value
        for value in names.values()
        if isinstance(value, type) and value.__module__ == path.stem and hasattr(value, "residual")
    ]
    if not own:
        raise InputError(f"{path}: it defines no formula (a class with a method `residual`)")
    return own


def _compiled(path: Path, one: type) -> "Kernel":
    """The kernel of a formula; what its own lines raise is said with the line."""
    from obseq.codegen import compile_formula
    from obseq.kernels import formula_names

    place = _line_of(path, one)
    try:
        formula = one()
        if formula.name in formula_names():
            raise InputError(f"{place}: obseq has a formula {formula.name} already; give yours another name")
        _refuse_bare_arguments(place, one)
        return compile_formula(formula)
    except Exception as error:
        first = error.__cause__ or error  # what a line of the residual raised
        if isinstance(first, ObseqError):
            raise
        what = f"{type(first).__name__}: {first}"
        place = _place(path, first, place)
        raise InputError(f"{place}: {what} in formula {one.__name__}; {_advice(what)}") from error


def _refuse_bare_arguments(place: str, one: Any) -> None:
    """Raises where an argument of the residual has no annotation."""
    code, annotated = one.residual.__code__, one.residual.__annotations__
    count = code.co_argcount + code.co_kwonlyargcount
    bare = [name for name in code.co_varnames[1:count] if name not in annotated]
    if bare:
        raise InputError(
            f"{place}: argument {bare[0]} has no annotation in formula {one.__name__}; say what it is: "
            f"{bare[0]}: Point3, Length, Angle or Number"
        )


def _line_of(path: Path, one: Any) -> str:
    return f"{path}, line {int(one.residual.__code__.co_firstlineno)}"


def _place(path: Path, error: BaseException, otherwise: str = "") -> str:
    """The file, with the last of its lines that an exception came through."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(path)]
    return f"{path}, line {lines[-1]}" if lines else otherwise or str(path)


def _advice(what: str) -> str:
    return next((advice for words, advice in _ADVICE if words in what), "correct that line")
