"""Causes that all measures of a block share: tried when it ends badly, and named when one explains it."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.images.initial.conventions import CONVENTIONS, MOST_MEASURES

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.bundle import BundleAdjustment
    from obseq.images.camera import Camera
    from obseq.images.initial.conventions import Convention
    from obseq.images.poses import Poses
    from obseq.leastsquares import Iteration

BAD = 5.0
"""sigma0 above which a converged block is tried again."""
SHARE = 0.1
"""Of sigma0, below which a cause explains a block."""
MIRRORED = (
    "the block fits as a mirror image only (points behind the cameras, or a distortion that changes sides): "
    "axes of image points or control points are not those of here"
)
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
    bad = solution.sigma0 is not None and (
        not solution.converged or solution.sigma0 > BAD or _is_mirrored(solution)
    )
    if not bad or measures > MOST_MEASURES:
        return ""
    trial = _Trial(solution, told or _silent, options)
    fits = []
    for convention in CONVENTIONS:
        found = trial.of(_changed(block, given, convention), convention.trial)
        if found is not None:
            fits.append((_principal_shift(found), len(found.iterations), convention.said, found))
    if fits:
        *_, said, found = min(fits, key=lambda fit: fit[:2])
        return f"{said}: {_falls(solution, found)}"
    freed = _copy(block, given)
    freed.free_parameters("F")
    found = trial.of(freed, "another focal length")
    if found is not None:
        return f"a focal length is wrong, or its unit ({_focal_lengths(found)}): {_falls(solution, found)}"
    return MIRRORED if _is_mirrored(solution) else ""


def _copy(block: BundleAdjustment, given: Poses) -> BundleAdjustment:
    made = copy.copy(block)
    made.poses, made.rules = given, list(block.rules)
    return made


def _changed(block: BundleAdjustment, given: Poses, convention: Convention) -> BundleAdjustment | None:
    """The block with image points of another convention; None where they are in no image then."""
    cameras = {image: block.cameras[name] for image, name in block.camera_of.items()}
    made, sets = _copy(block, given), []
    for part in block.sets:
        measures = convention.of(part.measures, cameras)
        if measures is None:
            return None
        sets.append(replace(part, measures=measures))
    made.sets = sets
    return made


def _principal_shift(found: BundleSolution) -> float:
    """Pixels by which a principal point moved, at most: a wrong convention that fits needs it to."""
    given = found.block.cameras
    shifts = [c.principal_point - given[name].principal_point for name, c in found.cameras.items()]
    return float(np.abs(shifts).max(initial=0.0))


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

    def of(self, block: BundleAdjustment | None, change: str) -> BundleSolution | None:
        """The solution of a changed block that fits ten times better, or better than a mirror image."""
        if block is None:
            return None
        try:
            self.told(f"the block does not fit: trying {change}")
            block.initialise()
            found = block.solve(**self._as_before(change))
        except ObseqError:
            return None
        before = self.before.sigma0
        assert before is not None
        most = before if _is_mirrored(self.before) else SHARE * before
        better = found.sigma0 is not None and found.converged and found.sigma0 < most
        return found if better and not _is_mirrored(found) else None

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


def _is_mirrored(solution: BundleSolution) -> bool:
    """Whether mirrored images fit: with points behind the cameras, or distortions that change sides."""
    behind = 2 * int(np.count_nonzero(solution.is_behind)) > len(solution.is_behind)
    return behind or any(_changes_sides(camera) for camera in solution.cameras.values())


def _changes_sides(camera: Camera) -> bool:
    """Whether x or y go the wrong way about the axis of a camera: an affine term below -1, usually."""
    _, jacobian = camera.project_with_jacobian([[0.0, 0.0, 1.0]])
    return bool(np.linalg.det(jacobian[0, :, :2]) < 0.0)


def _falls(before: BundleSolution, after: BundleSolution) -> str:
    if _is_mirrored(before):
        return f"the block fits as a mirror image; so changed, as it is, with sigma0 {after.sigma0:.3g}"
    return f"so changed, sigma0 falls from {before.sigma0:.3g} to {after.sigma0:.3g}"


def _focal_lengths(found: BundleSolution) -> str:
    """Those that are farthest from what was given."""
    given = found.block.cameras
    ratio = {name: abs(np.log(camera.focal / given[name].focal)) for name, camera in found.cameras.items()}
    name = max(ratio, key=lambda name: ratio[name])
    return f"camera {name}: {given[name].focal:g} px given, {found.cameras[name].focal:.6g} px as an unknown"
