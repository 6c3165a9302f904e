"""Causes of a block that ends badly: tried, and named when one explains it.

Two points that were exchanged, the unit of the control points, what all measures share (axes, focal length),
what those of one image or camera share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.images.adjustment.axes import axes_in_words, common, exchanged_axes, reduced_images
from obseq.images.adjustment.calibrations import held_parameters, interior
from obseq.images.adjustment.control_units import control_sigmas, control_unit, large_sigmas
from obseq.images.adjustment.exchanges import exchanged_control, exchanged_measures
from obseq.images.adjustment.given_poses import exchanged_images, misplaced
from obseq.images.adjustment.gross_errors import gross_errors, worst_control, worst_pose
from obseq.images.adjustment.odd_control import odd_control
from obseq.images.adjustment.odd_images import odd_image
from obseq.images.adjustment.trials import BAD, Trials, has_robust_weights, is_mirrored, is_rejected
from obseq.images.initial.conventions import MOST_MEASURES, MOST_PLACED

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.poses import Poses

GROSS, DOUBTFUL = 10.0, 2.5
"""Sigmas: larger residuals may be of exchanged points; of control points, from a wrong calibration."""
SMALL, NEAR = 5e-4, 5e-3
"""Of focal lengths and of the extent: no block comes as near to image and control points with wrong axes."""
MIRRORED = (
    "the block fits as a mirror image only (points behind the cameras, or a distortion that changes sides): "
    "axes of image points or control points are not those of here"
)


def common_cause(
    block: AdjustableBlock,
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
    trials = Trials(block, given, told or silent, options, solution)
    is_bad = not solution.converged or solution.sigma0 > BAD or is_mirrored(solution)
    may_search = measures <= MOST_PLACED and (is_bad or _has_gross(solution))
    may_be_misplaced = is_bad and not _is_in_shape(solution)
    cause = (control_unit(trials) if is_bad else "") or reduced_images(trials)
    if not cause and (is_rejected(solution) or worst_control(solution, DOUBTFUL)):
        cause = _calibration(trials, is_bad, may_search)
    if not cause and may_search:
        cause = exchanged_control(trials) or exchanged_measures(trials)
    if not cause and is_bad and may_search:
        cause = gross_errors(trials, most_control=1)  # axes may explain more of them, without an unknown
    if not cause and may_be_misplaced:
        cause = _axes_or_poses(trials)
    if not cause and is_bad:
        cause = interior(trials)
    if not cause and is_rejected(solution):
        cause = control_sigmas(trials)
    if not cause and may_search:
        cause = odd_image(trials, may_be_misplaced) or (odd_control(trials) if may_be_misplaced else "")
    if not cause and measures <= MOST_PLACED and _may_be_several(solution):
        cause = gross_errors(trials, 2)
    if not (cause or is_bad):
        cause = large_sigmas(trials) or exchanged_images(*common(solution.poses, given))
    return cause or (MIRRORED if is_bad and is_mirrored(solution) else "")


def _has_gross(solution: BundleSolution) -> bool:
    """Whether an observation is off by many of its sigmas."""
    found = solution.residuals
    is_off = (np.abs(found.residuals) > GROSS * found.sigmas).any()
    return bool(is_off or worst_control(solution, GROSS) or worst_pose(solution))


def _may_be_several(solution: BundleSolution) -> bool:
    """Whether several observations may be wrong, that robust weights do not hold down."""
    return not has_robust_weights(solution) and (is_rejected(solution) or _has_gross(solution))


def _is_in_shape(solution: BundleSolution) -> bool:
    """Whether residuals are so small that axes, poses and control points are right, whatever sigmas say."""
    if not solution.converged or is_mirrored(solution) or solution.block.pose_observations:
        return False
    found, off = solution.residuals, solution.control_residuals()[1]
    focals = np.array([camera.focal for camera in solution.start.cameras])[found.image]
    extent = np.ptp(solution.coordinates, axis=0).max()
    return bool(
        np.sqrt(np.mean(np.square(found.norms / focals))) < SMALL
        and (np.linalg.norm(off, axis=1) < NEAR * extent).all()
    )


def _axes_or_poses(trials: Trials) -> str:
    """Axes, or given poses, that are wrong, in words: poses before axes with which much is left."""
    axes = exchanged_axes(trials)
    said = axes_in_words(trials, axes)
    if axes is not None and (axes.found.sigma0 or 0.0) < BAD:
        return said
    return misplaced(trials) or said


def _calibration(trials: Trials, is_bad: bool, may_search: bool) -> str:
    """Parameters of cameras that are held and wrong; or single observations, where these explain as much.

    Of a bad block, other axes may need no parameter more, and a principal point two.
    """
    said = held_parameters(trials, 1 if is_bad else 3)
    also = gross_errors(trials) if said and may_search else ""
    return f"{said}; or {also}" if also else said


def silent(said: str) -> None:
    """Nobody is told."""
