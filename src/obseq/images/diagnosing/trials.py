"""Which mistake that a whole block shares makes it fit: each is tried, and compared by what it leaves."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from obseq.dataclass import dataclass
from obseq.diagnosis.explanation import accepted
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.start import LEAST_RAYS
from obseq.images.causes.comparison import is_mirrored, moved, principal_shift
from obseq.images.causes.registry import SHARED
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among
from obseq.leastsquares.statistics.distributions import chi_square_limit

ITERATIONS, TOLERANCE = 50, 1e-4
"""Of a trial: how many, and the share of its standard deviation by which an unknown may still move."""
TIMES, PIXELS, MOVED = 3.0, 5.0, 0.2
"""Explanations are alike that move principal points and poses by no more than so many times the least, and
these pixels, this share of the extent and radians: mirrored axes differ in nothing else."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A changed block that fits.

    Attributes:
        cause: of the change.
        told: what its solution tells.
        solution: of it.
        left: weighted sum of squares that it leaves, with what is due for image points that take no part.
    """

    cause: SharedCause
    told: Told
    solution: BundleSolution
    left: float

    @property
    def is_accepted(self) -> bool:
        """Whether the overall test accepts that."""
        return is_accepted(self.solution) and self.left <= accepted(self.solution.result.redundancy, POLICY)


def due_for_missing(solution: BundleSolution) -> float:
    """What an explanation pays for image points that it leaves out, as for errors in each of them."""
    block = solution.block
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in block.sets))
    rays = np.bincount(measures.point, minlength=len(measures.point_names))
    known = are_among(measures.point_names, {*block.control.names, *block.joined_points})
    wanted = int(rays[known | (rays >= LEAST_RAYS)].sum())
    missing = max(wanted - len(solution.residuals.point), 0)
    return missing * chi_square_limit(2, above=POLICY.false_alarm / max(wanted, 1))


def squares(solution: BundleSolution) -> float:
    """The weighted sum of squares of the residuals."""
    return (solution.sigma0 or 0.0) ** 2 * solution.result.redundancy


def is_accepted(solution: BundleSolution) -> bool:
    """Whether the overall test accepts what a solution leaves, and it is no mirror image."""
    is_small = squares(solution) <= accepted(solution.result.redundancy, POLICY)
    return solution.converged and is_small and not is_mirrored(solution)


def is_good(solution: BundleSolution) -> bool:
    """Whether a solution leaves too little for a shared mistake, and is no mirror image."""
    is_little = not may_be_shared(squares(solution), solution.result.redundancy)
    return solution.converged and is_little and not is_mirrored(solution)


def may_be_shared(left: float, redundancy: int) -> bool:
    """Whether so much is left that a mistake could take its share of it and leave the noise."""
    return left > max(redundancy, 1) / POLICY.share


class Tries:
    """Adjustments of changed blocks."""

    def __init__(self, subject: Subject, told: Callable[[str], None], options: dict[str, object]) -> None:
        self._subject, self._told, self._options = subject, told, options

    def best(self, causes: Sequence[SharedCause] = SHARED) -> list[Fit]:
        """What explains the block, the best first, with all that nothing tells from it; else nothing."""
        found: list[Fit] = []
        for cause in self._wanted(causes):
            own = [fit for trial in cause.trials(self._subject) for fit in self._fit(cause, trial)]
            found += own
            if any(fit.is_accepted and (cause.is_sure or fit.told.images) for fit in own):
                break  # where all others are right as they are, nothing is wrong that they share
        if not found:
            return []
        least = min(fit.left for fit in found)
        spread = max(least / max(found[0].solution.result.redundancy, 1), 1.0)
        near = [fit for fit in found if fit.left <= least + POLICY.margin * spread]
        shift = min(principal_shift(fit.solution) for fit in near)
        near = [fit for fit in near if principal_shift(fit.solution) <= TIMES * shift + PIXELS]
        given = self._subject.given
        off = min(moved(fit.solution.poses, given) for fit in near)
        near = [fit for fit in near if moved(fit.solution.poses, given) <= TIMES * off + MOVED]
        ordered = sorted(near, key=lambda fit: fit.cause.rarity - fit.told.likelier)
        return list({fit.told.said: fit for fit in reversed(ordered)}.values())[::-1]

    def _wanted(self, causes: Sequence[SharedCause]) -> Iterator[SharedCause]:
        before = self._subject.solution
        for cause in causes:
            if before is None or not is_good(before) or cause.is_of_good(self._subject):
                yield cause

    def _fit(self, cause: SharedCause, trial: Trial) -> Iterator[Fit]:
        """The solution of a changed block, where it fits and tells something."""
        self._told(f"the block does not fit: trying {trial.what}")
        solution = self.solved(trial.block)
        if solution is not None and trial.then is not None:
            for further in trial.then(solution):
                yield from self._fit(cause, further)
            return
        if solution is None or not self._fits(solution):
            return
        told = trial.told(solution)
        if told.said:
            yield Fit(cause, told, solution, squares(solution) + due_for_missing(solution))

    def solved(self, block: AdjustableBlock) -> BundleSolution | None:
        """The solution of a block, if it converges."""
        options = {**self._options, "max_iterations": ITERATIONS, "tolerance": TOLERANCE, "covariance": False}
        options.pop("progress", None)
        try:
            block.initialise(causes=False)
            found = block.solve(**options)
        except ObseqError:
            return None
        return found if found.converged and found.sigma0 is not None else None

    def _fits(self, found: BundleSolution) -> bool:
        """Whether a solution is accepted, or has lost most of what was left before."""
        if is_mirrored(found):
            return False
        left = squares(found) + due_for_missing(found)
        before = self._subject.solution
        if before is not None and is_good(before):
            return is_accepted(found) or (not is_accepted(before) and squares(found) <= squares(before))
        if is_accepted(found) and left <= accepted(found.result.redundancy, POLICY):
            return True
        if before is None or before.sigma0 is None or is_mirrored(before):
            return not may_be_shared(left, found.result.redundancy)
        return left <= POLICY.share * (squares(before) + due_for_missing(before))
