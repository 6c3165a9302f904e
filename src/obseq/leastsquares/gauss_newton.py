"""Gauss-Newton iterations: linearise, solve, move, until the step says nothing any more."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.diagnosis import singular_error
from obseq.leastsquares.normal import DivergenceError
from obseq.leastsquares.result import Iteration, StopReason
from obseq.leastsquares.solvers import SingularMatrixError
from obseq.leastsquares.unknowns import Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from numpy.typing import NDArray

    from obseq.leastsquares.normal import Linearisation, NormalEquations
    from obseq.leastsquares.solvers import Solver

    FloatArray = NDArray[np.float64]

ROUNDING = 64.0 * np.finfo(np.float64).eps
"""A step below this share of the coordinates themselves is made of rounding."""

NEGLIGIBLE = 1e-9
"""A step below this share of the coordinates may end the iterations when the cost no longer decreases."""


@dataclass(frozen=True)
class Options:
    """When to stop, and what to count.

    Attributes:
        max_iterations: no more iterations than this.
        tolerance: the iterations end when a step is shorter than `tolerance * sigma0` in the metric of the
            normal
            matrix: then no unknown moved by more than `tolerance` of its own a-posteriori standard deviation.
            Negative: all iterations are done.
        sigma0_groups: groups whose residuals make the numerator of sigma0; None for all.
    """

    max_iterations: int = 20
    tolerance: float = 1e-6
    sigma0_groups: Collection[str] | None = None


@dataclass
class Progress:
    """What the iterations have done so far."""

    iterations: list[Iteration] = field(default_factory=list)
    reason: StopReason = StopReason.ITERATIONS


def sigma0_of(squares: dict[str, float], groups: Collection[str] | None, redundancy: int) -> float | None:
    """Square root of the sum of squares of the groups over the redundancy; None where that has no meaning."""
    if redundancy <= 0:
        return None
    total = sum(value for group, value in squares.items() if groups is None or group in groups)
    return float(np.sqrt(total / redundancy))


def iterate(
    equations: NormalEquations,
    solver: Solver,
    options: Options,
    redundancy: int,
    before: Callable[[int], None],
    progress: Callable[[Iteration], None],
) -> Progress:
    """Runs the iterations; the table of unknowns holds the last accepted state whatever happens.

    A state is accepted once all its residuals are finite.
    """
    done = Progress()
    table = equations.table
    accepted = table.state()
    for number in range(options.max_iterations):
        before(number)
        try:
            linearisation = equations.assemble()
            accepted = table.state()
            step, length = _solved(equations, solver, linearisation)
        except DivergenceError as error:
            table.restore(accepted)
            when = f" (iteration {number + 1}; the unknowns are back at their last accepted values)"
            raise DivergenceError(f"{error}{when if number else ''}") from None
        record = Iteration(
            sigma0_of(linearisation.squares, options.sigma0_groups, redundancy),
            float(np.abs(step).max(initial=0.0)),
            length,
            linearisation.squares,
        )
        reason = _stop_reason(equations, options, redundancy, done.iterations, record, step)
        table.move(step)
        done.iterations.append(record)
        progress(record)
        if reason is not None:
            done.reason = reason
            break
    return done


def _solved(
    equations: NormalEquations, solver: Solver, linearisation: Linearisation
) -> tuple[FloatArray, float]:
    """The step for all unknowns (zero where frozen) and its length sqrt(dx' N dx)."""
    factor(equations, solver, linearisation)
    solved = solver.solve(-linearisation.gradient)
    if not np.isfinite(solved).all():
        raise DivergenceError("the step of the unknowns is not finite")
    squared = linearisation.eliminated - float(solved @ linearisation.gradient)
    return equations.step(solved, linearisation), float(np.sqrt(max(0.0, squared)))


def factor(equations: NormalEquations, solver: Solver, linearisation: Linearisation) -> None:
    """Factors the normal matrix.

    Raises:
        SingularSystemError: some unknowns are undetermined; their names are in the error.
    """
    try:
        solver.factor(linearisation.values)
    except SingularMatrixError:
        raise singular_error(equations, solver) from None


def _stop_reason(
    equations: NormalEquations,
    options: Options,
    redundancy: int,
    past: list[Iteration],
    record: Iteration,
    step: FloatArray,
) -> StopReason | None:
    if options.tolerance < 0.0:
        return None
    sigma0 = float(np.sqrt(record.cost / redundancy)) if redundancy > 0 else 1.0
    if record.length <= options.tolerance * sigma0:
        return StopReason.STEP
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nanmax(np.abs(step) / _scales(equations), initial=0.0)
    if share <= ROUNDING:
        return StopReason.ROUNDING
    if past and share <= NEGLIGIBLE and record.length <= options.tolerance and record.cost >= past[-1].cost:
        return StopReason.STALLED
    return None


def _scales(equations: NormalEquations) -> FloatArray:
    """Size of what a step is added to: all points together, one for angles, else the value itself."""
    table = equations.table
    kind = np.repeat(table.kind, table.size)
    scales = np.abs(table.values)
    points = (kind == Kind.POINT3) | (kind == Kind.POINT2)
    scales[points] = scales[points].max(initial=0.0)
    scales[(kind == Kind.ROTATION) | (kind == Kind.DIRECTION)] = 1.0
    return scales
