"""Gauss-Newton iterations: linearise, solve, move, until the step says nothing any more."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from obseq.errors import DivergenceError, SingularMatrixError
from obseq.leastsquares.diagnosis.singular import singular_error
from obseq.leastsquares.iterations.constrained_solver import SubstitutedSolver
from obseq.leastsquares.iterations.constraints import substitution
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.problem.unknowns import Kind
from obseq.leastsquares.solution.result import Iteration, StopReason

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.assembly.normal_equations import Linearisation, NormalEquations
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.solvers import Solver


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


Direction: TypeAlias = "Callable[[Linearisation], tuple[FloatArray, float]]"
"""Linearisation -> step of all unknowns (n_scalars,), and its length sqrt(dx' N dx)."""


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
    direction: Direction,
    options: Options,
    redundancy: int,
    before: Callable[[int], None],
    progress: Callable[[Iteration], None],
    damping: float = 0.0,
) -> Progress:
    """Runs the iterations; the table of unknowns holds the last accepted state whatever happens.

    A state is accepted once all its residuals are finite.

    Args:
        equations: the system.
        direction: gives the step of a linearisation.
        options: when to stop.
        redundancy: of the system.
        before: called before each linearisation.
        progress: receives each record.
        damping: constant share of the diagonal that is added to it.
    """
    done = Progress()
    table = equations.table
    accepted = table.state()
    for number in range(options.max_iterations):
        before(number)
        try:
            linearisation = equations.assemble(damping)
            accepted = table.state()
            step, length = direction(linearisation)
        except DivergenceError as error:
            table.restore(accepted)
            when = f" (iteration {number + 1}; the unknowns are back at their last accepted values)"
            raise DivergenceError(f"{error}{when if number else ''}") from None
        record = recorded(linearisation, options, redundancy, step, length)
        reason = stop_reason(equations, options, redundancy, done.iterations, record, step)
        table.move(step)
        done.iterations.append(record)
        progress(record)
        if reason is not None:
            done.reason = reason
            break
    return done


def recorded(
    linearisation: Linearisation, options: Options, redundancy: int, step: FloatArray, length: float
) -> Iteration:
    """The record of an iteration."""
    return Iteration(
        sigma0_of(linearisation.squares, options.sigma0_groups, redundancy),
        float(np.abs(step).max(initial=0.0)),
        length,
        linearisation.squares,
    )


def solved(
    equations: NormalEquations, solver: Solver, constraints: Sequence[Batch], linearisation: Linearisation
) -> tuple[FloatArray, float]:
    """The step for all unknowns (zero where frozen) and its length sqrt(dx' N dx)."""
    offset = factor(equations, solver, constraints, linearisation)
    gradient = linearisation.gradient
    if not offset.any():
        solved = solver.solve(-gradient)
        squared = linearisation.eliminated - float(solved @ gradient)
    else:
        normal = equations.pattern.matrix(linearisation.values)
        solved = offset + solver.solve(-gradient - normal @ offset)
        squared = linearisation.eliminated + float(solved @ (normal @ solved))
    if isinstance(solver, DatumSolver):
        solved = solver.settled(solved)
    if not np.isfinite(solved).all():
        raise DivergenceError("the step of the unknowns is not finite")
    return equations.step(solved, linearisation), float(np.sqrt(max(0.0, squared)))


def factor(
    equations: NormalEquations, solver: Solver, constraints: Sequence[Batch], linearisation: Linearisation
) -> FloatArray:
    """Factors the normal matrix, reduced by hard constraints; returns the step (n_free,) that these ask for.

    Raises:
        SingularSystemError: some unknowns are undetermined; their names are in the error.
    """
    offset = np.zeros(equations.pattern.n)
    if isinstance(solver, SubstitutedSolver):
        found = substitution(equations.table, equations.free, constraints)
        solver.substitute(found)
        offset = found.offset
    try:
        solver.factor(linearisation.values)
    except SingularMatrixError:
        raise singular_error(equations.table, equations.free, equations.pattern, solver) from None
    return offset


def stop_reason(
    equations: NormalEquations,
    options: Options,
    redundancy: int,
    past: list[Iteration],
    record: Iteration,
    step: FloatArray,
) -> StopReason | None:
    """Why the iterations end with this step; None when they go on."""
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
