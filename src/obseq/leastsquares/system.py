"""The least squares system: unknowns by name, equations in batches, one solution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.assembly.normal_equations import NormalEquations, raw_residuals, used_blocks
from obseq.leastsquares.assembly.threads import blas_threads, checked_threads
from obseq.leastsquares.diagnosis.singular import untouched_error
from obseq.leastsquares.iterations.constrained_solver import SubstitutedSolver
from obseq.leastsquares.iterations.constraints import substitution
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.iterations.gauss_newton import Options, Progress, factor, sigma0_of
from obseq.leastsquares.iterations.runs import runner
from obseq.leastsquares.iterations.strategies import GaussNewton, strategy_of
from obseq.leastsquares.problem.definition import Definition
from obseq.leastsquares.problem.objects import synchronise
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solution.result import Iteration, LeastSquaresResult, StopReason
from obseq.leastsquares.solvers import choose_solver

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray
    from obseq.leastsquares.iterations.constraints import Substitution
    from obseq.leastsquares.iterations.strategies import Strategy
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.objects import UnknownObject
    from obseq.leastsquares.solvers import Solver


class LeastSquares(Definition):
    """Unknowns and equations of an adjustment.

    Unknowns are added in blocks that have names, and are addressed by the ids that adding them returns (int64
    arrays). Equations are added in batches of one formula. `solve` changes the unknowns in place and
    returns a result that keeps its own copy.

    Args:
        solver: name of the solver (see `solvers.choose_solver`).
        threads: how many share assembly, factorisation and standard deviations. The solution differs by
            rounding from one number to another, not from run to run. Up to 16,000 observations, and for
            small matrices, there is one whatever is asked for.

    Example:
        >>> system = LeastSquares()
        >>> a, b = system.add_scalars(["a", "b"], [0.0, 0.0])
        >>> rows = system.add_linear([[a, a, b]], [[[1.0], [1.0], [1.0]]], [1.0, 3.0, 5.0], 0.1)
        >>> system.solve().values([a, b]).ravel().tolist()
        [2.0, 5.0]
    """

    def __init__(self, solver: str = "auto", threads: int = 1) -> None:
        super().__init__()
        self._solver_name = solver
        self._threads = checked_threads(threads)
        self._bound: dict[bool, NormalEquations] = {}
        self._solvers: dict[bool, Solver] = {}

    # Objects

    def attach(self, *objects: UnknownObject) -> None:
        """Adds the unknowns of objects; they get the values of every accepted state (see `objects`)."""
        for item in objects:
            item.attach(self)
            self._objects.append(item)

    # Counting

    @property
    def datum_defect(self) -> int:
        """Number of parameters that the observations leave free and the datum takes; 0 without a datum."""
        if not self._datum.size:
            return 0
        equations, solver = self.equations(reduced=True), self._analysed(reduced=True)
        if isinstance(solver, DatumSolver) and not solver.is_factored:
            factor(equations, solver, self._constraints, equations.assemble(viscous=False))
        return int(solver.null_vectors().shape[1])

    @property
    def n_unknowns(self) -> int:
        """Number of free scalar unknowns, less the independent hard constraints."""
        free = int(np.count_nonzero(~self.unknowns.frozen))
        return free - self._substitution().rank if self._constraints else free

    @property
    def redundancy(self) -> int:
        """Equations and datum parameters minus free unknowns: the one definition of every statistic."""
        return self.n_observations + self.n_constraints + self.datum_defect - self.n_unknowns

    def _substitution(self) -> Substitution:
        """The hard constraints at the current values."""
        return substitution(self.unknowns, self.equations(True).free, self._constraints)

    # Solution

    def equations(self, reduced: bool = False) -> NormalEquations:
        """The normal equations; their pattern is kept while equations and frozen unknowns stay.

        Args:
            reduced: without the blocks that are to be eliminated.

        Raises:
            SingularSystemError: no equation touches some unknowns that are not frozen.
        """
        if self._version != self.unknowns.version:
            self._refuse_untouched()
            self._bound, self._solvers, self._version = {}, {}, self.unknowns.version
        reduced = reduced and bool(self.unknowns.eliminated.any())
        if reduced not in self._bound:
            eliminated = self.unknowns.eliminated if reduced else None
            self._bound[reduced] = NormalEquations(
                self.unknowns,
                self._batches,
                self._priors,
                eliminated,
                self._constraints,
                self._viscosities,
                self._threads,
            )
        return self._bound[reduced]

    def residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed at the current values."""
        return raw_residuals(self.unknowns, batch, self._threads)

    def solve(
        self,
        max_iterations: int = 20,
        tolerance: float = 1e-6,
        covariance: ArrayLike | Literal["all"] | bool | None = None,
        before_iteration: Callable[[LeastSquares, int], None] | None = None,
        progress: Callable[[Iteration], None] | None = None,
        sigma0_groups: Collection[str] | None = None,
        strategy: str | Strategy = "gauss-newton",
    ) -> LeastSquaresResult:
        """Solves by iterations; the unknowns move to the solution.

        Args:
            max_iterations: no more iterations than this.
            tolerance: the iterations end when no unknown moves by more than this share of its standard
                deviation (see `Options`); negative: all iterations are done.
            covariance: "all", True or ids when the result shall answer for covariances.
            before_iteration: called with the system and the number of iterations done, before each
                linearisation and before the final residuals; may replace the observations of batches.
            progress: called with the record of each iteration.
            sigma0_groups: groups in the numerator of sigma0; all when None.
            strategy: how the iterations move; see `strategies` ("gauss-newton", "levenberg-marquardt",
                "dogleg", "qr", "lsmr", "l1", or an object with parameters).

        Raises:
            SingularSystemError: some unknowns are undetermined; they are named.
            DivergenceError: an equation became undefined; the observation is named, and the unknowns are
                back at their last accepted values.
        """
        equations = self.equations(reduced=True)
        options = Options(max_iterations, tolerance, sigma0_groups)

        chosen, wanted = strategy_of(strategy), covariance is not None and covariance is not False
        if wanted and chosen == GaussNewton("l1"):
            raise InputError("covariances of an L1 solution are not those of least squares: ask for none")

        def before(number: int) -> None:
            synchronise(self, self._objects)
            if before_iteration is not None:
                before_iteration(self, number)

        redundancy, done = self.redundancy, Progress(reason=StopReason.NO_UNKNOWNS)
        if not self.unknowns.frozen.all():
            solver = self._analysed(reduced=True)
            run = runner(chosen, equations, solver, self._constraints)
            with blas_threads(self._threads):
                done = run(options, redundancy, before, progress or _silent)
        before(len(done.iterations))
        wanted = wanted and not self.unknowns.frozen.all()
        with blas_threads(self._threads):
            cofactors = self._cofactors() if wanted else None
        return self._result(equations, options, redundancy, done, cofactors)

    def _refuse_untouched(self) -> None:
        if not self._batches and not self._priors:
            raise InputError("the system has no equations: add observations or priors")
        touched = used_blocks(self.unknowns, [*self._batches, *self._constraints], self._priors)
        free = np.add.reduceat(~self.unknowns.frozen, self.unknowns.start, dtype=np.int64) > 0
        untouched = np.flatnonzero(free & ~touched)
        if untouched.size:
            raise untouched_error(self.unknowns, untouched)

    def _analysed(self, reduced: bool = False) -> Solver:
        equations = self.equations(reduced)
        reduced = equations is not self._bound.get(False)
        if reduced not in self._solvers:
            self._solvers[reduced] = self._new_solver(equations)
            self._solvers[reduced].analyse(equations.pattern)
        return self._solvers[reduced]

    def _new_solver(self, equations: NormalEquations) -> Solver:
        if self._constraints:
            if self._datum.size:
                raise InputError("a datum and hard constraints do not go together: freeze unknowns instead")
            return SubstitutedSolver(self._solver_name, self._threads)
        solver = choose_solver(equations.pattern, self._solver_name, threads=self._threads)
        return self._on_datum(equations, solver) if self._datum.size else solver

    def _on_datum(self, equations: NormalEquations, solver: Solver) -> DatumSolver:
        numbers = equations.free.number[self._datum]
        free = equations.free.scalars
        if (numbers[~self.unknowns.frozen[self._datum]] < 0).any():
            raise InputError("datum: some of its unknowns are to be eliminated; do not eliminate them")
        chosen = np.zeros(equations.pattern.n, dtype=bool)
        chosen[numbers[numbers >= 0]] = True
        reference = self._reference[free]
        return DatumSolver(solver, chosen, lambda: self.unknowns.values[free] - reference)

    def _cofactors(self) -> Cofactors:
        """Cofactors of all unknowns at the solution, without the damping that the iterations may have had."""
        equations, solver = self.equations(), self._analysed()
        factor(equations, solver, self._constraints, equations.assemble(viscous=False))
        del self._solvers[False]  # the result keeps this one, for covariances between any two unknowns
        return Cofactors(self.unknowns, equations.free, equations.pattern, solver)

    def _result(
        self,
        equations: NormalEquations,
        options: Options,
        redundancy: int,
        done: Progress,
        cofactors: Cofactors | None,
    ) -> LeastSquaresResult:
        equations.reweight()
        squares = equations.sums_of_squares()
        overall = sigma0_of(squares, None, redundancy)
        return LeastSquaresResult(
            tuple(done.iterations),
            done.reason is not StopReason.ITERATIONS,
            done.reason,
            self.n_observations,
            self.n_constraints,
            self.n_unknowns,
            redundancy,
            sigma0_of(squares, options.sigma0_groups, redundancy),
            None if overall is None else overall**2,
            squares,
            self.unknowns,
            self.unknowns.state(),
            self.unknowns.frozen.copy(),
            {batch: self.residuals(batch) for batch in equations.batches},
            cofactors,
            self._substitution().redundant if self._constraints else (),
        )


def _silent(_: Iteration) -> None:
    """The progress callback of those who want none."""
