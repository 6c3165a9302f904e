"""Two readings of one set-up that stand in each other's place."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.substitutes import tolerance_of
from obseq.survey.screening.values import difference

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.survey.screening.robust import Estimate

_MOST = 60
"""Suspects of one kind in one set-up that are taken in pairs, the worst of them."""


def exchanged_readings(found: Estimate, suspects: list[int]) -> tuple[list[GrossError], list[int]]:
    """Readings that were exchanged, those of the same two targets together; and the other suspects."""
    pairs: dict[tuple[int, int, int], list[int]] = {}
    for a, b in _pairs(found, suspects):
        observations = found.book.observations
        ends = sorted((int(observations.to_points[a]), int(observations.to_points[b])))
        pairs.setdefault((int(observations.from_points[a]), ends[0], ends[1]), []).extend((a, b))
    errors = [_described(found, rows) for rows in pairs.values()]
    gone = {row for rows in pairs.values() for row in rows}
    return errors, [row for row in suspects if row not in gone]


def _pairs(found: Estimate, suspects: list[int]) -> Iterator[tuple[int, int]]:
    """Suspects of one kind and one set-up each of which fits in place of the other; none twice."""
    observations = found.book.observations
    alike: dict[tuple[int, int, int], list[int]] = {}
    for row in suspects:
        columns = observations.types, observations.from_points, observations.stations
        kind, origin, station = (int(column[row]) for column in columns)
        alike.setdefault((kind, origin, station), []).append(row)
    for rows in alike.values():
        left = rows[:_MOST]
        for a, b in itertools.combinations(left, 2):
            if a in left and b in left and _fits(found, a, b) and _fits(found, b, a):
                left.remove(a)
                left.remove(b)
                yield a, b


def _fits(found: Estimate, row: int, place: int) -> bool:
    """Whether the value of an observation is what another should have been."""
    kind = BY_CODE[int(found.book.observations.types[row])]
    off = difference(kind, float(found.book.observations.values[row]), float(found.computed[place]))
    return abs(off) <= tolerance_of(found, place)


def _described(found: Estimate, rows: list[int]) -> GrossError:
    observations = found.book.observations
    names = tuple(found.book.point_names[observations.to_points[row]] for row in rows[:2])
    ends = observations.to_points[rows[:2]]
    sights = observations.active & (observations.from_points == observations.from_points[rows[0]])
    of_both = np.flatnonzero(sights & np.isin(observations.to_points, ends))
    if set(of_both.tolist()) <= set(rows):
        text = f"the names {names[0]} and {names[1]} are exchanged, or the two readings"
    else:
        text = "the two readings are exchanged: each fits in place of the other"
    what = ", ".join(found.book.label(row) for row in rows)
    size = float(found.ratios[rows].max())
    return GrossError(what, Cause.SWAPPED_NAMES, text, size, tuple(rows), names)
