"""Which points of a network hang together, and on what is known of some of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.registry import among, codes_where

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, IntArray
    from obseq.survey.model import FieldBook, Points


def linked_to_known(points: Points, book: FieldBook) -> BoolArray:
    """(n,) whether a chain of observations links each point to a coordinate that is known or observed."""
    known = np.asarray(~points.is_free.all(axis=1) | points.in_datum.any(axis=1))
    absolute = codes_where(lambda kind: kind.is_absolute)
    return _linked(parts_of(book), known, _observed(book, absolute))


def parts_of(book: FieldBook) -> IntArray:
    """(n,) for each point the first of those that active observations join it to, however indirectly."""
    first, second = _joined(book)
    parts = np.arange(len(book.point_names))
    while True:
        least = np.minimum(parts[first], parts[second])
        lower = parts.copy()
        np.minimum.at(lower, parts[first], least)
        np.minimum.at(lower, parts[second], least)
        lower = lower[lower]
        if np.array_equal(lower, parts):
            return parts
        parts = lower


def _joined(book: FieldBook) -> tuple[IntArray, IntArray]:
    """Pairs of points that have a part in one active observation."""
    rows = book.observations
    third = rows.active & (rows.backsights >= 0)
    groups = [
        (members[0], other) for row, members in book.barycentres if rows.active[row] for other in members
    ]
    grouped = np.array(groups, np.int32).reshape(-1, 2).T
    first = np.concatenate([rows.from_points[rows.active], rows.from_points[third], grouped[0]])
    second = np.concatenate([rows.to_points[rows.active], rows.backsights[third], grouped[1]])
    return first, second


def _observed(book: FieldBook, kinds: list[int]) -> IntArray:
    """The points of which there are active observations of these kinds."""
    rows = book.observations
    return np.asarray(rows.from_points[rows.active & among(rows.types, kinds)])


def _linked(part: IntArray, known: BoolArray, observed: IntArray) -> BoolArray:
    """(n,) whether a part has a point that is known (a mask), or one of those observed."""
    holds = np.zeros(len(part), np.bool_)
    holds[part[np.flatnonzero(known)]] = holds[part[observed]] = True
    return np.asarray(holds[part])
