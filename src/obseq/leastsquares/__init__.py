"""Least squares: unknowns by name, equations in batches, sparse normal equations, precisions.

Every public name is here; each is loaded when it is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obseq.leastsquares.assembly.normal_equations import DivergenceError
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.solution.result import Iteration, LeastSquaresResult, StopReason
    from obseq.leastsquares.system import LeastSquares

_HOMES = {
    "Batch": "problem.batches",
    "DivergenceError": "assembly.normal_equations",
    "Iteration": "solution.result",
    "LeastSquares": "system",
    "LeastSquaresResult": "solution.result",
    "Prior": "problem.priors",
    "StopReason": "solution.result",
}

__all__ = [
    "Batch",
    "DivergenceError",
    "Iteration",
    "LeastSquares",
    "LeastSquaresResult",
    "Prior",
    "StopReason",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'obseq.leastsquares' has no attribute {name!r}")
    return getattr(importlib.import_module(f"obseq.leastsquares.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
