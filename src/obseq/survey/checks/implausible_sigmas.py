"""Sigmas that leave an observation or a known coordinate without weight: mostly a year or a code."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.survey.kinds.registry import IS_ANGLE
from obseq.survey.model import FieldBook, Points

TIMES = 300.0
"""How many times larger than the usual one of its kind a sigma is that is told: a slip of 1000 shows."""
LENGTH, ANGLE = 100.0, math.pi / 2.0
"""Sigmas (m, rad) that say nothing whatever is usual."""
LEAST_COORDINATE = 1.0
"""Sigma of a known coordinate (m) below which it says something whatever is usual."""
ENDING = (
    "it has next to no weight; if a year, a code or a remark stands where the sigma should, correct the line"
)
GON = math.pi / 200.0


def implausible_sigmas(points: Points, book: FieldBook) -> tuple[str, ...]:
    """A sentence each about points and about observations with such sigmas, with the line of the first."""
    return (*_of_points(points), *_of_observations(book))


def _of_points(points: Points) -> Iterator[str]:
    known = np.where(points.sigmas > 0.0, points.sigmas, np.nan)
    odd = np.zeros(len(points), np.bool_)
    for column in known.T:
        odd |= _odd(column, LENGTH) & ~(column < LEAST_COORDINATE)
    rows = np.flatnonzero(odd).tolist()
    if rows:
        sigma = np.nanmax(known[rows[0]])
        yield (
            f"{points.place(rows[0])}: the sigma of the known point {points.names[rows[0]]} is {sigma:g} m"
            f"{_others([points.place(row) for row in rows[1:]])}: {ENDING}"
        )


def _of_observations(book: FieldBook) -> Iterator[str]:
    types, sigmas = book.observations.types, book.observations.sigmas
    odd = np.zeros(len(types), np.bool_)
    for code in np.flatnonzero(np.bincount(types)).tolist():
        rows = np.flatnonzero((types == code) & book.observations.active)
        odd[rows] = _odd(sigmas[rows], ANGLE if IS_ANGLE[code] else LENGTH)
    found = np.flatnonzero(odd).tolist()
    if found:
        sigma, is_angle = float(sigmas[found[0]]), IS_ANGLE[types[found[0]]]
        told = f"{sigma / GON:g} gon" if is_angle else f"{sigma:g} m"
        others = _others([book.place(row) for row in found[1:]])
        yield f"the sigma of {book.label(found[0])} is {told}{others}: {ENDING}"


def _odd(sigmas: FloatArray, largest: float) -> BoolArray:
    """Which sigmas of one kind (NaN for none) are beyond what says anything, or what is usual of many."""
    given = np.sort(sigmas[np.isfinite(sigmas)])
    usual = float(given[(len(given) - 1) // 2]) if len(given) > 1 else math.inf
    return np.asarray(sigmas >= min(largest, TIMES * usual))


def _others(places: Sequence[str]) -> str:
    return f", and {len(places)} more are like it (the next: {places[0]})" if places else ""
