"""One coordinate of a control point that is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.coordinates import slips_of_a_coordinate

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where(numbering: Numbering) -> Members:
    return Members.alike(numbering.coordinate_columns[:, None], numbering.coordinates)


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"{'xyz'[label[1]]} of control point {numbering.equations.start.points[label[0]]}"


CONTROL_COORDINATE = Cause(
    "I110",
    "control coordinate",
    "One coordinate of a control point is wrong.",
    "A digit was mistyped in a list of coordinates.",
    "Correct the coordinate, or leave it empty: it is unknown then.",
    "",
    1.0,
    _where,
    _words,
    slips_of_a_coordinate,
    is_start=True,
)
