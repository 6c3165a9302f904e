"""Where a block starts when the poses that were given are left aside: from measures and control points."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

from obseq.errors import ObseqError
from obseq.images.adjustment.start import start_of

if TYPE_CHECKING:
    from obseq.images.adjustment.adjustable import AdjustableBlock
    from obseq.images.adjustment.start import Start


def copied(block: AdjustableBlock) -> AdjustableBlock:
    """The block, to be changed."""
    made = copy.copy(block)
    made.rules, made.camera_of, made.sets = list(made.rules), dict(made.camera_of), list(made.sets)
    return made


def without_poses(block: AdjustableBlock) -> AdjustableBlock:
    """The block with poses from its measures and control points alone.

    Raises:
        InputError: images cannot be placed.
    """
    made = copied(block)
    made.poses = made.poses.select([])
    made.initialise(causes=False)
    return made


def start_from_measures(block: AdjustableBlock) -> Start | None:
    """The start of a block without the poses that were given; None where its images cannot be placed."""
    try:
        return start_of(without_poses(block))
    except ObseqError:
        return None
