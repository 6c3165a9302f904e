"""Poses for the images of a block that have none, and why some cannot be placed."""

from __future__ import annotations

import functools

from obseq.errors import InputError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.diagnosing.refusals import unplaced_error
from obseq.images.initial.distribution import check_places
from obseq.images.initial.growth import Growth, place_images, place_the_last
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

SHOWN = 4


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
    if growth.waiting():
        place_the_last(growth, block.control)
    if said := _unplaced(growth):
        raise unplaced_error(f"{block.source}{said}", block, growth, causes, _notes(block))
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
