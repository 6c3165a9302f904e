"""Solvers of the normal equations: one protocol, several factorisations behind it."""

from obseq.errors import SingularMatrixError, SolverStateError, SolverUnavailableError
from obseq.leastsquares.solvers.choice import SOLVER_NAMES, choose_solver
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
    "choose_solver",
]
