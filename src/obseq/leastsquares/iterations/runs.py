"""From a strategy to the iterations that follow it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.leastsquares.assembly.linearisation import Linearisation, SolvedLinearisation
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.iterations.arrival import Options
from obseq.leastsquares.iterations.damped_path import DampedPath
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.iterations.gauss_newton import Progress, iterate
from obseq.leastsquares.iterations.newton import factor, newton_step
from obseq.leastsquares.iterations.strategies import Controlled, Dogleg, LevenbergMarquardt, Strategy
from obseq.leastsquares.iterations.trust_region import iterate_in_region
from obseq.leastsquares.solution.result import Iteration
from obseq.leastsquares.solvers import Solver
from obseq.leastsquares.solvers.base import BaseSolver

Iterations: TypeAlias = (
    "Callable[[Options, int, Callable[[int], None], Callable[[Iteration], None]], Progress]"
)
"""(options, redundancy, before, progress) -> what the iterations did."""


def iterations_of(strategy: Strategy, equations: NormalEquations, solver: Solver) -> Iterations:
    """The iterations of a strategy on a system, its solver analysed."""
    if isinstance(strategy, Dogleg):
        from obseq.leastsquares.iterations.dogleg_path import DoglegPath

        _require_plain("dogleg", equations)
        return partial(iterate_in_region, equations, DoglegPath(equations, solver, strategy.radius))
    if isinstance(strategy, Controlled):
        return partial(iterate_in_region, equations, DampedPath(equations, solver, is_bold=True))
    if isinstance(strategy, LevenbergMarquardt) and not strategy.constant:
        path = DampedPath(equations, solver, damping=strategy.damping)
        return partial(iterate_in_region, equations, path)
    normal = partial(_normal_direction, equations, solver)
    if isinstance(strategy, LevenbergMarquardt):
        if isinstance(solver, DatumSolver):
            raise InputError("a constant damping holds a free network where it is: not together with a datum")
        return partial(iterate, equations, normal, linearise=partial(equations.assemble, strategy.share))
    if strategy.step == "normal":
        linearise = partial(_linearised, equations) if _is_dense(solver) else equations.assemble
        return partial(iterate, equations, normal, linearise=linearise)
    _require_plain(strategy.step, equations)
    rows = partial(_row_direction, equations, strategy.step)
    return partial(iterate, equations, rows, linearise=equations.assemble)


def move_at_once(equations: NormalEquations, solver: Solver) -> bool:
    """Moves the unknowns by one Gauss-Newton step where matrix and step are found at once, or not at all.

    Returns:
        Whether they have moved: the system is small, without constraints or datum, and clearly regular.
    """
    solved = equations.solve_at_once() if _is_dense(solver) else None
    if solved is not None:
        equations.table.move(solved.step)
    return solved is not None


def move(equations: NormalEquations, solver: Solver) -> None:
    """Moves the unknowns by one Gauss-Newton step.

    Raises:
        DivergenceError: an equation, or the step, is not finite.
        SingularSystemError: some unknowns are undetermined.
    """
    step, _ = _normal_direction(equations, solver, equations.assemble())
    equations.table.move(step)


def _is_dense(solver: Solver) -> bool:
    return isinstance(solver, BaseSolver) and solver.name == "dense"


def _require_plain(name: str, equations: NormalEquations) -> None:
    if equations.constraints or equations.n_unknowns != equations.pattern.n:
        raise InputError(
            f"{name}: not for systems with hard constraints or eliminated unknowns; use "
            "gauss-newton, controlled or levenberg-marquardt"
        )


def _linearised(equations: NormalEquations) -> Linearisation:
    """The equations at the current values; with their step where they are small and clearly regular."""
    solved = equations.solve_at_once()
    return equations.assemble() if solved is None else solved


def _normal_direction(
    equations: NormalEquations, solver: Solver, linearisation: Linearisation
) -> tuple[FloatArray, float]:
    if isinstance(linearisation, SolvedLinearisation):
        return linearisation.step, linearisation.length
    offset = factor(equations, solver, linearisation)
    step = newton_step(equations, solver, linearisation, offset)
    return step.move, step.length


def _row_direction(
    equations: NormalEquations, name: str, linearisation: Linearisation
) -> tuple[FloatArray, float]:
    """The step of the stacked rows; its length is the norm of J dx."""
    from obseq.leastsquares.iterations.stacked_rows import ROW_STEPS, stacked_rows

    rows = stacked_rows(equations)
    move = ROW_STEPS[name](rows)
    return equations.step(move, linearisation), float(np.linalg.norm(rows.jacobian @ move))
