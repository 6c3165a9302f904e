"""Blocks that are changed in one thing and adjusted again, to see whether that is what was wrong."""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.leastsquares.statistics.hypothesis_tests import global_test

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.approach import Solving
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.camera import Camera
    from obseq.images.measures import ImagePoints
    from obseq.images.poses import Poses
    from obseq.leastsquares import Iteration

BAD = 5.0
"""sigma0 above which a converged block is tried again, and a changed one does not fit."""
HOPELESS = 50.0
"""sigma0 above which nothing is explained, however much larger it was."""
SHARE = 0.1
"""Of sigma0, below which a cause that all measures share explains a block."""
FEW, TIMES, MOST = 25, 2, 50
"""Iterations of a trial: the first, or so many times those of the adjustment if more; at most the last."""
LOUD, QUIET = 6.0, 3.0
"""Standard deviations: what contradicts the others leaves more than the first, what agrees less than that."""
EXPLAINED = 0.9
"""Share of what leaving observations out explains, from which a change of them is the explanation."""
CREEPING, FALLS = 8, 0.01
"""Iterations in which sigma0 falls by less than this share: far above what it must come to, it never does."""
CLOSE = 1e-4
"""Share of its standard deviation by which an unknown may still move when a trial ends: sigma0 is known."""


class HopelessError(ObseqError):
    """A trial that has come to where it stays, far from fitting."""


@dataclass(frozen=True, eq=False)
class Attempts:
    """Adjustments of changed blocks: one that fits tells what is wrong with a block that has no solution.

    Attributes:
        block: as it was given; it does not change.
        given: its poses before others were found.
        told: is told of each step.
        options: of `solve`.
    """

    block: AdjustableBlock
    given: Poses
    told: Callable[[str], None]
    options: Solving

    @cached_property
    def known(self) -> dict[Hashable, BundleSolution | None]:
        """Solutions that may be asked for again, by what was changed."""
        return {}

    def once(self, change: Hashable, solve: Callable[[], BundleSolution | None]) -> BundleSolution | None:
        """A solution that is found the first time it is asked for."""
        if change not in self.known:
            self.known[change] = solve()
        return self.known[change]

    @property
    def cameras(self) -> dict[str, Camera]:
        """The given camera of each image."""
        return {image: self.block.cameras[name] for image, name in self.block.camera_of.items()}

    def copy(self) -> AdjustableBlock:
        """The block as it was given, to be changed."""
        made = copy.copy(self.block)
        made.poses, made.rules, made.camera_of = self.given, list(made.rules), dict(made.camera_of)
        return made

    def measured(self, change: Callable[[ImagePoints], ImagePoints | None]) -> AdjustableBlock | None:
        """The block with other measures; None where there are none for a set of them."""
        made, sets = self.copy(), []
        for part in made.sets:
            measures = change(part.measures)
            if measures is None:
                return None
            sets.append(replace(part, measures=measures))
        made.sets = sets
        return made

    def solved(
        self,
        block: AdjustableBlock | None,
        change: str,
        covariance: bool = False,
        limit: float = np.inf,
    ) -> BundleSolution | None:
        """The solution of a changed block, if it converges; none is needed with a sigma0 above the limit."""
        found = self.last(block, change, covariance, limit)
        return found if found is not None and found.converged and found.sigma0 is not None else None

    def last(
        self,
        block: AdjustableBlock | None,
        change: str,
        covariance: bool = False,
        limit: float = np.inf,
    ) -> BundleSolution | None:
        """The solution of a changed block, converged or not, if there is any."""
        if block is None:
            return None
        try:
            self.told(f"the block does not fit: trying {change}")
            block.initialise(causes=False)
            weights_change = self._is_robust or self.options.get("blunders")  # what is large may fall at last
            watch = _Watch(np.inf if weights_change else limit)
            return block.solve(**{**self._as_before(change, watch), "covariance": covariance})
        except ObseqError:
            return None

    def fitting(self, block: AdjustableBlock | None, change: str) -> BundleSolution | None:
        """The solution of a changed block that fits, and as no mirror image."""
        found = self.solved(block, change, limit=max(self._largest, BAD))
        return None if found is None or is_mirrored(found) or not self.fits(found) else found

    def fits(self, found: BundleSolution) -> bool:
        """Whether a solution is a good one."""
        return _sigma0(found) < self._largest

    @property
    def _largest(self) -> float:
        """The sigma0 above which a solution is no good one."""
        return BAD

    @property
    def _is_robust(self) -> bool:
        """Whether some measures are weakened by their residuals."""
        return any(part.weighting is not None and part.weighting.loss for part in self.block.sets)

    def explains(self, changed: BundleSolution, without: BundleSolution) -> bool:
        """Whether a change of observations makes them agree with the rest, as it is without them."""
        more = _redundancy(changed) - _redundancy(without)
        return bool(squares(changed) - squares(without) <= QUIET**2 * variance(without) * more)

    def falls(self, after: BundleSolution) -> str:
        """What becomes of sigma0."""
        return f"the block fits with sigma0 {_sigma0(after):.3g}"

    def becomes(self, after: BundleSolution) -> str:
        """What becomes of the block."""
        return f"so changed, {self.falls(after)}"

    @property
    def _most(self) -> int:
        """Iterations of a trial."""
        return FEW

    def _as_before(self, change: str, watch: _Watch) -> Solving:
        """The options, with a limit to the iterations that a hopeless trial does not pass."""
        given, tolerance = self.options.get("max_iterations"), self.options.get("tolerance")

        def progress(step: Iteration) -> None:
            self.told(_step(change, step))
            watch.note(step)

        return {
            **self.options,
            "max_iterations": min(given or self._most, self._most),
            "tolerance": tolerance if self._is_robust else max(tolerance or 0.0, CLOSE),
            "progress": progress,
        }


@dataclass(frozen=True, eq=False)
class Trials(Attempts):
    """Adjustments of changed blocks, to compare with one.

    Attributes:
        before: the solution of the block.
    """

    before: BundleSolution

    def fits(self, found: BundleSolution) -> bool:
        """Whether a solution is ten times better, good by its test, or better than a mirror image."""
        return _sigma0(found) < self._largest or not is_rejected(found)

    @property
    def _largest(self) -> float:
        most = _sigma0(self.before) * (1.0 if is_mirrored(self.before) else SHARE)
        return min(most, HOPELESS)

    def contradicts(self, without: BundleSolution) -> bool:
        """Whether what is left out in a solution contradicts all the rest."""
        more = _redundancy(self.before) - _redundancy(without)
        if self.before.left_out != without.left_out:
            more = max(more, 1)  # what a block that went astray has left out is no redundancy of either
        gain = squares(self.before) - squares(without)
        return bool(more > 0 and gain > LOUD**2 * variance(without) * more)

    def explains(self, changed: BundleSolution, without: BundleSolution) -> bool:
        """Whether a change makes observations agree with the rest, and little is left of what they spoil."""
        left, gain = squares(changed) - squares(without), squares(self.before) - squares(without)
        return super().explains(changed, without) and bool(left <= (1.0 - EXPLAINED) * gain)

    def gains(self, found: BundleSolution) -> float:
        """By how much a change lowers the weighted sum of squares, in the variances of most residuals."""
        return (squares(self.before) - squares(found)) / variance(found)

    def falls(self, after: BundleSolution) -> str:
        """What becomes of sigma0."""
        return f"sigma0 falls from {_sigma0(self.before):.3g} to {_sigma0(after):.3g}"

    def becomes(self, after: BundleSolution) -> str:
        """What becomes of the block."""
        if is_mirrored(self.before):
            return f"the block fits as a mirror image; so changed, as it is, with sigma0 {_sigma0(after):.3g}"
        return super().becomes(after)

    @property
    def _most(self) -> int:
        return min(max(FEW, TIMES * len(self.before.iterations)), MOST)


class _Watch:
    """Gives a trial up that creeps along above the largest sigma0 with which it would serve."""

    def __init__(self, limit: float) -> None:
        self._limit = limit
        self._seen: deque[float] = deque(maxlen=CREEPING + 1)

    def note(self, step: Iteration) -> None:
        """Looks at one more iteration.

        Raises:
            HopelessError: the last ones have brought next to nothing.
        """
        self._seen.append(0.0 if step.sigma0 is None else step.sigma0)
        least, most = min(self._seen), max(self._seen)
        if len(self._seen) > CREEPING and least > self._limit and most - least < FALLS * most:
            raise HopelessError(f"sigma0 stays at {least:.3g}")


def _step(change: str, step: Iteration) -> str:
    sigma0 = "" if step.sigma0 is None else f": sigma0 {step.sigma0:.6g}"
    return f"the block does not fit: trying {change}{sigma0}"


def _sigma0(found: BundleSolution) -> float:
    return np.inf if found.sigma0 is None else float(found.sigma0)


def _redundancy(found: BundleSolution) -> int:
    return int(found.result.redundancy)


def squares(found: BundleSolution) -> float:
    """The weighted sum of squares of the residuals."""
    return _sigma0(found) ** 2 * _redundancy(found)


def variance(found: BundleSolution) -> float:
    """Of the residuals of most, by their sigmas; not less than these say."""
    return max(_sigma0(found) ** 2, 1.0)


def is_rejected(solution: BundleSolution) -> bool:
    """Whether sigma0 is too large, by its test."""
    test = global_test(solution.result) if solution.result.redundancy > 0 else None
    return test is not None and not test.passed and test.sigma0 > test.sigma0_limits[1]


def has_robust_weights(solution: BundleSolution) -> bool:
    """Whether a robust weight other than 1 took part."""
    weights = solution.residuals.weights
    return bool((np.abs(weights[np.isfinite(weights)] - 1.0) > 1e-12).any())


def is_mirrored(solution: BundleSolution) -> bool:
    """Whether mirrored images fit: with points behind the cameras, or distortions that change sides."""
    behind = 2 * int(np.count_nonzero(solution.is_behind)) > len(solution.is_behind)
    return behind or any(_changes_sides(camera) for camera in solution.cameras.values())


def _changes_sides(camera: Camera) -> bool:
    """Whether x or y go the wrong way about the axis of a camera: an affine term below -1, usually."""
    _, jacobian = camera.project_with_jacobian([[0.0, 0.0, 1.0]])
    return bool(np.linalg.det(jacobian[0, :, :2]) < 0.0)
