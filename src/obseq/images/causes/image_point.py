"""One image point that is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.pixels import slips_of_a_pixel

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where(numbering: Numbering) -> Members:
    rows = np.flatnonzero(numbering.kept)
    return Members.alike(2 * rows[:, None] + np.arange(2), rows)


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    image, point = numbering.label(label[0])
    return f"image {image}, point {point}"


IMAGE_POINT = Cause(
    "I100",
    "image point",
    "A point was measured elsewhere in an image than it is.",
    "Another point was measured under its name, or a matching went wrong.",
    "Measure the point again in that image, or leave the measure out.",
    "px",
    0.0,
    _where,
    _words,
    slips_of_a_pixel,
    is_start=True,
)
