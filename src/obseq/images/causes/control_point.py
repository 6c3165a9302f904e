"""A control point whose coordinates are all wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.coordinates import slips_of_a_point

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where(numbering: Numbering) -> Members:
    return Members.grouped(numbering.coordinate_columns, numbering.coordinates[:, 0], 2)


def _words(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"control point {numbering.equations.start.points[label[0]]}"


CONTROL_POINT = Cause(
    "I111",
    "control point",
    "A control point is elsewhere than its coordinates say.",
    "It has the coordinates of another point, or another point was measured in all images.",
    "Correct the coordinates or the name of the point, or take it for unknown.",
    "",
    3.0,
    _where,
    _words,
    slips_of_a_point,
    is_start=True,
)
