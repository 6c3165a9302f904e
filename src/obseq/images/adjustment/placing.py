"""Poses for the images of a block that have none, and why some cannot be placed.

What may be wrong is tried: axes of all image points or of the control points; then the block is adjusted from
poses that miss by far, or without the images that have none at all, and the causes of that are looked for.
"""

from __future__ import annotations

import copy
import functools
from dataclasses import replace
from typing import TYPE_CHECKING

from obseq.errors import InputError, ObseqError
from obseq.images.adjustment.axes import exchanged_axes
from obseq.images.adjustment.calibrations import OFF, focal_change, focal_in_words, other_focal
from obseq.images.adjustment.causes import common_cause, silent
from obseq.images.adjustment.odd_control import odd_control
from obseq.images.adjustment.odd_images import Odd, odd_without
from obseq.images.adjustment.trials import BAD, Attempts, is_rejected
from obseq.images.initial.conventions import ALIKE, MOST_PLACED
from obseq.images.initial.distribution import check_places
from obseq.images.initial.growth import place_images, place_loosely, place_the_last
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among

if TYPE_CHECKING:
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.initial.growth import Growth
    from obseq.images.parts import MeasureSet
    from obseq.images.poses import Poses

FEW, FAR_OFF = 20, 500.0
"""Iterations of a block whose images are placed loosely, and sigma0 from which they show nothing then."""
SHOWN = 4
MOST_LOST = 3
"""One of so many images at most may have no place at all, for the others to say why."""


def waiting_images(block: AdjustableBlock) -> list[str]:
    """Images that have measures and no pose."""
    measured = {name for part in block.sets for name in part.measures.image_names}
    return [image for image in block.camera_of if image in measured - set(block.poses.images)]


def placed(block: AdjustableBlock, causes: bool = True) -> Poses:
    """The poses of the images that have measures.

    Args:
        block: some of whose images have no pose.
        causes: whether to try what may be wrong where images cannot be placed.

    Raises:
        InputError: an image cannot be placed, with the reason; or the control points cannot carry the block.
    """
    growth = _grown(block)
    said = _unplaced(growth)
    cause = _axes(block, growth) if said and causes else ""
    if said and not cause:
        place_the_last(growth, block.control)
        said = _unplaced(growth)
        cause = _of_some(block, growth) if said and causes else ""
    if said:
        likely = f"\nLikely cause: {cause}" if cause else ""
        raise InputError(f"{block.source}{said}{likely}{_notes(block)}")
    return growth.as_poses()


def _grown(block: AdjustableBlock) -> Growth:
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in block.sets))
    cameras = {image: block.cameras[name] for image, name in block.camera_of.items()}
    measured = set(measures.image_names)
    given = block.poses.select([image for image in block.poses.images if image in measured])
    known = block.control.select(sorted({*block.control.names} & {*measures.point_names}))
    check_places(known.coordinates, f"{block.source}the block")
    try:
        return place_images(measures, block.control, cameras, given)
    except InputError as error:
        raise InputError(f"{block.source}{error}{_notes(block)}") from None


def _notes(block: AdjustableBlock) -> str:
    """What its files have left to say, which may explain an error."""
    return "".join(f"\nnote: {note}" for note in block.notes)


def _unplaced(growth: Growth) -> str:
    """Images that have no pose, and why not the first, in words; empty where all have one."""
    lost = growth.waiting()
    if not lost:
        return ""
    reason = growth.reasons.get(lost[0], "it shares too few points with the images that were placed")
    others = f" ({', '.join(lost[:SHOWN])}{', ...' if len(lost) > SHOWN else ''})" if len(lost) > 1 else ""
    return f"{len(lost)} images cannot be placed{others}; {lost[0]}: {reason}"


def _axes(block: AdjustableBlock, growth: Growth) -> str:
    """Axes with which a block fits that does not as it is, in words."""
    if len(growth.measures) > MOST_PLACED:
        return ""
    attempts = Attempts(block, block.poses, silent, {})
    axes = exchanged_axes(attempts)
    if axes is None or attempts.fitting(attempts.copy(), "the block as it is") is not None:
        return ""
    other = other_focal(attempts) if is_rejected(axes.found) else None
    if other is not None and ALIKE * (other.sigma0 or 0.0) < (axes.found.sigma0 or 0.0):
        return focal_in_words(attempts, other)
    return f"{axes.said}: so changed, all images can be placed"


def _of_some(block: AdjustableBlock, growth: Growth) -> str:
    """What is wrong with some images, or control points, of a block whose images are placed by force."""
    if len(growth.measures) > MOST_PLACED:
        return ""
    attempts = Attempts(block, block.poses, silent, {})
    said = odd_control(attempts)
    if said:
        return said
    place_loosely(growth, block.control)
    lost = growth.waiting()
    if MOST_LOST * len(lost) > len(growth.measures.image_names):
        return ""
    rest = _without(block, growth, lost)
    found = _solved(rest)
    said = _focal(attempts, found)
    if said:
        return said
    if found is None or found.sigma0 is None or not (found.converged or found.sigma0 < FAR_OFF):
        return ""
    tried = tuple(image for image in lost if image in growth.reasons)  # the others share too few points
    if lost and found.converged and found.sigma0 < BAD:
        odd = Odd.of(tried)
        return odd_without(odd, attempts, found) if tried else ""
    cause = common_cause(rest, found, block.poses)
    return f"{cause}; {Odd.of(tuple(lost)).said}: no place at all" if cause and lost else cause


def _focal(attempts: Attempts, rest: BundleSolution | None) -> str:
    """A focal length that all images share and with which they cannot be placed, in words.

    Args:
        attempts: of the block.
        rest: its solution with the images that can be placed by force, if there is one.
    """
    if rest is not None and rest.converged and (rest.sigma0 or 0.0) < BAD:
        given = attempts.block.cameras
        ratios = [camera.focal / given[name].focal for name, camera in rest.cameras.items()]
        found = other_focal(attempts, ratios[:1]) if focal_change(attempts, rest) > OFF else None
    else:
        found = other_focal(attempts)
    return "" if found is None else focal_in_words(attempts, found)


def _without(block: AdjustableBlock, growth: Growth, lost: list[str]) -> AdjustableBlock:
    """The block with the poses that were found, without the measures in lost images."""
    made = copy.copy(block)
    made.camera_of = dict(block.camera_of)
    made.sets = [_kept(part, lost) for part in block.sets]
    made.poses = growth.as_poses()
    return made


def _kept(part: MeasureSet, lost: list[str]) -> MeasureSet:
    measures = part.measures
    return replace(part, measures=measures.rows(~are_among(measures.image_names, lost)[measures.image]))


def _solved(block: AdjustableBlock) -> BundleSolution | None:
    try:
        return block.solve(max_iterations=FEW, covariance=False)
    except ObseqError:
        return None
