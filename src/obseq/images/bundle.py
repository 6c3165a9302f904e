"""Bundle adjustment: a block, and its solution by least squares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from obseq.errors import InputError, ObseqError, SingularSystemError
from obseq.images.adjustment.approach import (
    Solving,
    approach,
    drop_undetermined,
    solve_to_the_end,
    taken_in_again,
)
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.free import solve_free
from obseq.images.adjustment.quality import BlunderSearch, search_blunders
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.start import Start, start_of
from obseq.images.adjustment.surveys import follower, join_surveys, places_in, with_surveys
from obseq.images.adjustment.verdicts import (
    cameras_refused,
    check_datum,
    check_scale,
    check_weights,
    hiding_sigma,
    in_words,
)
from obseq.images.edited import EditedBlock
from obseq.images.placing import placed, waiting_images
from obseq.leastsquares import Blocks, Iteration, LeastSquares

MAX_ITERATIONS, ROBUST_ITERATIONS, MOST = 50, 200, 400
TOLERANCE, ROBUST_TOLERANCE = 1e-6, 1e-3
WITH_ELIMINATION = ("levenberg-marquardt", "controlled", "gauss-newton")
"""Strategies whose steps need not all unknowns in the matrix."""


class BundleAdjustment(EditedBlock):
    """A block of images and its adjustment.

    Example:
        >>> from obseq.images import BundleAdjustment, Camera
        >>> block = BundleAdjustment()
        >>> block.add_cameras(Camera("wide", 4000, 3000, focal=3000.0))
        >>> block.add_poses(["a", "b"], [[0, 0, 9], [3, 0, 9]], [[0, 0, 0], [0, 0, 0]], form="opk")
        >>> block.poses["b"].to_local([3.0, 0.0, 0.0]).tolist()
        [0.0, 0.0, 9.0]
    """

    def solve(
        self,
        max_iterations: int | None = None,
        tolerance: float | None = None,
        datum: str | Sequence[str] = "control",
        covariance: bool = True,
        eliminate: bool = True,
        strategy: str = "levenberg-marquardt",
        threads: int = 1,
        progress: Callable[[Iteration], None] | None = None,
        blunders: BlunderSearch | None = None,
        blocks: Blocks | None = None,
    ) -> BundleSolution:
        """Adjusts the block; the block itself does not change.

        Args:
            max_iterations: the iterations end at this number when they have not converged before: 50, or 200
                with robust weights; 400 where these have come within half a standard deviation of the end.
            tolerance: they end when no unknown moves any more by this share of its standard deviation: 1e-6,
                or 1e-3 with robust weights, which come near their end slowly.
            datum: what fixes position, orientation and scale: "control" (control points, observed or held
                poses), "centres" or "points" (a free block: the changes of all of them from the start are
                least, control points and observed positions take no part), names of points (of these), or
                "none" (nothing; no covariances).
            covariance: False when no precision will be asked for.
            eliminate: True to take points out of the normal equations first, where the strategy lets them;
                the solution is the same.
            strategy: see `obseq.LeastSquares.solve`.
            threads: how many share the work.
            progress: receives the record of each iteration.
            blunders: how to look for wrong observations and leave them out; None for not at all.
            blocks: how it is solved in blocks, with little memory or by many workers; None for at once.

        Raises:
            InputError: something in the block makes the adjustment impossible; it is named.
            SingularSystemError: measures do not determine some unknowns, which are named; or thresholds
                reject all of them.
        """
        block = self if datum in ("control", "none") else self.freed()
        solve = partial(
            block._solved,
            max_iterations=max_iterations,
            tolerance=tolerance,
            datum=datum,
            covariance=covariance,
            eliminate=eliminate,
            strategy=strategy,
            threads=threads,
            progress=progress,
            blunders=blunders,
            blocks=blocks,
        )
        solution = solve(start_of(block))
        places = taken_in_again(solution)
        if not places:
            return solution
        try:
            again = solve(start_of(block, places))
        except ObseqError:
            return solution
        return again if again.converged >= solution.converged else solution

    def _solved(
        self,
        start: Start,
        *,
        max_iterations: int | None,
        tolerance: float | None,
        datum: str | Sequence[str],
        covariance: bool,
        eliminate: bool,
        strategy: str,
        threads: int,
        progress: Callable[[Iteration], None] | None,
        blunders: BlunderSearch | None,
        blocks: Blocks | None,
    ) -> BundleSolution:
        """The solution from where a block starts; see `solve`."""
        start, initial = with_surveys(self.surveys, start)
        check_datum(self, start, datum)
        check_scale(self, datum)
        keeps_points = datum == "points" or not isinstance(datum, str)
        system = LeastSquares(blocks or "auto", threads)
        eliminate = eliminate and not keeps_points and strategy in WITH_ELIMINATION
        equations = Equations(self, start, system, eliminate)
        turned = dict(zip(start.poses.images, map(int, equations.rotations), strict=True))
        surveys = join_surveys(self.surveys, initial, system, places_in(start, equations), turned)
        limit = max_iterations or (ROBUST_ITERATIONS if self._is_robust else MAX_ITERATIONS)
        further = 0 if max_iterations else MOST - limit
        solving: Solving = {
            "max_iterations": limit,
            "tolerance": tolerance or (ROBUST_TOLERANCE if self._is_robust else TOLERANCE),
            "progress": progress,
        }
        solving["before_iteration"] = follower(surveys)
        wanted = True if covariance and datum != "none" else None
        try:
            if datum in ("control", "none"):
                done = approach(equations, strategy, solving)
                dropped = drop_undetermined(equations)
                result, more, lost = solve_to_the_end(equations, strategy, solving, further, wanted)
                done, dropped = done + more, dropped + lost
            else:
                result, done, dropped = solve_free(equations, datum, strategy, wanted, solving, further)
                strategy = "gauss-newton"
            found = None
            if blunders is not None:
                result, found = search_blunders(
                    equations, surveys, blunders, {**solving, "strategy": strategy}
                )
                done += result.iterations
            check_weights(equations)
        except SingularSystemError as error:
            raise in_words(equations, error) from None
        return check_cameras(
            BundleSolution(self, start, equations, result, done, tuple(surveys), found, dropped)
        )

    @property
    def _is_robust(self) -> bool:
        """Whether some measures are weakened by their residuals."""
        return any(part.loss is not None for part in self.sets)

    def initialise(self, causes: bool = True) -> tuple[str, ...]:
        """Finds poses for the images that have measures and none; returns their names.

        By resection where there are four control points or more, else from their neighbours; without any
        image to begin with, from a relative orientation that three control points bring to the world. A
        block without control points stays in the frame of its first pair.

        Args:
            causes: whether to try what may be wrong where images cannot be placed; it takes some adjustments.

        Raises:
            InputError: an image cannot be placed; it is named, with the reason.
        """
        waiting = waiting_images(self)
        if not waiting:
            return ()
        try:
            self.add_poses(placed(self, causes).select(waiting))
        except SingularSystemError as error:
            if hidden := hiding_sigma(self):
                raise InputError(hidden) from error
            raise
        return tuple(waiting)


def check_cameras(solution: BundleSolution) -> BundleSolution:
    """A solution, if its cameras are possible.

    Raises:
        ContradictionError: one is not: a mirror image has a negative focal length.
    """
    with cameras_refused():
        solution.cameras  # noqa: B018  (each is checked when it is made)
    return solution
