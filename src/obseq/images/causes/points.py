"""Single observations of a block that are wrong: image points, control points, and all others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.adjustment.quality import EquationNames
from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.coordinates import slips_of_a_coordinate, slips_of_a_point
from obseq.images.causes.pixels import slips_of_a_pixel

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


def _where_of_other(numbering: Numbering) -> Members:
    starts, columns, labels = [0], [], []
    for k, other in enumerate(numbering.others):
        active = getattr(other.source, "active", np.ones(other.rows, np.bool_))
        for row in np.flatnonzero(active).tolist():
            columns.append(other.first + other.width * row + np.arange(other.width))
            starts.append(starts[-1] + other.width)
            labels.append((k, row))
    joined = np.concatenate([np.zeros(0, np.int64), *columns])
    return Members(np.array(starts), joined, np.array(labels, np.int64).reshape(-1, 2))


def _words_of_other(numbering: Numbering, label: tuple[int, ...]) -> str:
    names = EquationNames(numbering.equations, numbering.surveys)
    return names.of(numbering.others[label[0]].source, label[1], 0, 0.0).name


OTHER = Cause(
    "I180",
    "other observation",
    "A length, an observed pose or a reading of an instrument contradicts the rest.",
    "A value was mistyped, or belongs to other points.",
    "Correct the value, or leave it out.",
    "",
    0.0,
    _where_of_other,
    _words_of_other,
    is_start=True,
)
