"""Causes that all measures of a block share: tried when it ends badly, and named when one explains it."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ObseqError

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.bundle import BundleAdjustment
    from obseq.images.parts import MeasureSet
    from obseq.images.poses import Poses
    from obseq.leastsquares import Iteration

BAD = 5.0
"""sigma0 above which a converged block is tried again."""
SHARE = 0.1
"""Of sigma0, below which a cause explains a block."""
MOST_MEASURES = 100_000
"""No larger block is adjusted again for the sake of a word."""
FEW, TIMES = 25, 2
"""Iterations of a trial: this many, or as many times those of the adjustment, if that is more."""


def common_cause(
    block: BundleAdjustment,
    solution: BundleSolution,
    given: Poses,
    told: Callable[[str], None] | None = None,
    **options: Any,
) -> str:
    """What brings sigma0 below a tenth, in words; empty for a block that fits, or when nothing tried does.

    Args:
        block: as it is; it does not change.
        solution: of it.
        given: its poses before others were found.
        told: is told what is being tried, and how far it is: a trial takes as long as an adjustment.
        options: of `solve`, as they were.
    """
    measures = sum(len(part.measures) for part in block.sets)
    bad = solution.sigma0 is not None and (not solution.converged or solution.sigma0 > BAD)
    if not bad or measures > MOST_MEASURES:
        return ""
    trial = _Trial(solution, told or _silent, options)
    found = trial.of(_mirrored(block, given), "lines counted upwards")
    if found is not None:
        return f"the lines of all images were counted upwards (y goes down here): {_falls(solution, found)}"
    freed = _copy(block, given)
    freed.free_parameters("F")
    found = trial.of(freed, "another focal length")
    if found is not None:
        return f"a focal length is wrong, or its unit ({_focal_lengths(found)}): {_falls(solution, found)}"
    return ""


def _copy(block: BundleAdjustment, given: Poses) -> BundleAdjustment:
    made = copy.copy(block)
    made.poses, made.rules = given, list(block.rules)
    return made


def _mirrored(block: BundleAdjustment, given: Poses) -> BundleAdjustment:
    made = _copy(block, given)
    made.sets = [_upside_down(block, part) for part in block.sets]
    return made


def _upside_down(block: BundleAdjustment, part: MeasureSet) -> MeasureSet:
    measures = part.measures
    cameras = [block.cameras[block.camera_of[name]] for name in measures.image_names]
    heights = np.array([camera.height for camera in cameras], dtype=np.float64)[measures.image]
    xy = np.column_stack([measures.xy[:, 0], heights - measures.xy[:, 1]])
    return replace(part, measures=replace(measures, xy=xy))


@dataclass(frozen=True, eq=False)
class _Trial:
    """Adjustments of changed blocks, to compare with one.

    Attributes:
        before: its solution.
        told: is told of each step.
        options: of `solve`.
    """

    before: BundleSolution
    told: Callable[[str], None]
    options: dict[str, Any]

    def of(self, block: BundleAdjustment, change: str) -> BundleSolution | None:
        """The solution of a changed block, if it fits ten times better."""
        try:
            self.told(f"the block does not fit: trying {change}")
            block.initialise()
            found = block.solve(**self._as_before(change))
        except ObseqError:
            return None
        before = self.before.sigma0
        assert before is not None
        better = found.sigma0 is not None and found.converged and found.sigma0 < SHARE * before
        return found if better else None

    def _as_before(self, change: str) -> dict[str, Any]:
        """The options, with a limit to the iterations that a hopeless trial does not pass."""
        most = max(FEW, TIMES * len(self.before.iterations))
        given = self.options.get("max_iterations")
        return {
            **self.options,
            "covariance": False,
            "max_iterations": min(given or most, most),
            "progress": lambda step: self.told(_step(change, step)),
        }


def _step(change: str, step: Iteration) -> str:
    sigma0 = "" if step.sigma0 is None else f": sigma0 {step.sigma0:.6g}"
    return f"the block does not fit: trying {change}{sigma0}"


def _silent(said: str) -> None:
    """Nobody is told."""


def _falls(before: BundleSolution, after: BundleSolution) -> str:
    return f"so changed, sigma0 falls from {before.sigma0:.3g} to {after.sigma0:.3g}"


def _focal_lengths(found: BundleSolution) -> str:
    """Those that are farthest from what was given."""
    given = found.block.cameras
    ratio = {name: abs(np.log(camera.focal / given[name].focal)) for name, camera in found.cameras.items()}
    name = max(ratio, key=lambda name: ratio[name])
    return f"camera {name}: {given[name].focal:g} px given, {found.cameras[name].focal:.6g} px as an unknown"
