"""One step of the normal equations, with whatever stands behind them: constraints, datum, elimination."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import DivergenceError, SingularMatrixError
from obseq.leastsquares.assembly.linearisation import Linearisation
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.diagnosis.singular import singular_error
from obseq.leastsquares.solvers import Solver


@dataclass(frozen=True)
class NewtonStep:
    """The minimum of a linearisation, damped or not.

    Attributes:
        move: (n_scalars,) step of all unknowns, zero where frozen.
        inner: (n_free,) the same for the unknowns of the matrix.
        length: sqrt(dx' N dx), N with its damping.
        promised: by how much the linearisation, damping included, lowers the sum of squares; negative where
            hard constraints ask for a rise.
    """

    move: FloatArray
    inner: FloatArray
    length: float
    promised: float


def factor(equations: NormalEquations, solver: Solver, linearisation: Linearisation) -> FloatArray:
    """Factors the normal matrix, reduced by hard constraints; returns the step (n_free,) that these ask for.

    Raises:
        SingularSystemError: some unknowns are undetermined; their names are in the error.
    """
    try:
        return factor_unexplained(solver, linearisation)
    except SingularMatrixError:
        raise singular_error(equations.table, equations.free, equations.pattern, solver) from None


def factor_unexplained(solver: Solver, linearisation: Linearisation) -> FloatArray:
    """`factor` for those who try: a singular matrix is a SingularMatrixError, and costs no explanation."""
    offset = solver.prepare()
    solver.factor(linearisation.values)
    return offset


def newton_step(
    equations: NormalEquations, solver: Solver, linearisation: Linearisation, offset: FloatArray
) -> NewtonStep:
    """The step of a factored linearisation.

    Raises:
        DivergenceError: it is not finite.
    """
    gradient, drop = linearisation.gradient, linearisation.eliminated
    if offset.any():
        times = partial(equations.pattern.product, linearisation.values)
        inner = offset + solver.solve(-gradient - times(offset))
        quadratic = float(inner @ times(inner))
    else:
        inner = solver.solve(-gradient)
        quadratic = -float(inner @ gradient)
    promised = drop - 2.0 * float(inner @ gradient) - quadratic
    inner = solver.settle(inner)
    if not np.isfinite(inner).all():
        raise DivergenceError("the step of the unknowns is not finite")
    length = math.sqrt(max(0.0, drop + quadratic))
    return NewtonStep(equations.step(inner, linearisation), inner, length, promised)
