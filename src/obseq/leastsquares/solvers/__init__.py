"""Solvers of the normal equations: one protocol, several factorisations behind it."""

from obseq.errors import SingularMatrixError, SolverStateError, SolverUnavailableError
from obseq.leastsquares.solvers.protocol import (
    Defect,
    InverseParts,
    Solver,
    SolverStatistics,
    SymmetricPattern,
)
from obseq.leastsquares.solvers.selection import SOLVER_NAMES, checked_solver, choose_solver

__all__ = [
    "SOLVER_NAMES",
    "Defect",
    "InverseParts",
    "SingularMatrixError",
    "Solver",
    "SolverStateError",
    "SolverStatistics",
    "SolverUnavailableError",
    "SymmetricPattern",
    "checked_solver",
    "choose_solver",
]
