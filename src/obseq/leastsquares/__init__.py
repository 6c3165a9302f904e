"""Least squares: unknowns by name, equations in batches, sparse normal equations, precisions."""

from obseq.leastsquares.batches import Batch
from obseq.leastsquares.normal import DivergenceError
from obseq.leastsquares.priors import Prior
from obseq.leastsquares.result import Iteration, LeastSquaresResult, StopReason
from obseq.leastsquares.system import LeastSquares

__all__ = [
    "Batch",
    "DivergenceError",
    "Iteration",
    "LeastSquares",
    "LeastSquaresResult",
    "Prior",
    "StopReason",
]
