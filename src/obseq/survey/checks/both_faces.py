"""Readings in both faces of the telescope, which observations of one set-up and target must not mix."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.printable import listed
from obseq.survey.kinds.directions import HZ, ZEN

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.survey.model import FieldBook
    from obseq.survey.model import IntArray as Numbers

CLOSE = 0.5 * math.pi / 200.0
"""Errors of an instrument between its faces, generously (rad)."""
MOST = 4


def refuse_both_faces(book: FieldBook) -> None:
    """Refuses the second face: directions half a turn from the first, zenith angles that add to a full turn.

    One such sight may be a slip, which the search of gross errors names; two from one point are no accident.

    Raises:
        InputError: Naming the point, its targets, and a line of each face.
    """
    pairs = np.concatenate([_directions(book), _zeniths(book)])
    if len(pairs):
        origins = book.observations.from_points[pairs[:, 0]]
        several = np.flatnonzero(np.bincount(origins)[origins] > 1)
        if several.size:
            raise InputError(_sentence(book, pairs[origins == origins[several[0]]]))


def _directions(book: FieldBook) -> IntArray:
    """(n, 2) rows of the two faces of directions of one set-up."""
    rows = np.flatnonzero(book.observations.active & (book.observations.types == HZ.code))
    first = _first_of_its_kind(book.observations.stations[rows], book.observations.to_points[rows])
    values = book.observations.values[rows]
    return _joined(rows, first, _is_near(values - values[first], math.pi))


def _zeniths(book: FieldBook) -> IntArray:
    """(n, 2) rows of the two faces of zenith angles; near the vertical both look alike."""
    rows = np.flatnonzero(book.observations.active & (book.observations.types == ZEN.code))
    first = _first_of_its_kind(book.observations.from_points[rows], book.observations.to_points[rows])
    values = book.observations.values[rows]
    is_other = ~_is_near(values, values[first], 4.0 * CLOSE)
    return _joined(rows, first, is_other & _is_near(values + values[first], 0.0))


def _first_of_its_kind(origins: Numbers, targets: Numbers) -> IntArray:
    """(n,) for each sight the first one with its origin and target."""
    keys = origins.astype(np.int64) << 32 | targets
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(first[which])


def _is_near(angles: FloatArray, others: FloatArray | float, limit: float = CLOSE) -> BoolArray:
    return np.abs(np.remainder(angles - others + math.pi, 2.0 * math.pi) - math.pi) < limit


def _joined(rows: IntArray, first: IntArray, chosen: BoolArray) -> IntArray:
    return np.column_stack([rows[first[chosen]], rows[chosen]])


def _sentence(book: FieldBook, pairs: IntArray) -> str:
    rows = book.observations
    targets = list(dict.fromkeys(book.point_names[row] for row in rows.to_points[pairs[:, 0]]))
    examples = {int(rows.types[pair[0]]): pair for pair in reversed(pairs.tolist())}.values()
    where = ", ".join(f"{book.label(first)} and {book.place(second)}" for first, second in examples)
    origin = book.point_names[rows.from_points[pairs[0, 0]]]
    return (
        f"{origin} sights {listed(targets, MOST)} in both faces of the telescope: "
        f"{where}. Observations have no face here: write zenith angles of the second one as a full turn "
        "(400 gon) minus the reading, and its directions half a turn (200 gon) from the reading or, in an "
        "OBS file, in a set-up of their own (code 7)"
    )
