"""Powell's dogleg: from the steepest descent to the Gauss-Newton step, in unknowns scaled by diag(N)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.iterations.arrival import sizes_of
from obseq.leastsquares.iterations.newton import factor
from obseq.leastsquares.iterations.trust_region import FIRST_RADIUS, Trial

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.solvers import Solver


class DoglegPath:
    """Steps on the broken line; one factorisation serves all radii.

    Args:
        equations: The system, without eliminated unknowns.
        solver: Its solver, analysed.
        radius: The first radius; None for any length.
    """

    is_bold = False
    defect = 0

    def __init__(self, equations: NormalEquations, solver: Solver, radius: float | None) -> None:
        self._equations = equations
        self._solver = solver
        self.radius = np.inf if radius is None else radius
        self.first_radius = np.inf
        self._is_new = True
        self._scale = np.zeros(equations.pattern.n)

    def linearise(self, in_passing: bool = False) -> None:
        """Assembles at the current values, and finds both ends of the path in scaled unknowns."""
        self._linearisation = self._equations.assemble()
        if not in_passing:
            diagonal = self._linearisation.diagonal[self._equations.free.scalars]
            self._scale = np.maximum(self._scale, np.sqrt(diagonal))
        scale = np.where(self._scale > 0.0, self._scale, 1.0)
        gradient = self._linearisation.gradient
        self._matrix = self._equations.pattern.matrix(self._linearisation.values)
        downhill = -gradient / scale
        curvature = float((downhill / scale) @ (self._matrix @ (downhill / scale)))
        self._steepest = downhill * (float(downhill @ downhill) / curvature if curvature > 0.0 else 0.0)
        factor(self._equations, self._solver, self._linearisation)
        self._newton = self._solver.solve(-gradient) * scale
        if self._is_new and np.isinf(self.radius):
            sizes = sizes_of(self._equations.table)[self._equations.free.scalars]
            size = float(np.linalg.norm(sizes * scale))
            self.first_radius = FIRST_RADIUS * size if size > 0.0 else np.inf
        self._is_new = False
        self._unscale = 1.0 / scale

    def within(self, radius: float) -> Trial:
        """The point of the path at a radius."""
        path = _dogleg(self._newton, self._steepest, radius)
        inner = path * self._unscale
        gradient = self._linearisation.gradient
        quadratic = float(inner @ (self._matrix @ inner))
        promised = -2.0 * float(gradient @ inner) - quadratic
        move = self._equations.step(inner, self._linearisation)
        length, norm = float(np.sqrt(max(quadratic, 0.0))), float(np.linalg.norm(path))
        return Trial(move, length, norm, promised, path is self._newton, self._linearisation)

    def full(self) -> Trial:
        """The end of the path."""
        return self.within(np.inf)

    def settle(self) -> None:
        """The matrix was regular at every iteration: there is no defect."""


def _dogleg(newton: FloatArray, steepest: FloatArray, radius: float) -> FloatArray:
    """The point at a radius on the path from 0 to the lowest point downhill, then to the full step."""
    if np.linalg.norm(newton) <= radius:
        return newton
    reach = float(np.linalg.norm(steepest))
    if reach >= radius:
        return np.asarray(steepest * (radius / reach))
    leg = newton - steepest
    a, b, c = float(leg @ leg), float(steepest @ leg), reach * reach - radius * radius
    share = (-b + np.sqrt(b * b - a * c)) / a
    return np.asarray(steepest + share * leg)
