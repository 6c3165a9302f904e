"""Observation equations: written once, generated as kernels, adjusted by least squares.

Names are loaded when they are first used: `import obseq` itself imports next to nothing.
"""

import importlib
from typing import TYPE_CHECKING, Any

from obseq.errors import (
    ContradictoryConstraintsError,
    CrsError,
    DegenerateGeometryError,
    DivergenceError,
    FormulaError,
    InputError,
    MissingPackageError,
    ObseqError,
    SingularMatrixError,
    SingularSystemError,
    SolverStateError,
    SolverUnavailableError,
    StepError,
)

if TYPE_CHECKING:
    from obseq import crs, images, survey
    from obseq.kernels.calculator import Calculator, calculator
    from obseq.kernels.loading import formula_names
    from obseq.leastsquares import LeastSquares

__all__ = [
    "Calculator",
    "ContradictoryConstraintsError",
    "CrsError",
    "DegenerateGeometryError",
    "DivergenceError",
    "FormulaError",
    "InputError",
    "LeastSquares",
    "MissingPackageError",
    "ObseqError",
    "SingularMatrixError",
    "SingularSystemError",
    "SolverStateError",
    "SolverUnavailableError",
    "StepError",
    "calculator",
    "crs",
    "formula_names",
    "images",
    "survey",
]

_HOMES = {
    "Calculator": "obseq.kernels",
    "calculator": "obseq.kernels",
    "formula_names": "obseq.kernels",
    "LeastSquares": "obseq.leastsquares",
}
_ROOMS = ("crs", "images", "survey")


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    if name in _ROOMS:
        return importlib.import_module(f"obseq.{name}")
    raise AttributeError(f"module 'obseq' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
