"""What is worked out once for a system as it is: normal equations with their pattern, and an analysed solver.

An analysis says whether it still fits its system; it is never repaired. A solution takes it out of the system
and puts it back at its end, so that what an interruption leaves half done is never used again.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.errors import InputError
from obseq.leastsquares.assembly.evaluation import used_blocks
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.assembly.threads import checked_threads
from obseq.leastsquares.blocks.choice import checked_choice, chosen_solver
from obseq.leastsquares.diagnosis.rejection import rejection_told
from obseq.leastsquares.diagnosis.singular import untouched_error
from obseq.leastsquares.iterations.constrained_solver import ConstrainedSolver
from obseq.leastsquares.iterations.constraints import held_rows, substitution
from obseq.leastsquares.iterations.datum_solver import Beyond, DatumSolver
from obseq.leastsquares.iterations.gauss_newton import Progress
from obseq.leastsquares.iterations.newton import factor
from obseq.leastsquares.iterations.runs import iterations_of, move, move_at_once
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solution.result import Iteration, StopReason
from obseq.leastsquares.solvers.blas import one_blas_thread

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.blocks.blocks import Blocks
    from obseq.leastsquares.iterations.arrival import Options
    from obseq.leastsquares.iterations.constraints import Substitution
    from obseq.leastsquares.iterations.strategies import Strategy
    from obseq.leastsquares.problem.datum import Datum
    from obseq.leastsquares.problem.problem import Problem
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.solvers import Solver


class Analysis:
    """Normal equations of a system with some of its blocks eliminated, or none, and their solver.

    Args:
        problem: unknowns and equations.
        eliminated: (n_blocks,) blocks that do not enter the matrix.
        solver: name of the solver, or how it goes in blocks.
        threads: how many share the work.

    Raises:
        InputError: there are no equations.
        SingularSystemError: no equation touches some unknowns that are not frozen.
    """

    def __init__(self, problem: Problem, eliminated: BoolArray, solver: str | Blocks, threads: int) -> None:
        self._state = _Structure(problem)
        self._state.refuse_untouched(problem)
        self._problem = problem
        self._eliminated = eliminated.copy()
        _refuse_clusters(problem, eliminated)
        self._choose = partial(chosen_solver, name=solver, threads=threads)
        self._threads = threads
        self.equations = NormalEquations(
            problem.unknowns,
            problem.batches,
            problem.priors,
            eliminated,
            problem.constraints,
            problem.viscosities,
            threads,
        )

    def fits(self, eliminated: BoolArray) -> bool:
        """Whether the problem is what it was, its values, weights and measurements apart."""
        return _are_equal(eliminated, self._eliminated) and self._state == _Structure(self._problem)

    @cached_property
    def solver(self) -> Solver:
        """The solver, which has analysed the pattern."""
        solver = self._new_solver()
        solver.analyse(self.equations.pattern)
        return solver

    @property
    def substitution(self) -> Substitution | None:
        """The hard constraints at the current values; None without."""
        return self._substitution() if self._state.constraints else None

    @property
    def datum_defect(self) -> int:
        """Number of parameters that the observations leave free and the datum takes; 0 without a datum."""
        if not self._state.datum.scalars.size:
            return 0
        if not self.solver.is_factored:
            factor(self.equations, self.solver, self.equations.assemble(viscous=False))
        return int(self.solver.null_vectors().shape[1])

    @property
    def n_unknowns(self) -> int:
        """Number of free scalar unknowns, less the independent hard constraints."""
        held = self.substitution
        return self._problem.n_free - (held.rank if held else 0)

    @property
    def redundancy(self) -> int:
        """Equations and datum parameters minus free unknowns: the one definition of every statistic."""
        counted = self._problem.n_observations + self._problem.n_constraints + self.datum_defect
        return counted - self.n_unknowns

    def iterate(
        self,
        strategy: Strategy,
        options: Options,
        redundancy: int,
        before: Callable[[int], None],
        progress: Callable[[Iteration], None],
    ) -> Progress:
        """Moves the unknowns to the solution; `before` comes before each linearisation and after the last."""
        if not self._problem.n_free:
            before(0)
            return Progress(reason=StopReason.NO_UNKNOWNS)
        run = iterations_of(strategy, self.equations, self.solver)
        with one_blas_thread(), rejection_told(self._problem.unknowns, self._problem.batches):
            done = run(options, redundancy, before, progress)
        before(len(done.iterations))
        return done

    def step(self) -> None:
        """Moves the unknowns by one Gauss-Newton step, for those who want nothing else of an iteration.

        Raises:
            DivergenceError: an equation, or the step, is not finite.
            SingularSystemError: some unknowns are undetermined.
        """
        if self._problem.n_free and not move_at_once(self.equations, self.solver):
            with one_blas_thread(), rejection_told(self._problem.unknowns, self._problem.batches):
                move(self.equations, self.solver)

    def cofactors(self) -> Cofactors:
        """Cofactors of all unknowns at the solution, without the damping that the iterations may have had."""
        equations, solver = self.equations, self._released_solver()
        with one_blas_thread(), rejection_told(equations.table, equations.batches):
            factor(equations, solver, equations.assemble(viscous=False))
            equations.rest()
            return Cofactors(equations.table, equations.free, equations.pattern, solver, self._state)

    def is_of(self, cofactors: Cofactors) -> bool:
        """Whether some cofactors are of these equations, unknowns being frozen as they were then."""
        return self._state == cofactors.structure

    def _released_solver(self) -> Solver:
        """The solver, for one who keeps it: the next one is a new one."""
        solver = self.solver
        del self.solver
        return solver

    def _substitution(self) -> Substitution:
        return substitution(self.equations.table, self.equations.free, self.equations.constraints)

    def _new_solver(self) -> Solver:
        if self._state.constraints and not self._state.datum.scalars.size:
            return ConstrainedSolver(self._substitution, self._choose)
        solver = self._choose(self.equations.pattern)
        return self._on_datum(solver) if self._state.datum.scalars.size else solver

    def _on_datum(self, solver: Solver) -> DatumSolver:
        equations, datum = self.equations, self._state.datum
        scalars, reference = datum.scalars, datum.reference
        table, numbers = equations.table, equations.free.number[scalars]
        beyond, chosen = None, np.zeros(equations.pattern.n, dtype=bool)
        inside = numbers >= 0
        chosen[numbers[inside]] = True
        if (~inside & ~table.frozen[scalars]).any():
            chosen[:] = True
            beyond = Beyond(scalars, equations.extended, partial(_change, table, scalars, reference))
        offset = partial(_scattered, table, scalars[inside], reference[inside], numbers[inside], len(chosen))
        weak = partial(_directions, table, datum, inside, numbers[inside], len(chosen))
        is_whole = not equations.viscosities and equations.n_unknowns == equations.pattern.n
        seen = equations.seen if is_whole else None
        holds = partial(held_rows, table, equations.free, equations.constraints)
        if equations.constraints and beyond is not None:
            raise InputError("hard constraints, and a datum of eliminated unknowns: take one of them back")
        return DatumSolver(solver, chosen, offset, beyond, weak, datum.n_held, seen, holds)


class Analyses:
    """The analyses of a problem, kept from one solution to the next, each as long as it fits.

    Args:
        problem: unknowns and equations.
        solver: name of the solver, or how it goes in blocks.
        threads: how many share the work.
    """

    def __init__(self, problem: Problem, solver: str | Blocks, threads: int) -> None:
        self._problem = problem
        self._solver = checked_choice(solver)
        self.threads = checked_threads(threads)
        self._reduced: Analysis | None = None
        self._whole: Analysis | None = None

    def __reduce__(self) -> tuple[type[Analyses], tuple[Problem, str | Blocks, int]]:
        return Analyses, (self._problem, self._solver, self.threads)

    def fresh(self) -> Analyses:
        """The same without any analysis."""
        return Analyses(self._problem, self._solver, self.threads)

    def whole(self) -> Analysis:
        """The analysis of all unknowns."""
        self._whole = self._fitting(self._whole, np.zeros(len(self._problem.unknowns), dtype=bool))
        return self._whole

    def reduced(self) -> Analysis:
        """The analysis without the blocks that are to be eliminated."""
        eliminated = self._problem.unknowns.eliminated
        if not eliminated.any():
            return self.whole()
        self._reduced = self._fitting(self._reduced, eliminated)
        return self._reduced

    def _fitting(self, kept: Analysis | None, eliminated: BoolArray) -> Analysis:
        if kept is not None and kept.fits(eliminated):
            return kept
        return Analysis(self._problem, eliminated, self._solver, self.threads)


class _Structure:
    """All that the pattern of the normal equations follows from."""

    def __init__(self, problem: Problem) -> None:
        table = problem.unknowns
        self.batches, self.priors = problem.batches, problem.priors
        self.constraints, self.viscosities = problem.constraints, problem.viscosities
        self.datum = problem.datum
        self.frozen = table.frozen.copy()
        self.used = used_blocks(table, [*self.batches, *self.constraints], self.priors)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, _Structure)
            and self.batches == other.batches
            and self.priors == other.priors
            and self.constraints == other.constraints
            and self.viscosities == other.viscosities
            and self.datum is other.datum
            and _are_equal(self.frozen, other.frozen)
            and _are_equal(self.used, other.used)
        )

    __hash__ = None  # type: ignore[assignment]  # its arrays may be compared, not looked up

    def refuse_untouched(self, problem: Problem) -> None:
        if not self.batches and not self.priors:
            raise InputError("the system has no equations: add observations or priors")
        table = problem.unknowns
        free = np.add.reduceat(~self.frozen, table.start, dtype=np.int64) > 0
        untouched = np.flatnonzero(free & ~self.used)
        if untouched.size:
            raise untouched_error(table, untouched)


def _are_equal(first: BoolArray, second: BoolArray) -> bool:
    return len(first) == len(second) and bool((first == second).all())


def _refuse_clusters(problem: Problem, eliminated: BoolArray) -> None:
    for batch in problem.batches:
        if batch.clusters is None:
            continue
        touched = eliminated[batch.blocks].any(axis=0)
        if touched.any():
            raise InputError(
                f"{batch.label(int(np.argmax(touched)))}: a covariance across observations concerns blocks "
                "that are to be eliminated, and is only for others: eliminate(ids, False) takes them back"
            )


def _change(table: UnknownTable, scalars: IntArray, reference: FloatArray) -> FloatArray:
    """How far some unknowns are from their reference values."""
    return np.asarray(table.values[scalars] - reference)


def _scattered(
    table: UnknownTable, scalars: IntArray, reference: FloatArray, numbers: IntArray, n: int
) -> FloatArray:
    """(n,) the same at their numbers in the matrix, zero elsewhere."""
    change = np.zeros(n)
    change[numbers] = _change(table, scalars, reference)
    return change


def _directions(
    table: UnknownTable, datum: Datum, inside: BoolArray, numbers: IntArray, n: int
) -> FloatArray:
    """(n, k) what unknowns of the matrix do now along the weak directions of their datum."""
    moves = datum.weak(table.values)[inside]
    found = np.zeros((n, moves.shape[1]))
    found[numbers] = moves
    return found
