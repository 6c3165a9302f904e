"""Single points of a block that are wrong: image points, control points and their coordinates."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.diagnosis.policy import POLICY
from obseq.diagnosis.protocol import Change, Slip
from obseq.images.causes.cause import Cause, Members
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.numbering import Numbering
from obseq.images.causes.pixels import slips_of_a_pixel
from obseq.survey.causes.values import COORDINATE, explain


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


def slips_of_a_coordinate(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What may be behind one wrong coordinate."""
    point, axis = label
    start = evidence.numbering.equations.start
    given = float(start.coordinates[point, axis])
    tolerance = POLICY.near * float(np.hypot(change.sigma[0], np.sqrt(start.covariances[point, axis, axis])))
    told = explain(COORDINATE, given, given - float(change.size[0]), tolerance)
    if told is not None:
        yield Slip(told.code, told.text, told.chance, told.chance < POLICY.likely)
    elif abs(2.0 * given - float(change.size[0])) < tolerance:
        yield Slip("W105", "its sign is wrong", 0.0, is_strong=True)


def slips_of_a_point(evidence: Evidence, label: tuple[int, ...], change: Change) -> Iterator[Slip]:
    """What may be behind a control point that is elsewhere."""
    start, columns = evidence.numbering.equations.start, evidence.numbering.coordinates
    axes = columns[columns[:, 0] == label[0], 1]
    given = start.coordinates[label[0]]
    right = given.copy()
    right[axes] -= change.size
    spread = np.sqrt(np.diagonal(start.covariances[label[0]]))
    spread = np.where(np.isfinite(spread), spread, 0.0)
    spread[axes] = np.hypot(spread[axes], change.sigma)
    if _is_near(given[[1, 0, 2]], right, spread):
        yield Slip("W123", "x and y are exchanged", 0.0, is_strong=True)
    for other in np.flatnonzero(start.is_control).tolist():
        if other != label[0] and _is_near(start.coordinates[other], right, spread):
            name = start.points[other]
            there = evidence.coordinates[other]
            is_pair = _is_near(given, there, 2.0 * spread)
            said = f"exchanged with {name}" if is_pair else f"it is where {name} should be"
            yield Slip("W133", said, 0.0, is_strong=True)


def _is_near(place: FloatArray, right: FloatArray, spread: FloatArray) -> bool:
    return bool((np.abs(place - right) <= POLICY.near * np.maximum(spread, 1e-300)).all())


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
