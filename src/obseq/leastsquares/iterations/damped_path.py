"""Levenberg-Marquardt: the least damping that keeps a step within a radius (Moré, 1978)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import SingularMatrixError, SingularSystemError
from obseq.leastsquares.iterations.arrival import sizes_of
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.iterations.newton import NewtonStep, factor, factor_unexplained, newton_step
from obseq.leastsquares.iterations.trials import Trial
from obseq.leastsquares.iterations.trust_region import FIRST_RADIUS

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.iterations.curvature import Curvature
    from obseq.leastsquares.solvers import Solver

NEAR = 0.1
"""Share of the radius by which the norm of a step may differ from it."""

MOST_FACTORS = 12
"""Dampings that are tried for one step."""

TOWARDS = 0.5
"""Share of the radius that a step may go towards hard constraints."""

LEAST = 1e-9
"""Least damping where the undamped matrix is singular."""


class DampedPath:
    """Steps that solve (N + damping D) dx = -g, D the largest diagonal of N met so far.

    So an unknown that loses its influence does not run away. Points that move in their inverse distance may:
    theirs is the present diagonal. A matrix that is singular from the start is
    damped; its defect is counted, and stays the same or shrinks. A damped matrix needs no datum for what is
    free: full steps end on it, wherever damped ones have led.

    Args:
        equations: The system.
        solver: Its solver, analysed.
        damping: The first damping; None for that of the first radius.
        is_bold: For full steps as long as they descend; the matrix is then to be regular at the start.
    """

    def __init__(
        self,
        equations: NormalEquations,
        solver: Solver,
        damping: float | None = None,
        is_bold: bool = False,
    ) -> None:
        self._equations = equations
        self._solver = self._used = solver
        self._floor = np.zeros(equations.pattern.n)
        self._seen = equations.table.is_seen[equations.free.scalars]
        self._given = damping
        self._damping, self._norm, self._share = 0.0, 0.0, 1.0
        self._pull: FloatArray | None = None
        self._scale = np.ones(equations.pattern.n)
        self._lost = 0
        self._is_new = True
        self._stepped: NewtonStep | None = None
        self._reach = np.inf
        self._curvature = None if is_bold else _curvature_of(equations)
        self._is_bent = False
        self._solve: Callable[[FloatArray], FloatArray] = solver.solve
        self.is_bold = is_bold
        self.radius = np.inf
        self.first_radius = np.inf
        self.defect = 0

    def linearise(self, in_passing: bool = False) -> None:
        """Assembles at the current values."""
        self._stepped, self._is_bent = None, False
        diagonal = self._equations.collect()
        if in_passing:
            return
        present = diagonal[self._equations.free.scalars]
        self._floor = np.where(self._seen, present, np.maximum(self._floor, present))
        self._scale = np.where(self._floor > 0.0, self._floor, 1.0)
        if self._is_new:
            self._is_new = False
            self._begin()
        if self._curvature is not None and not self.defect:
            self._bend(self._curvature)

    def _begin(self) -> None:
        """Takes the first radius from the size of the unknowns; counts the defect."""
        sizes = sizes_of(self._equations.table)[self._equations.free.scalars]
        size = self._norm_of(sizes)
        self.first_radius = FIRST_RADIUS * size if size > 0.0 else np.inf
        if self._step(0.0) is None:
            if self.is_bold or self._lost == 0 or not (self._floor > 0.0).all():
                self._explain()
            self.defect = self._lost

    def _bend(self, curvature: Curvature) -> None:
        """Learns the curvature of residuals; steps follow it where it is to be trusted."""
        linearisation = self._equations.damped(0.0)
        curvature.learn(self._equations, linearisation, self._scale)
        if curvature.is_trusted(0.0, linearisation.cost):
            step = self._step(0.0)
            self._is_bent = step is not None and curvature.is_trusted(step.length, linearisation.cost)
            self._stepped = None

    def within(self, radius: float) -> Trial:
        """The step of the last linearisation whose norm is about the radius, or the shorter full one."""
        self._restrain(radius)
        damping, low, high = self._aimed(radius), 0.0, np.inf
        for _ in range(MOST_FACTORS):
            step = self._step(damping)
            if step is None:
                low = damping = max(10.0 * damping, LEAST)
                continue
            if self._is_within(radius):
                return self._trial(step)
            low, high = (damping, high) if self._norm > radius else (low, damping)
            damping = self._between(self._aimed(radius), low, high)
        return self._trial(self._regular_step())

    def _restrain(self, radius: float) -> None:
        """Steps towards hard constraints, which no damping shortens, are kept to a share of the radius."""
        reach = TOWARDS * radius if self._equations.constraints else np.inf
        if reach != self._reach:
            self._reach, self._stepped = reach, None

    def _towards(self, offset: FloatArray) -> tuple[FloatArray, float]:
        """The step to take towards the constraints, and its share of what they ask for."""
        norm = self._norm_of(offset) if np.isfinite(self._reach) else 0.0
        share = self._reach / norm if norm > self._reach else 1.0
        return share * offset, share

    def full(self) -> Trial:
        """The undamped step, or the least damped one."""
        self._restrain(np.inf)
        if not self._is_bent:
            return self._trial(self._regular_step())
        self._is_bent, self._stepped = False, None
        trial = self._trial(self._regular_step())
        self._is_bent, self._stepped = True, None
        return trial

    def settle(self) -> None:
        """Counts the defect where the iterations have arrived.

        Raises:
            SingularSystemError: it has grown: they arrived where some unknowns have lost their influence.
        """
        if self.defect or self._lost:
            self._lost = 0
            if self._step(0.0) is None and not 0 < self._lost <= self.defect:
                self._explain()
            self.defect = self._lost

    def _explain(self) -> None:
        """Raises the error that names what is undetermined."""
        linearisation = self._equations.damped(0.0)
        factor(self._equations, self._solver, linearisation)

    def _step(self, damping: float) -> NewtonStep | None:
        """The step under a damping; None where the matrix is singular."""
        if self._stepped is not None and damping == self._damping:
            return self._stepped
        self._stepped = None
        equations, floor = self._equations, self._floor
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # far out; what is not finite is an error then
                linearisation = equations.damped(damping, floor)
            self._used = self._solver
            if damping and isinstance(self._solver, DatumSolver):
                self._used = self._solver.of_damped(damping * floor)
            offset, self._share = self._towards(factor_unexplained(self._used, linearisation))
        except (SingularMatrixError, SingularSystemError) as error:
            self._lost = len(error.indices) if isinstance(error, SingularMatrixError) else 0
            self._pull = None
            return None
        self._linearisation = linearisation
        self._solve = self._used.solve
        step = newton_step(equations, self._used, linearisation, offset)
        if self._is_bent:
            step = self._bent(step)
        self._measure(step, damping)
        self._stepped = step
        return step

    def _bent(self, step: NewtonStep) -> NewtonStep:
        """The step of this damping with the curvature of residuals; as it is where that has no minimum."""
        assert self._curvature is not None
        solve = self._curvature.correcting(self._used.solve)
        if solve is None:
            self._is_bent = False
            return step
        self._solve = solve
        inner = solve(-self._linearisation.gradient)
        promised = -float(inner @ self._linearisation.gradient)
        move = self._equations.step(inner, self._linearisation)
        return NewtonStep(move, inner, float(np.sqrt(max(promised, 0.0))), promised)

    def _regular_step(self) -> NewtonStep:
        damping = 0.0 if not self.defect else LEAST
        for _ in range(MOST_FACTORS):
            step = self._step(damping)
            if step is not None:
                return step
            damping = max(10.0 * damping, LEAST)
        raise SingularSystemError(
            "the normal matrix stays singular however strong its damping: at these values some unknowns have "
            "next to no influence on any residual. "
            "Start closer to the solution, freeze them, or give them a prior"
        )

    def _measure(self, step: NewtonStep, damping: float) -> None:
        """Norm of the step, and what `_slope` needs of it."""
        self._damping, self._norm, self._pull = damping, self._norm_of(step.inner), self._scale * step.inner

    def _slope(self) -> float:
        """How fast the norm of the last step falls with more damping: - d norm / d damping, over the norm.

        The matrix is still factored as it was for this step; 0 where none could be factored since.
        """
        if self._pull is None or not self._norm > 0.0:
            return 0.0
        fall = float(self._pull @ self._solve(self._pull))
        return fall / self._norm**2 if fall > 0.0 else 0.0

    def _norm_of(self, inner: FloatArray) -> float:
        return math.sqrt((self._scale * np.square(inner)).sum())

    def _is_within(self, radius: float) -> bool:
        if abs(self._norm - radius) <= NEAR * radius:
            return True
        return self._norm <= radius and (self._is_least or np.isinf(radius))

    @property
    def _is_least(self) -> bool:
        return self._damping <= (LEAST if self.defect else 0.0)

    def _aimed(self, radius: float) -> float:
        """The damping at which the norm is the radius, to first order in its inverse."""
        least = LEAST if self.defect else 0.0
        given, self._given = self._given, None
        if given is not None:
            return given
        if (self._norm <= radius and self._is_least) or np.isinf(radius):
            return least
        slope = self._slope()
        return float(max(least, self._damping + (self._norm - radius) / radius / slope)) if slope else least

    def _between(self, aimed: float, low: float, high: float) -> float:
        """What is aimed at, kept between a damping that is too weak and one that is too strong."""
        least = LEAST if self.defect else 0.0
        if low < aimed < high or (aimed <= least and low == 0.0):
            return aimed
        if np.isinf(high):
            return max(10.0 * low, LEAST)
        return float(max(np.sqrt(max(low, 1e-6 * high) * high), 1e-3 * high))

    def _trial(self, step: NewtonStep) -> Trial:
        linearisation, promised = self._linearisation, step.promised
        if linearisation.damping:
            weights = linearisation.diagonal.copy()
            weights[self._equations.free.scalars] = self._scale
            promised += linearisation.damping * float(np.sum(weights * np.square(step.move)))
        is_full = self._is_least and not self._is_bent and self._share == 1.0
        return Trial(step.move, step.length, self._norm, promised, is_full, linearisation, self._share)


def _curvature_of(equations: NormalEquations) -> Curvature | None:
    from obseq.leastsquares.iterations.curvature import curvature_of

    return curvature_of(equations)
