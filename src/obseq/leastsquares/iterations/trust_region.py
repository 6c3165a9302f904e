"""Iterations that never accept a worse cost: Levenberg-Marquardt and dogleg."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from obseq.errors import DivergenceError, InputError, SingularSystemError
from obseq.leastsquares.iterations.gauss_newton import Progress, factor, recorded, solved, stop_reason
from obseq.leastsquares.solution.result import StopReason

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.assembly.normal_equations import Linearisation, NormalEquations
    from obseq.leastsquares.iterations.gauss_newton import Options
    from obseq.leastsquares.iterations.strategies import Dogleg, LevenbergMarquardt
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.solution.result import Iteration
    from obseq.leastsquares.solvers import Solver


LEAST_GAIN = 1e-4
"""Share of the predicted decrease of the cost that a step must bring to be accepted."""

NOISE = 1e-14
"""Predicted decrease of the cost, as a share of it, below which rounding decides: the step is accepted."""

MOST_TRIALS = 40
"""Trials of one iteration: the damping has then grown, or the radius shrunk, beyond any use."""

WEAK_DAMPING = 1e-2
"""Damping below which a short step means convergence."""


@dataclass(frozen=True)
class Trial:
    """A step to try.

    Attributes:
        step: (n_scalars,) of all unknowns.
        length: Its length in the metric of the normal matrix.
        predicted: The decrease of the cost that the linearisation promises.
        linearisation: The linearisation it comes from.
    """

    step: FloatArray
    length: float
    predicted: float
    linearisation: Linearisation


class Region(Protocol):
    """What differs between the methods: the step of a size, and how the size follows the gain."""

    def trial(self) -> Trial:
        """A step of the present size from the current values."""

    def learn(self, gain: float) -> None:
        """Adapts the size to the gain of the last trial: actual over predicted decrease of the cost."""

    @property
    def is_restraining(self) -> bool:
        """Whether the last step was much shorter than the full one."""


def iterate_in_region(
    equations: NormalEquations,
    region: Region,
    options: Options,
    redundancy: int,
    before: Callable[[int], None],
    progress: Callable[[Iteration], None],
) -> Progress:
    """Runs the iterations; the table of unknowns holds the last accepted state whatever happens."""
    done = Progress()
    for number in range(options.max_iterations):
        before(number)
        trial, accepted = _accepted_trial(equations, region)
        record = recorded(trial.linearisation, options, redundancy, trial.step, trial.length)
        done.iterations.append(record)
        progress(record)
        if not accepted:
            done.reason = StopReason.NO_DECREASE
            break
        reason = stop_reason(equations, options, redundancy, done.iterations[:-1], record, trial.step)
        if reason is not None and not region.is_restraining:
            done.reason = reason
            break
    return done


def _accepted_trial(equations: NormalEquations, region: Region) -> tuple[Trial, bool]:
    """Tries steps until one brings enough; the unknowns have moved by it, or are where they were."""
    table = equations.table
    start = table.state()
    for _ in range(MOST_TRIALS):
        trial = region.trial()
        cost = trial.linearisation.cost
        table.move(trial.step)
        try:
            after = sum(equations.sums_of_squares().values())
        except DivergenceError:
            after = float("inf")
        except BaseException:
            table.restore(start)
            raise
        gain = (cost - after) / trial.predicted if trial.predicted > 0.0 else 0.0
        if gain > LEAST_GAIN or (trial.predicted <= NOISE * cost and after < float("inf")):
            region.learn(max(gain, LEAST_GAIN))
            return trial, True
        table.restore(start)
        region.learn(gain)
    return trial, False


class DampedRegion:
    """Levenberg-Marquardt: the damping falls with good gains, and grows faster and faster with bad ones.

    It is a share of the largest diagonal met so far (Moré, 1978), so that an unknown that loses its influence
    does not run away.
    """

    def __init__(
        self,
        equations: NormalEquations,
        solver: Solver,
        constraints: Sequence[Batch],
        strategy: LevenbergMarquardt,
    ) -> None:
        self._equations = equations
        self._solver = solver
        self._constraints = constraints
        self._growth = 2.0
        self._floor = np.zeros(equations.pattern.n)
        self.damping = strategy.damping

    @property
    def is_restraining(self) -> bool:
        """Whether the damping is strong."""
        return self.damping > WEAK_DAMPING

    def trial(self) -> Trial:
        """The damped step; a singular matrix is damped more, until it is regular."""
        for _ in range(MOST_TRIALS):
            linearisation = self._equations.assemble(self.damping, floor=self._floor)
            self._floor = np.maximum(self._floor, linearisation.diagonal)
            try:
                step, length = solved(self._equations, self._solver, self._constraints, linearisation)
            except SingularSystemError:
                self._grow()
                continue
            # With (N + D) dx = -g: -2 g'dx - dx'N dx = dx'(N + D) dx + dx'D dx, and the last is not counted.
            return Trial(step, length, length * length, linearisation)
        raise SingularSystemError("the normal matrix stays singular however strong its damping")

    def learn(self, gain: float) -> None:
        """Nielsen's rule."""
        if gain > LEAST_GAIN:
            self.damping *= max(1.0 / 3.0, 1.0 - (2.0 * min(gain, 2.0) - 1.0) ** 3)
            self._growth = 2.0
        else:
            self._grow()

    def _grow(self) -> None:
        self.damping *= self._growth
        self._growth *= 2.0


class DoglegRegion:
    """Powell's dogleg, in unknowns scaled by the diagonal of the normal matrix."""

    def __init__(self, equations: NormalEquations, solver: Solver, strategy: Dogleg) -> None:
        if equations.n_unknowns != equations.pattern.n:
            raise InputError("dogleg: not for systems with eliminated unknowns; use levenberg-marquardt")
        self._equations = equations
        self._solver = solver
        self._radius = strategy.radius
        self._length = 0.0
        self._full = 0.0

    @property
    def is_restraining(self) -> bool:
        """Whether the last step was shorter than the Gauss-Newton step."""
        return self._length < 0.999 * self._full

    def trial(self) -> Trial:
        """The point of the dogleg path at the present radius."""
        equations = self._equations
        linearisation = equations.assemble()
        factor(equations, self._solver, (), linearisation)
        gradient = linearisation.gradient
        scale = np.sqrt(linearisation.values[equations.pattern.diagonal])
        matrix = equations.pattern.matrix(linearisation.values)
        newton = self._solver.solve(-gradient) * scale
        downhill = -gradient / scale
        curvature = float((downhill / scale) @ (matrix @ (downhill / scale)))
        steepest = downhill * (float(downhill @ downhill) / curvature if curvature > 0.0 else 0.0)
        self._full = float(np.linalg.norm(newton))
        if self._radius is None:
            self._radius = self._full
        path = _dogleg(newton, steepest, self._radius)
        self._length = float(np.linalg.norm(path))
        move = path / scale
        quadratic = float(move @ (matrix @ move))
        predicted = -2.0 * float(gradient @ move) - quadratic
        step = equations.step(move, linearisation)
        return Trial(step, float(np.sqrt(max(quadratic, 0.0))), predicted, linearisation)

    def learn(self, gain: float) -> None:
        """The radius grows with good gains at its edge, and shrinks with bad ones."""
        if gain > 0.75:
            self._radius = max(self._radius or 0.0, 3.0 * self._length)
        elif gain < 0.25:
            self._radius = 0.25 * self._length


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
