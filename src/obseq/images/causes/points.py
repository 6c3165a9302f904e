"""Single points of a block that are wrong: image points, control points and their coordinates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.slips import slips_of_a_coordinate, slips_of_a_pixel, slips_of_a_point

if TYPE_CHECKING:
    from obseq.images.causes.numbering import Numbering


def _where_of_image_point(numbering: Numbering) -> Members:
    rows = np.flatnonzero(numbering.kept)
    return Members.alike(2 * rows[:, None] + np.arange(2), rows)


def _words_of_image_point(numbering: Numbering, label: tuple[int, ...]) -> str:
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
    _where_of_image_point,
    _words_of_image_point,
    slips_of_a_pixel,
    is_start=True,
)


def _where_of_coordinate(numbering: Numbering) -> Members:
    return Members.alike(numbering.coordinate_columns[:, None], numbering.coordinates)


def _words_of_coordinate(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"{'xyz'[label[1]]} of control point {numbering.equations.start.points[label[0]]}"


CONTROL_COORDINATE = Cause(
    "I110",
    "control coordinate",
    "One coordinate of a control point is wrong.",
    "A digit was mistyped in a list of coordinates.",
    "Correct the coordinate, or leave it empty: it is unknown then.",
    "",
    1.0,
    _where_of_coordinate,
    _words_of_coordinate,
    slips_of_a_coordinate,
    is_start=True,
)


def _where_of_point(numbering: Numbering) -> Members:
    return Members.grouped(numbering.coordinate_columns, numbering.coordinates[:, 0], 2)


def _words_of_point(numbering: Numbering, label: tuple[int, ...]) -> str:
    return f"control point {numbering.equations.start.points[label[0]]}"


CONTROL_POINT = Cause(
    "I111",
    "control point",
    "A control point is elsewhere than its coordinates say.",
    "It has the coordinates of another point, or another point was measured in all images.",
    "Correct the coordinates or the name of the point, or take it for unknown.",
    "",
    3.0,
    _where_of_point,
    _words_of_point,
    slips_of_a_point,
    is_start=True,
)
