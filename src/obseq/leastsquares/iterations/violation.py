"""By how much hard constraints do not hold, in one number, for iterations that are held back."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import FloatArray
from obseq.leastsquares.assembly.evaluation import jacobian_rows, residual_rows
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.problem.batches import Batch

NARROWED = 0.9
"""Share of the funnel's width below which a violation is to fall."""


class Violation:
    """Norm of what the constraints are off by, each over what one standard deviation of its unknowns does.

    A step that raises the sum of squares, but keeps the violation in a funnel, is taken; each of these
    narrows the funnel, so that they are few (Gould and Toint, Nonlinear programming without a penalty
    function or a filter, 2010). Steps that lower the sum of squares are taken whatever the violation.

    Args:
        equations: the system, at the values where its iterations begin.
        weights: (n_scalars,) diagonal of N there, 0 where frozen.
    """

    def __init__(self, equations: NormalEquations, weights: FloatArray) -> None:
        self._equations = equations
        self._scales = [self._scale(batch, weights) for batch in equations.constraints]
        self._width = self._present = self._now()

    def note(self) -> None:
        """Remembers the violation at the current values, where an iteration begins."""
        self._present = self._now()

    def narrows(self, negligible: float) -> bool:
        """Whether a step from there has led to a violation well inside the funnel, which becomes its width.

        Args:
            negligible: a violation that is as good as none: there is nothing to lower.
        """
        if self._present <= negligible:
            return False
        now = self._now()
        if now > NARROWED * self._width:
            return False
        self._width = now
        return True

    def _scale(self, batch: Batch, weights: FloatArray) -> FloatArray:
        """(n_residuals, n) what residuals are multiplied by."""
        shape = batch.shape
        derivatives = jacobian_rows(self._equations.table, batch)[shape.n_residuals :]
        variances = np.where(weights > 0.0, 1.0 / np.where(weights > 0.0, weights, 1.0), 0.0)[batch.scalars()]
        squares = np.square(derivatives.reshape(shape.n_residuals, shape.n_unknowns, -1)) * variances
        spread = np.sqrt(squares.sum(axis=1))
        return np.where(spread > 0.0, 1.0 / np.where(spread > 0.0, spread, 1.0), 0.0)

    def _now(self) -> float:
        """At the current values; infinite where a constraint is not defined."""
        found = 0.0
        with np.errstate(over="ignore", invalid="ignore"):
            for batch, scale in zip(self._equations.constraints, self._scales, strict=True):
                found += float(np.square(residual_rows(self._equations.table, batch) * scale).sum())
        return math.sqrt(found) if math.isfinite(found) else math.inf
