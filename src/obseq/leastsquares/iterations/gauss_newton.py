"""Gauss-Newton iterations: linearise, solve, move, until the step says nothing any more."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import field
from typing import TypeAlias

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import DivergenceError, SingularSystemError
from obseq.leastsquares.assembly.linearisation import Linearisation
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.diagnosis.singular import SHOWN
from obseq.leastsquares.iterations.arrival import CONTRACTION, Arrival, Options
from obseq.leastsquares.problem.unknowns import State
from obseq.leastsquares.solution.result import Iteration, StopReason

Direction: TypeAlias = "Callable[[Linearisation], tuple[FloatArray, float]]"
"""Linearisation -> step of all unknowns (n_scalars,), and its length sqrt(dx' N dx)."""

ADVICE = "Start closer to the solution, or with a strategy that holds steps back ('controlled')"


@dataclass
class Progress:
    """What the iterations have done so far.

    Attributes:
        iterations: one record each.
        reason: why they ended.
        defect: number of parameters that the observations leave free, where the strategy bears it.
        evaluations: how often all residuals were computed.
        weak: what some unknowns are hardly determined by, where the iterations have led.
    """

    iterations: list[Iteration] = field(default_factory=list)
    reason: StopReason = StopReason.ITERATIONS
    defect: int = 0
    evaluations: int = 0
    weak: SingularSystemError | None = None


def sigma0_of(squares: dict[str, float], groups: Collection[str] | None, redundancy: int) -> float | None:
    """Square root of the sum of squares of the groups over the redundancy; None where that has no meaning."""
    if redundancy <= 0:
        return None
    total = sum(value for group, value in squares.items() if groups is None or group in groups)
    return math.sqrt(total / redundancy)


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


def iterate(
    equations: NormalEquations,
    direction: Direction,
    options: Options,
    redundancy: int,
    before: Callable[[int], None],
    progress: Callable[[Iteration], None],
    linearise: Callable[[], Linearisation],
) -> Progress:
    """Runs the iterations; the table of unknowns holds a state whose residuals are finite whatever happens.

    Args:
        equations: the system.
        direction: gives the step of a linearisation.
        options: when to stop.
        redundancy: of the system.
        before: called before each linearisation.
        progress: receives each record.
        linearise: gives the equations at the current values.

    Raises:
        DivergenceError: the iterations have left where the equations are defined and determine the unknowns.
    """
    done, arrival, table = Progress(), Arrival(equations, options.tolerance), equations.table
    best, least, cost, counted = table.state(), np.inf, np.inf, equations.evaluations
    last: FloatArray | None = None
    turns: list[bool] = []
    for number in range(options.max_iterations):
        before(number)
        try:
            cost = np.inf
            linearisation = linearise()
            cost = linearisation.cost
            step, length = direction(linearisation)
        except (DivergenceError, SingularSystemError) as error:
            if number:
                raise _gone(error, cost, equations, done.iterations, best) from None
            raise
        if cost < least:
            best, least = table.state(), cost
        record = recorded(linearisation, options, redundancy, step, length)
        reason = arrival.reason(step, length, record.cost, redundancy, linearisation.diagonal)
        table.move(step)
        turns.append(_turns(step, last, linearisation.diagonal))
        last = step
        done.iterations.append(record)
        progress(record)
        if reason is not None:
            done.reason = reason
            break
    else:
        done.reason = _unfinished(done.iterations, turns)
    done.evaluations = equations.evaluations - counted
    return done


def _turns(step: FloatArray, last: FloatArray | None, weights: FloatArray) -> bool:
    """Whether a step goes against the one before it."""
    return last is not None and float((weights * step) @ last) < 0.0


def _unfinished(iterations: list[Iteration], turns: list[bool]) -> StopReason:
    """What the iterations did whose number was not enough: diverge, oscillate, or no more than that."""
    if not iterations:
        return StopReason.ITERATIONS
    first, last, half, part = iterations[0], iterations[-1], len(turns) // 2, len(turns) // 4
    if part and last.length > first.length and last.cost > first.cost:
        return StopReason.DIVERGED
    lengths = [step.length for step in iterations[half:]]
    if not part or max(lengths[-part:]) < CONTRACTION * max(lengths[:-part]):
        return StopReason.ITERATIONS
    return StopReason.OSCILLATES if sum(turns[half:]) > (len(turns) - half) // 4 else StopReason.ITERATIONS


def _gone(
    error: DivergenceError | SingularSystemError,
    cost: float,
    equations: NormalEquations,
    iterations: list[Iteration],
    best: State,
) -> DivergenceError:
    """The error to raise when a linearisation fails after others that did not."""
    first, last, number = iterations[0], iterations[-1], len(iterations) + 1
    equations.table.restore(best)
    back = "the unknowns are back at their last accepted values, the best ones"
    if isinstance(error, SingularSystemError):
        lost = f"{len(error.unknowns)} unknown(s) have no influence any more: {_some(error.unknowns)}"
        error = DivergenceError(lost)
    size = f"a step of {last.max_step:.3g}, a sum of squares of {cost:.3g}, {first.cost:.3g} at first"
    return DivergenceError(f"Gauss-Newton diverges ({size}): {error} (iteration {number}; {back}). {ADVICE}")


def strayed(error: SingularSystemError, iterations: list[Iteration]) -> SingularSystemError:
    """The error of a matrix that was regular at first and is singular where accepted steps have led."""
    last, number = iterations[-1], len(iterations) + 1
    size = f"a sum of squares of {last.cost:.3g} before the last step of {last.max_step:.3g}"
    size += f", {iterations[0].cost:.3g} at first"
    advice = ". If nothing is missing, start closer to the solution, or with 'levenberg-marquardt'"
    return SingularSystemError(
        f"the steps led where the observations do not determine some unknowns any more (iteration {number}, "
        f"{size}; the unknowns are at their last accepted values): {error}"
        f"{advice if error.unknowns else ''}",
        error.unknowns,
        error.defect,
    )


def _some(names: tuple[str, ...]) -> str:
    return ", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else "")
