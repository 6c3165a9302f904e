"""The least squares system: unknowns by name, equations in batches, one solution."""

from __future__ import annotations

from contextlib import contextmanager
from functools import wraps
from operator import attrgetter
from typing import TYPE_CHECKING, Concatenate, Literal, ParamSpec, TypeVar

from obseq.errors import DivergenceError, InputError, ObseqError, SingularSystemError, nearest
from obseq.leastsquares.analysis import Analyses
from obseq.leastsquares.assembly.evaluation import raw_residuals
from obseq.leastsquares.iterations.arrival import Options
from obseq.leastsquares.iterations.gauss_newton import sigma0_of
from obseq.leastsquares.iterations.strategies import GaussNewton, strategy_of
from obseq.leastsquares.iterations.unchanged import Unchanged
from obseq.leastsquares.problem.arguments import callback, frozen, number, texts, whole
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.problem import Problem
from obseq.leastsquares.problem.unknown_blocks import UnknownBlocks
from obseq.leastsquares.problem.unknown_objects import synchronise
from obseq.leastsquares.solution.result import Iteration, LeastSquaresResult

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray
    from obseq.leastsquares.analysis import Analysis
    from obseq.leastsquares.assembly.normal_equations import NormalEquations
    from obseq.leastsquares.blocks.blocks import Blocks
    from obseq.leastsquares.iterations.gauss_newton import Progress
    from obseq.leastsquares.iterations.strategies import Strategy
    from obseq.leastsquares.problem.datum import Datum
    from obseq.leastsquares.problem.priors import Prior, Viscosity
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.solution.cofactors import Cofactors

Part = TypeVar("Part")
Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def _of(
    part: Callable[[LeastSquares], Part], method: Callable[Concatenate[Part, Arguments], Answer]
) -> Callable[Concatenate[LeastSquares, Arguments], Answer]:
    """The method of a part of a system, as a method of the system."""

    @wraps(method)
    def call(self: LeastSquares, /, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
        return method(part(self), *args, **kwargs)

    return call


_blocks: Callable[[LeastSquares], UnknownBlocks] = attrgetter("problem.blocks")
_problem: Callable[[LeastSquares], Problem] = attrgetter("problem")


class LeastSquares:
    """Unknowns and equations of an adjustment.

    Unknowns are added in blocks that have names, and are addressed by the ids that adding them returns (int64
    arrays). Equations are added in batches of one formula. `solve` changes the unknowns in place and
    returns a result that keeps its own copy.

    Args:
        solver: name of the solver (see `solvers.choose_solver`), or `Blocks` for systems of any size.
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

    def __init__(self, solver: str | Blocks = "auto", threads: int = 1) -> None:
        self.problem = Problem()
        self._analyses = Analyses(self.problem, solver, threads)

    # What it consists of

    add_points = _of(_blocks, UnknownBlocks.add_points)
    add_rotations = _of(_blocks, UnknownBlocks.add_rotations)
    add_directions = _of(_blocks, UnknownBlocks.add_directions)
    add_vectors = _of(_blocks, UnknownBlocks.add_vectors)
    add_scalars = _of(_blocks, UnknownBlocks.add_scalars)
    add_blocks = _of(_blocks, UnknownBlocks.add_blocks)
    attach = _of(_blocks, UnknownBlocks.attach)
    ids = _of(_blocks, UnknownBlocks.ids)
    values = _of(_blocks, UnknownBlocks.values)
    set_values = _of(_blocks, UnknownBlocks.set_values)
    freeze = _of(_blocks, UnknownBlocks.freeze)
    freeze_matching = _of(_blocks, UnknownBlocks.freeze_matching)
    unfreeze = _of(_blocks, UnknownBlocks.unfreeze)
    eliminate = _of(_blocks, UnknownBlocks.eliminate)

    add = _of(_problem, Problem.add)
    add_linear = _of(_problem, Problem.add_linear)
    add_normal_equations = _of(_problem, Problem.add_normal_equations)
    add_prior = _of(_problem, Problem.add_prior)
    add_viscosity = _of(_problem, Problem.add_viscosity)
    constrain = _of(_problem, Problem.constrain)
    constrain_linear = _of(_problem, Problem.constrain_linear)
    share = _of(_problem, Problem.share)
    share_matching = _of(_problem, Problem.share_matching)
    remove_constraint = _of(_problem, Problem.remove_constraint)
    set_datum = _of(_problem, Problem.set_datum)

    @property
    def unknowns(self) -> UnknownTable:
        """The table of unknowns."""
        return self.problem.unknowns

    @property
    def batches(self) -> tuple[Batch, ...]:
        """The observations, in the order in which they were added."""
        return self.problem.batches

    @property
    def priors(self) -> tuple[Prior, ...]:
        """The soft constraints."""
        return self.problem.priors

    @property
    def constraints(self) -> tuple[Batch, ...]:
        """The hard constraints."""
        return self.problem.constraints

    @property
    def viscosities(self) -> tuple[Viscosity, ...]:
        """What slows unknowns."""
        return self.problem.viscosities

    @property
    def datum(self) -> Datum:
        """What a free network is fixed by."""
        return self.problem.datum

    # Counting

    @property
    def n_observations(self) -> int:
        """Number of scalar equations of active observations."""
        return self.problem.n_observations

    @property
    def n_constraints(self) -> int:
        """Number of scalar equations of priors, and of rows that count as constraints."""
        return self.problem.n_constraints

    @property
    def datum_defect(self) -> int:
        """Number of parameters that the observations leave free and the datum takes; 0 without a datum."""
        return self.analysis(reduced=True).datum_defect

    @property
    def n_unknowns(self) -> int:
        """Number of free scalar unknowns, less the independent hard constraints."""
        return self.analysis(reduced=True).n_unknowns if self.constraints else self.problem.n_free

    @property
    def redundancy(self) -> int:
        """Equations and datum parameters minus free unknowns: the one definition of every statistic."""
        return self.analysis(reduced=True).redundancy

    # Solution

    def equations(self, reduced: bool = False) -> NormalEquations:
        """The normal equations; their pattern is kept while equations and frozen unknowns stay.

        Args:
            reduced: without the blocks that are to be eliminated.

        Raises:
            SingularSystemError: no equation touches some unknowns that are not frozen.
        """
        return self.analysis(reduced).equations

    def analysis(self, reduced: bool = False) -> Analysis:
        """The normal equations with their analysed solver; arguments and errors as of `equations`."""
        self.unknowns.owner.check()
        self.problem.settle()
        return self._analyses.reduced() if reduced else self._analyses.whole()

    def residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed at the current values."""
        if not isinstance(batch, Batch):
            raise InputError(f"residuals: a batch is wanted, as `add` returns it, not {batch!r}")
        return raw_residuals(self.unknowns, batch, self._analyses.threads)

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
                linearisation and before the final residuals. It may change what is measured and weighed:
                observations, sigmas, losses, values of priors and of unknowns. The rest stays: what is
                active, frozen or eliminated, and which equations there are.
            progress: called with the record of each iteration; may change as little.
            sigma0_groups: groups in the numerator of sigma0; all when None.
            strategy: how the iterations move; see `strategies` ("gauss-newton", "controlled",
                "levenberg-marquardt", "dogleg", "qr", "lsmr", "l1", or an object with parameters).

        Raises:
            SingularSystemError: some unknowns are undetermined where the iterations start; they are named.
                Those that are so only where the iterations end are named by the result (`weak`).
            DivergenceError: an equation became undefined, and the observation is named; or the iterations
                left where the equations determine the unknowns. These are back at the best values.
            InputError: a callback has changed what a solution takes for granted; it is named.
        """
        wanted = _is_wanted(covariance, self.unknowns)
        chosen = _checked_strategy(strategy, wanted)
        options = self._options(max_iterations, tolerance, sigma0_groups)
        callback(before_iteration, "solve, before_iteration")
        callback(progress, "solve, progress")

        with self.unknowns.owner.alone(), self._accepted_when_interrupted() as accept:
            self.problem.settle()
            unchanged = Unchanged(self.problem) if before_iteration or progress else None

            def before(number: int) -> None:
                accept()
                synchronise(self.problem.blocks, self.problem.blocks.objects)
                if before_iteration is not None:
                    before_iteration(self, number)
                    accept()
                if unchanged:
                    unchanged.check()

            with self._taken_out() as analyses:
                analysis = analyses.reduced()
                redundancy = analysis.redundancy
                done = analysis.iterate(chosen, options, redundancy, before, progress or _silent)
                cofactors, weak = _found(analyses, done) if wanted and not done.weak else (None, done.weak)
                return self._result(analysis, options, redundancy + done.defect, done, cofactors, weak)

    @contextmanager
    def _taken_out(self) -> Iterator[Analyses]:
        """What is kept for the next solution, put back at the end: nothing half done is used again."""
        kept, self._analyses = self._analyses, self._analyses.fresh()
        try:
            yield kept
        except ObseqError:
            self._analyses = kept
            raise
        self._analyses = kept

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
            known = self.problem.groups
            unknown = [group for group in sigma0_groups if group not in known]
            if unknown:
                raise InputError(f"sigma0_groups: no group is called {nearest(unknown[0], known)}")
        return Options(max_iterations, number(tolerance, "solve, tolerance"), sigma0_groups)

    def _result(
        self,
        analysis: Analysis,
        options: Options,
        redundancy: int,
        done: Progress,
        cofactors: Cofactors | None,
        weak: ObseqError | None,
    ) -> LeastSquaresResult:
        equations = analysis.equations
        misfits = {batch: frozen(equations.raw_residuals(batch)) for batch in equations.batches}
        equations.reweight(misfits)
        squares = equations.sums_of_squares(misfits)
        rejected = sum(batch.n_rejected for batch in equations.batches if not batch.is_constraint)
        redundancy -= rejected
        overall, held = sigma0_of(squares, None, redundancy), analysis.substitution
        return LeastSquaresResult(
            tuple(done.iterations),
            done.reason.is_arrival,
            done.reason,
            self.n_observations - rejected,
            self.n_constraints,
            analysis.n_unknowns,
            redundancy,
            sigma0_of(squares, options.sigma0_groups, redundancy),
            None if overall is None else overall**2,
            squares,
            self.unknowns,
            self.unknowns.state(),
            frozen(self.unknowns.frozen.copy()),
            misfits,
            {batch: batch.weighing() for batch in equations.batches},
            {prior: prior.values for prior in equations.priors},
            cofactors,
            held.redundant if held else (),
            done.evaluations,
            weak,
        )


def _found(analyses: Analyses, done: Progress) -> tuple[Cofactors | None, ObseqError | None]:
    """The cofactors at a solution, or why there are none: what iterations have found is not lost for it."""
    try:
        return analyses.whole().cofactors(), None
    except (SingularSystemError, DivergenceError) as error:
        if not done.iterations:
            raise
        return None, error


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
