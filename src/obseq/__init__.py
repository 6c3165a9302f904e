"""Observation equations: written once, generated as kernels, adjusted by least squares.

Names are loaded when they are first used: `import obseq` itself imports next to nothing.
"""

from typing import TYPE_CHECKING

from obseq.errors import (
    ContradictoryConstraintsError,
    CrsError,
    DegenerateGeometryError,
    DivergenceError,
    FormulaError,
    InputError,
    MissingPackageError,
    ObseqError,
    RowError,
    SingularMatrixError,
    SingularSystemError,
    SolverStateError,
    SolverUnavailableError,
    StepError,
)
from obseq.lazy import lazy_names

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
    "RowError",
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
    "crs": (),
    "images": (),
    "kernels": ("Calculator", "calculator", "formula_names"),
    "leastsquares": ("LeastSquares",),
    "survey": (),
}

__getattr__, __dir__ = lazy_names(__name__, _HOMES, __all__)
