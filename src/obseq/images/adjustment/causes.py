"""Causes of a block that ends badly: tried, and named when one explains it.

Two points that were exchanged, the unit of the control points, what all measures share (axes, focal length),
what those of one image or camera share.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.images.adjustment.control_units import control_sigmas, control_unit
from obseq.images.adjustment.exchanges import exchanged_control, exchanged_measures
from obseq.images.adjustment.odd_images import odd_image
from obseq.images.adjustment.trials import Trials, is_mirrored, is_rejected
from obseq.images.initial.conventions import CONVENTIONS, MOST_MEASURES, MOST_PLACED

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.bundle import BundleAdjustment
    from obseq.images.poses import Poses

BAD = 5.0
"""sigma0 above which a converged block is tried again."""
GROSS = 10.0
"""Sigmas: a larger residual may be that of an exchanged point."""
MIRRORED = (
    "the block fits as a mirror image only (points behind the cameras, or a distortion that changes sides): "
    "axes of image points or control points are not those of here"
)


def common_cause(
    block: BundleAdjustment,
    solution: BundleSolution,
    given: Poses,
    told: Callable[[str], None] | None = None,
    **options: Any,
) -> str:
    """What explains that a block fits badly, in words; empty for one that fits, or when nothing tried does.

    Args:
        block: as it is; it does not change.
        solution: of it.
        given: its poses before others were found.
        told: is told what is being tried, and how far it is: a trial takes as long as an adjustment.
        options: of `solve`, as they were.
    """
    measures = sum(len(part.measures) for part in block.sets)
    if solution.sigma0 is None or measures > MOST_MEASURES:
        return ""
    trials = Trials(block, solution, given, told or _silent, options)
    is_bad = not solution.converged or solution.sigma0 > BAD or is_mirrored(solution)
    may_search = measures <= MOST_PLACED and (is_bad or _has_gross(solution))
    cause = control_unit(trials) if is_bad else ""
    if not cause and may_search:
        cause = exchanged_control(trials) or exchanged_measures(trials)
    if not cause and is_bad:
        cause = _cause_of_all(trials)
    if not cause and is_rejected(solution):
        cause = control_sigmas(trials)
    if not cause and may_search:
        cause = odd_image(trials, is_bad)
    return cause or (MIRRORED if is_bad and is_mirrored(solution) else "")


def _has_gross(solution: BundleSolution) -> bool:
    found = solution.residuals
    return bool((np.abs(found.residuals) > GROSS * found.sigmas).any())


def _cause_of_all(trials: Trials) -> str:
    """A convention of all image coordinates, or a focal length."""
    fits, cameras = [], trials.cameras
    for convention in CONVENTIONS:
        changed = trials.measured(partial(convention.of, cameras=cameras))
        found = trials.fitting(changed, convention.trial)
        if found is not None:
            fits.append((_principal_shift(found), len(found.iterations), convention.said, found))
    if fits:
        *_, said, found = min(fits, key=lambda fit: fit[:2])
        return f"{said}: {_falls(trials, found)}"
    freed = trials.copy()
    freed.free_parameters("F")
    found = trials.fitting(freed, "another focal length")
    if found is None:
        return ""
    return f"a focal length is wrong, or its unit ({_focal_lengths(found)}): {_falls(trials, found)}"


def _principal_shift(found: BundleSolution) -> float:
    """Pixels by which a principal point moved, at most: a wrong convention that fits needs it to."""
    given = found.block.cameras
    shifts = [c.principal_point - given[name].principal_point for name, c in found.cameras.items()]
    return float(np.abs(shifts).max(initial=0.0))


def _silent(said: str) -> None:
    """Nobody is told."""


def _falls(trials: Trials, after: BundleSolution) -> str:
    if is_mirrored(trials.before):
        return f"the block fits as a mirror image; so changed, as it is, with sigma0 {after.sigma0:.3g}"
    return f"so changed, {trials.falls(after)}"


def _focal_lengths(found: BundleSolution) -> str:
    """Those that are farthest from what was given."""
    given = found.block.cameras
    ratio = {name: abs(np.log(camera.focal / given[name].focal)) for name, camera in found.cameras.items()}
    name = max(ratio, key=lambda name: ratio[name])
    return f"camera {name}: {given[name].focal:g} px given, {found.cameras[name].focal:.6g} px as an unknown"
