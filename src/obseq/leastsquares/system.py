"""The least squares system: unknowns by name, equations in batches, one solution."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal

import numpy as np

from obseq.errors import InputError, ObseqError, nearest
from obseq.leastsquares.analysis import Analyses
from obseq.leastsquares.assembly.evaluation import raw_residuals
from obseq.leastsquares.assembly.threads import blas_threads, checked_threads
from obseq.leastsquares.iterations.arrival import Options
from obseq.leastsquares.iterations.constraints import substitution
from obseq.leastsquares.iterations.datum_solver import DatumSolver
from obseq.leastsquares.iterations.gauss_newton import Progress, sigma0_of
from obseq.leastsquares.iterations.newton import factor
from obseq.leastsquares.iterations.runs import runner
from obseq.leastsquares.iterations.strategies import GaussNewton, strategy_of
from obseq.leastsquares.problem.arguments import callback, frozen, number, texts, whole
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.definition import Definition
from obseq.leastsquares.problem.objects import UnknownObject, synchronise
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solution.result import Iteration, LeastSquaresResult, StopReason
from obseq.leastsquares.solvers import checked_solver

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray
    from obseq.leastsquares.analysis import Analysis
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.iterations.constraints import Substitution
    from obseq.leastsquares.iterations.strategies import Strategy
    from obseq.leastsquares.problem.unknowns import UnknownTable


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
        self._solver_name = checked_solver(solver)
        self._threads = checked_threads(threads)
        self._kept = Analyses()

    # Objects

    def attach(self, *objects: UnknownObject) -> None:
        """Adds the unknowns of objects; they get the values of every accepted state (see `objects`)."""
        for item in objects:
            if not isinstance(item, UnknownObject):
                raise InputError(f"attach: objects with unknowns are wanted (Point, Pose, ...), not {item!r}")
            item.attach(self)
            self._objects.append(item)

    # Counting

    @property
    def datum_defect(self) -> int:
        """Number of parameters that the observations leave free and the datum takes; 0 without a datum."""
        return self._datum_defect(self._analysis(reduced=True))

    @property
    def n_unknowns(self) -> int:
        """Number of free scalar unknowns, less the independent hard constraints."""
        return self._n_unknowns(self._analysis(reduced=True)) if self._constraints else self._n_free

    @property
    def redundancy(self) -> int:
        """Equations and datum parameters minus free unknowns: the one definition of every statistic."""
        return self._redundancy(self._analysis(reduced=True))

    @property
    def _n_free(self) -> int:
        return int(np.count_nonzero(~self.unknowns.frozen))

    def _n_unknowns(self, analysis: Analysis) -> int:
        return self._n_free - (self._substitution(analysis).rank if self._constraints else 0)

    def _redundancy(self, analysis: Analysis) -> int:
        counted = self.n_observations + self.n_constraints + self._datum_defect(analysis)
        return counted - self._n_unknowns(analysis)

    def _datum_defect(self, analysis: Analysis) -> int:
        if not self.datum.scalars.size:
            return 0
        equations, solver = analysis.equations, analysis.solver
        if isinstance(solver, DatumSolver) and not solver.is_factored:
            factor(equations, solver, self._constraints, equations.assemble(viscous=False))
        return int(solver.null_vectors().shape[1])

    def _substitution(self, analysis: Analysis) -> Substitution:
        """The hard constraints at the current values."""
        return substitution(self.unknowns, analysis.equations.free, self._constraints)

    # Solution

    def equations(self, reduced: bool = False) -> NormalEquations:
        """The normal equations; their pattern is kept while equations and frozen unknowns stay.

        Args:
            reduced: without the blocks that are to be eliminated.

        Raises:
            SingularSystemError: no equation touches some unknowns that are not frozen.
        """
        return self._analysis(reduced).equations

    def _analysis(self, reduced: bool = False) -> Analysis:
        self.unknowns.owner.check()
        self._settle()
        if reduced:
            return self._kept.reduced(self, self._solver_name, self._threads)
        return self._kept.whole(self, self._solver_name, self._threads)

    def _settle(self) -> None:
        for batch in self._batches:
            batch.settle()

    def residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed at the current values."""
        if not isinstance(batch, Batch):
            raise InputError(f"residuals: a batch is wanted, as `add` returns it, not {batch!r}")
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
            strategy: how the iterations move; see `strategies` ("gauss-newton", "controlled",
                "levenberg-marquardt", "dogleg", "qr", "lsmr", "l1", or an object with parameters).

        Raises:
            SingularSystemError: some unknowns are undetermined; they are named.
            DivergenceError: an equation became undefined, and the observation is named; or the iterations
                left where the equations determine the unknowns. These are back at the best values.
        """
        wanted = _is_wanted(covariance, self.unknowns)
        chosen = _checked_strategy(strategy, wanted)
        options = self._options(max_iterations, tolerance, sigma0_groups)
        callback(before_iteration, "solve, before_iteration")
        callback(progress, "solve, progress")

        with self.unknowns.owner.alone(), self._accepted_when_interrupted() as accept:

            def before(number: int) -> None:
                accept()
                synchronise(self, self._objects)
                if before_iteration is not None:
                    before_iteration(self, number)
                accept()

            self._settle()
            with self._taken_out() as analyses:
                analysis = analyses.reduced(self, self._solver_name, self._threads)
                redundancy = self._redundancy(analysis)
                done = self._iterated(analysis, chosen, options, redundancy, before, progress or _silent)
                before(len(done.iterations))
                cofactors = self._cofactors(analyses) if wanted and self._n_free else None
                return self._result(analysis, options, redundancy + done.defect, done, cofactors)

    @contextmanager
    def _taken_out(self) -> Iterator[Analyses]:
        """What is kept for the next solution, put back at the end: nothing half done is used again."""
        kept, self._kept = self._kept, Analyses()
        try:
            yield kept
        except ObseqError:
            self._kept = kept
            raise
        self._kept = kept

    @contextmanager
    def _accepted_when_interrupted(self) -> Iterator[Callable[[], None]]:
        """Gives a function that accepts the present values; an interruption comes back to those."""
        accepted = self.unknowns.state()

        def accept() -> None:
            nonlocal accepted
            accepted = self.unknowns.state()

        try:
            yield accept
        except ObseqError:
            raise
        except BaseException:
            self.unknowns.restore(accepted)
            raise

    def _options(
        self, max_iterations: int, tolerance: float, sigma0_groups: Collection[str] | None
    ) -> Options:
        """The options of a solution, checked."""
        if whole(max_iterations, "solve, max_iterations") < 0:
            raise InputError(f"solve: {max_iterations} iterations; give 0 or more")
        if isinstance(sigma0_groups, str):
            sigma0_groups = (sigma0_groups,)
        if sigma0_groups is not None:
            sigma0_groups = texts(sigma0_groups, "solve, sigma0_groups")
            known = {batch.group for batch in self._batches} | {prior.group for prior in self._priors}
            unknown = [group for group in sigma0_groups if group not in known]
            if unknown:
                raise InputError(f"sigma0_groups: no group is called {nearest(unknown[0], known)}")
        return Options(max_iterations, number(tolerance, "solve, tolerance"), sigma0_groups)

    def _iterated(
        self,
        analysis: Analysis,
        strategy: Strategy,
        options: Options,
        redundancy: int,
        before: Callable[[int], None],
        progress: Callable[[Iteration], None],
    ) -> Progress:
        if not self._n_free:
            return Progress(reason=StopReason.NO_UNKNOWNS)
        run = runner(strategy, analysis.equations, analysis.solver, self._constraints)
        with blas_threads(self._threads):
            return run(options, redundancy, before, progress)

    def _cofactors(self, analyses: Analyses) -> Cofactors:
        """Cofactors of all unknowns at the solution, without the damping that the iterations may have had."""
        analysis = analyses.whole(self, self._solver_name, self._threads)
        equations, solver = analysis.equations, analysis.released_solver()
        with blas_threads(self._threads):
            factor(equations, solver, self._constraints, equations.assemble(viscous=False))
            return Cofactors(self.unknowns, equations.free, equations.pattern, solver)

    def _result(
        self,
        analysis: Analysis,
        options: Options,
        redundancy: int,
        done: Progress,
        cofactors: Cofactors | None,
    ) -> LeastSquaresResult:
        equations = analysis.equations
        equations.reweight()
        squares = equations.sums_of_squares()
        overall = sigma0_of(squares, None, redundancy)
        return LeastSquaresResult(
            tuple(done.iterations),
            done.reason.is_arrival,
            done.reason,
            self.n_observations,
            self.n_constraints,
            self._n_unknowns(analysis),
            redundancy,
            sigma0_of(squares, options.sigma0_groups, redundancy),
            None if overall is None else overall**2,
            squares,
            self.unknowns,
            self.unknowns.state(),
            frozen(self.unknowns.frozen.copy()),
            {batch: frozen(self.residuals(batch)) for batch in equations.batches},
            cofactors,
            self._substitution(analysis).redundant if self._constraints else (),
            done.evaluations,
        )


def _is_wanted(covariance: ArrayLike | bool | None, table: UnknownTable) -> bool:
    """Whether covariances are asked for: "all", True or ids."""
    if covariance is None or isinstance(covariance, bool):
        return bool(covariance)
    if isinstance(covariance, str):
        if covariance != "all":
            raise InputError(f'solve: covariance is "all", True or ids of blocks, not {covariance!r}')
        return True
    table.checked(covariance, "solve, covariance")
    return True


def _checked_strategy(given: str | Strategy, with_covariance: bool) -> Strategy:
    strategy = strategy_of(given)
    if with_covariance and strategy == GaussNewton("l1"):
        raise InputError("covariances of an L1 solution are not those of least squares: ask for none")
    return strategy


def _silent(_: Iteration) -> None:
    """The progress callback of those who want none."""
