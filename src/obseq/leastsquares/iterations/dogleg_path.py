"""Powell's dogleg: from the steepest descent to the Gauss-Newton step, in unknowns scaled by diag(N)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.iterations.arrival import sizes_of
from obseq.leastsquares.iterations.curvature import Curvature, curvature_of
from obseq.leastsquares.iterations.newton import factor
from obseq.leastsquares.iterations.trials import Trial
from obseq.leastsquares.iterations.trust_region import FIRST_RADIUS
from obseq.leastsquares.solvers import Solver

Product = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Ends:
    """Both ends of a path, in scaled unknowns, and the curvature of the sum of squares that they assume.

    Attributes:
        newton: (n,) the full step.
        steepest: (n,) the lowest point straight downhill.
        times: the product of second derivatives and a step of the unknowns.
    """

    newton: FloatArray
    steepest: FloatArray
    times: Product


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
        self._curvature = curvature_of(equations)
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
        factor(self._equations, self._solver, self._linearisation)
        times = partial(self._equations.pattern.product, self._linearisation.values.copy())
        self._plain = self._ends = self._ends_of(self._solver.solve, times)
        if self._is_new and np.isinf(self.radius):
            sizes = sizes_of(self._equations.table)[self._equations.free.scalars]
            size = float(np.linalg.norm(sizes * self._metric()))
            self.first_radius = FIRST_RADIUS * size if size > 0.0 else np.inf
        self._is_new = False
        if self._curvature is not None and not in_passing:
            self._bend(self._curvature)

    def _bend(self, curvature: Curvature) -> None:
        """Learns the curvature of residuals; the path follows it where it is to be trusted."""
        curvature.learn(self._equations, self._linearisation, np.square(self._metric()))
        full = self.full()
        if curvature.is_trusted(full.length, self._linearisation.cost):
            plain, bent = self._plain, curvature.correcting(self._solver.solve)
            if bent is not None:
                self._ends = self._ends_of(bent, lambda step: plain.times(step) + curvature.times(step))

    def _ends_of(self, solve: Product, times: Product) -> Ends:
        gradient, scale = self._linearisation.gradient, self._metric()
        downhill = -gradient / scale
        bend = float((downhill / scale) @ times(downhill / scale))
        steepest = downhill * (float(downhill @ downhill) / bend if bend > 0.0 else 0.0)
        return Ends(solve(-gradient) * scale, steepest, times)

    def _metric(self) -> FloatArray:
        return np.where(self._scale > 0.0, self._scale, 1.0)

    def within(self, radius: float) -> Trial:
        """The point of the path at a radius."""
        return self._trial(self._ends, radius)

    def full(self) -> Trial:
        """The Gauss-Newton step."""
        return self._trial(self._plain, np.inf)

    def _trial(self, ends: Ends, radius: float) -> Trial:
        path = _dogleg(ends.newton, ends.steepest, radius)
        inner = path / self._metric()
        quadratic = float(inner @ ends.times(inner))
        promised = -2.0 * float(self._linearisation.gradient @ inner) - quadratic
        move = self._equations.step(inner, self._linearisation)
        length, norm = float(np.sqrt(max(quadratic, 0.0))), float(np.linalg.norm(path))
        return Trial(move, length, norm, promised, path is self._plain.newton, self._linearisation)

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
