"""Which observations the points of a Comp3D project may have, by how many of their coordinates count."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from obseq.arrays import BoolArray
from obseq.errors import InputError
from obseq.survey.kinds.components import DX, DY
from obseq.survey.kinds.directions import AZIM, HZ, ZEN
from obseq.survey.kinds.equalities import EQUAL_DH
from obseq.survey.kinds.lengths import DH, DIST_HZ0
from obseq.survey.kinds.registry import BY_CODE, codes
from obseq.survey.model import FieldBook

DIMENSIONS = {"4": 1, "5": 1, "6": 2, "7": 2, "8": 2, "9": 2}
"""Coordinates that count, by the code of a point: height alone, or plan alone; all three for other codes."""
ALLOWED = {1: codes(DH, EQUAL_DH), 2: codes(DIST_HZ0, HZ, AZIM, DX, DY)}
"""What may be observed of points whose height alone, or whose plan alone, is known."""
WORDS = {1: "its height alone counts (codes 4 and 5)", 2: "its plan alone counts (codes 6 to 9)"}


def check_dimensions(book: FieldBook, dimensions: Mapping[str, int]) -> FieldBook:
    """The observations; zenith angles of points in plan are switched off, and a warning names them.

    Args:
        book: The observations.
        dimensions: Coordinates that count, by the names of points that have fewer than three.

    Raises:
        InputError: Something else is observed of such a point that it cannot have; file and line are named.
    """
    if not dimensions:
        return book
    zeniths = _of(book, dimensions, 2) & (book.observations.types == ZEN.code)
    named = ", ".join(book.label(row) for row in np.flatnonzero(zeniths).tolist())
    kept = book.without(zeniths)
    for dimension in ALLOWED:
        wrong = np.flatnonzero(_of(kept, dimensions, dimension))
        if wrong.size:
            _refuse(kept, dimensions, dimension, int(wrong[0]))
    if not named:
        return book
    return kept.warned(f"zenith angles of points whose plan alone counts (codes 6 to 9): left out: {named}")


def _of(book: FieldBook, dimensions: Mapping[str, int], dimension: int) -> BoolArray:
    """(n,) active observations that points of a dimension cannot have."""
    rows = book.observations
    mine = np.array([dimensions.get(name) == dimension for name in book.point_names], np.bool_)
    return np.asarray(rows.active & rows.naming(mine) & ~np.isin(rows.types, ALLOWED[dimension]))


def _refuse(book: FieldBook, dimensions: Mapping[str, int], dimension: int, row: int) -> None:
    rows = book.observations
    ends = (book.point_names[rows.from_points[row]], book.point_names[rows.to_points[row]])
    name = next(end for end in ends if dimensions.get(end) == dimension)
    words = BY_CODE[int(rows.types[row])].words
    raise InputError(
        f"{book.label(row)}: of point {name} {WORDS[dimension]}, and a {words} needs more; correct the "
        "code of the point, or switch the line off"
    )
