"""What is worked out once for a system as it is: normal equations with their pattern, and an analysed solver.

An analysis says whether it still fits its system; it is never repaired. A solution takes it out of the system
and puts it back at its end, so that what an interruption leaves half done is never used again.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.assembly.evaluation import used_blocks
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.diagnosis.singular import untouched_error
from obseq.leastsquares.iterations.constrained_solver import SubstitutedSolver
from obseq.leastsquares.iterations.datum_solver import Beyond, DatumSolver
from obseq.leastsquares.solvers import choose_solver

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.problem.definition import Definition
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.solvers import Solver


class Analysis:
    """Normal equations of a system with some of its blocks eliminated, or none, and their solver.

    Args:
        system: unknowns and equations.
        eliminated: (n_blocks,) blocks that do not enter the matrix.
        solver: name of the solver.
        threads: how many share the work.

    Raises:
        InputError: there are no equations.
        SingularSystemError: no equation touches some unknowns that are not frozen.
    """

    def __init__(self, system: Definition, eliminated: BoolArray, solver: str, threads: int) -> None:
        self._state = _Structure(system)
        self._state.refuse_untouched(system)
        self._eliminated = eliminated.copy()
        _refuse_clusters(system, eliminated)
        self._solver_name = solver
        self._threads = threads
        self.equations = NormalEquations(
            system.unknowns,
            system.batches,
            system.priors,
            eliminated,
            system.constraints,
            system.viscosities,
            threads,
        )

    def fits(self, system: Definition, eliminated: BoolArray) -> bool:
        """Whether the system is what it was, its values, weights and measurements apart."""
        return np.array_equal(eliminated, self._eliminated) and self._state == _Structure(system)

    @cached_property
    def solver(self) -> Solver:
        """The solver, which has analysed the pattern."""
        solver = self._new_solver()
        solver.analyse(self.equations.pattern)
        return solver

    def released_solver(self) -> Solver:
        """The solver, for one who keeps it: the next one is a new one."""
        solver = self.solver
        del self.solver
        return solver

    def _new_solver(self) -> Solver:
        if self._state.constraints:
            if self._state.datum.scalars.size:
                raise InputError("a datum and hard constraints do not go together: freeze unknowns instead")
            return SubstitutedSolver(self._solver_name, self._threads)
        solver = choose_solver(self.equations.pattern, self._solver_name, threads=self._threads)
        return self._on_datum(solver) if self._state.datum.scalars.size else solver

    def _on_datum(self, solver: Solver) -> DatumSolver:
        equations, (scalars, reference) = self.equations, self._state.datum
        table, numbers = equations.table, equations.free.number[scalars]
        beyond, chosen = None, np.zeros(equations.pattern.n, dtype=bool)
        inside = numbers >= 0
        chosen[numbers[inside]] = True
        if (~inside & ~table.frozen[scalars]).any():
            chosen[:] = True
            beyond = Beyond(scalars, equations.extended, partial(_change, table, scalars, reference))
        offset = partial(_scattered, table, scalars[inside], reference[inside], numbers[inside], len(chosen))
        return DatumSolver(solver, chosen, offset, beyond)


class Analyses:
    """The analyses kept from one solution to the next, each as long as it fits."""

    def __init__(self) -> None:
        self._reduced: Analysis | None = None
        self._whole: Analysis | None = None

    def __reduce__(self) -> tuple[type[Analyses], tuple[()]]:
        return Analyses, ()

    def whole(self, system: Definition, solver: str, threads: int) -> Analysis:
        """The analysis of all unknowns."""
        none = np.zeros(len(system.unknowns), dtype=bool)
        if self._whole is None or not self._whole.fits(system, none):
            self._whole = Analysis(system, none, solver, threads)
        return self._whole

    def reduced(self, system: Definition, solver: str, threads: int) -> Analysis:
        """The analysis without the blocks that are to be eliminated."""
        eliminated = system.unknowns.eliminated
        if not eliminated.any():
            return self.whole(system, solver, threads)
        if self._reduced is None or not self._reduced.fits(system, eliminated):
            self._reduced = Analysis(system, eliminated, solver, threads)
        return self._reduced


class _Structure:
    """All that the pattern of the normal equations follows from."""

    def __init__(self, system: Definition) -> None:
        table = system.unknowns
        self.batches, self.priors = system.batches, system.priors
        self.constraints, self.viscosities = system.constraints, system.viscosities
        self.datum = system.datum
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
            and np.array_equal(self.frozen, other.frozen)
            and np.array_equal(self.used, other.used)
        )

    __hash__ = None  # type: ignore[assignment]  # its arrays may be compared, not looked up

    def refuse_untouched(self, system: Definition) -> None:
        if not self.batches and not self.priors:
            raise InputError("the system has no equations: add observations or priors")
        table = system.unknowns
        free = np.add.reduceat(~self.frozen, table.start, dtype=np.int64) > 0
        untouched = np.flatnonzero(free & ~self.used)
        if untouched.size:
            raise untouched_error(table, untouched)


def _refuse_clusters(system: Definition, eliminated: BoolArray) -> None:
    for batch in system.batches:
        touched = eliminated[batch.blocks].any(axis=0)
        if batch.clusters is not None and touched.any():
            raise InputError(
                f"{batch.label(int(np.argmax(touched)))}: a covariance across observations concerns blocks "
                "that are to be eliminated; do not eliminate them"
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
