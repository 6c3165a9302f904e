"""Solvers of the normal equations: one protocol, several factorisations behind it."""

from obseq.errors import SingularMatrixError, SolverStateError, SolverUnavailableError
from obseq.leastsquares.solvers.choice import SOLVER_NAMES, checked_solver, choose_solver
from obseq.leastsquares.solvers.protocol import (
    Defect,
    Solver,
    SolverStatistics,
    SymmetricPattern,
)

__all__ = [
    "SOLVER_NAMES",
    "Defect",
    "SingularMatrixError",
    "Solver",
    "SolverStateError",
    "SolverStatistics",
    "SolverUnavailableError",
    "SymmetricPattern",
    "checked_solver",
    "choose_solver",
]
