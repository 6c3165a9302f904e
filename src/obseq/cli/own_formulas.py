"""Formulas of the user's, from files of Python that the command line names."""

import runpy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from obseq.errors import InputError


def use_formulas(path: Path) -> None:
    """Runs a file, and lets tables of observations name the formulas that it defines.

    Raises:
        InputError: It cannot be run, or defines no formula of one to three points.
    """
    from obseq.codegen import compile_formula
    from obseq.survey import kind_of_formula

    formulas = _formulas(path, _names(path))
    for formula in formulas:
        kind_of_formula(compile_formula(formula))


def _names(path: Path) -> Mapping[str, Any]:
    """What a file defines, once it is run."""
    try:
        return runpy.run_path(str(path), run_name=path.stem)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except Exception as error:
        raise InputError(f"{path}: it cannot be run: {type(error).__name__}: {error}") from error


def _formulas(path: Path, names: Mapping[str, Any]) -> list[Any]:
    """An object of each formula that the file itself defines."""
    own = [
        value
        for value in names.values()
        if isinstance(value, type) and value.__module__ == path.stem and hasattr(value, "residual")
    ]
    if not own:
        raise InputError(f"{path}: it defines no formula (a class with a method `residual`)")
    return [value() for value in own]
