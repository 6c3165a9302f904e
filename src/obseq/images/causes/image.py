"""An image whose measures are all wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.conventions import slips_of_images

if TYPE_CHECKING:
    from obseq.arrays import IntArray
    from obseq.images.causes.numbering import Numbering

LEAST = 4
"""Image points of an image: three determine its pose, whatever they are."""


def columns_by(numbering: Numbering, owner: IntArray) -> Members:
    """All image points of each owner (m,)."""
    rows = np.flatnonzero(numbering.kept)
    columns = (2 * rows[:, None] + np.arange(2)).ravel()
    return Members.grouped(columns, np.repeat(owner[rows], 2), 2 * LEAST)


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"image {numbering.equations.start.poses.images[label[0]]}"


IMAGE = Cause(
    "I120",
    "image",
    "All that was measured in an image contradicts the others.",
    "Its lines were counted upwards, it was measured in a reduced copy, or it is of another camera.",
    "Correct what is said of the image, or measure it again.",
    "px",
    5.0,
    lambda numbering: columns_by(numbering, numbering.image),
    _words,
    slips_of_images,
    is_block=True,
)
