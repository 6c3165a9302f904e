"""Points whose observations fit several places equally well: each place is a start, and least squares decide.

An observation that is wrong by a lot makes two places of one: what agrees with it, and what does not. A point
that has more observations than unknowns is not left out for that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import TypeAlias

import numpy as np

from obseq.arrays import BoolArray
from obseq.dataclass import dataclass
from obseq.survey.initial.closed_forms import Space
from obseq.survey.initial.placement import Placement
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import among, codes_for
from obseq.survey.model import FieldBook, IntArray, Orientation, Points

Orientations: TypeAlias = "np.ndarray[tuple[int], np.dtype[np.int8]]"
"""(m,) values of `Orientation`, one for each station."""


@dataclass(frozen=True, eq=False)
class Choice:
    """Where points start that have several places, at the first of them if nothing is said.

    Attributes:
        places: of points, by their names.
        undecided: names of points that start nowhere.
    """

    places: Mapping[str, Space] = field(default_factory=dict)
    undecided: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Contest:
    """The points that may start at one of several places.

    Attributes:
        rows: of them: they have more observations than unknowns.
        names: (n,) of all points.
        choice: where they start.
    """

    rows: Sequence[int]
    names: Sequence[str]
    choice: Choice


def contest_of(
    points: Points, book: FieldBook, orientations: Orientations, choice: Choice | None
) -> Contest | None:
    """The contest of a network; None where nothing is to start so.

    A point takes part that has more observations than coordinates and zeros of circles to be found.
    """
    if choice is None:
        return None
    active = book.observations.active
    unknowns = points.is_unknown.sum(axis=1) + unknown_zeros(points, book, orientations, active)
    rows = np.flatnonzero(book.counts(active, len(points)) > unknowns).tolist()
    open_rows = [row for row in rows if points.names[row] not in choice.undecided]
    return Contest(open_rows, points.names, choice)


def start_rivals(
    placement: Placement, contest: Contest, start: Callable[[int, Space], None]
) -> dict[int, tuple[Space, ...]]:
    """Starts points that have several places at one of them, one after the other; their places.

    Args:
        placement: what is known; what follows from a start is placed by it.
        contest: which points, and where.
        start: goes on from a point at a place.
    """
    known = placement.known
    rivals: dict[int, tuple[Space, ...]] = {}
    while True:
        waiting = (p for p in contest.rows if p not in rivals and not known.is_placed(p))
        point = next(filter(placement.is_ambiguous, waiting), None)
        if point is None:
            return rivals
        places = placement.best_positions[point][1].alternatives
        rivals[point] = places
        start(point, contest.choice.places.get(contest.names[point], places[0]))


def unknown_zeros(points: Points, book: FieldBook, orientations: Orientations, active: BoolArray) -> IntArray:
    """(n,) unknown zeros of circles set up on each free point, which its readings have to give as well."""
    rows = book.observations
    readings = active & among(rows.types, codes_for(Start.HZ)) & (rows.stations >= 0)
    stations = np.flatnonzero(np.bincount(rows.stations[readings]))
    stations = stations[orientations[stations] == Orientation.VERT.value]
    count = np.bincount(book.stations.origins[stations], minlength=len(points))[: len(points)]
    return np.where(points.is_free.any(axis=1) & ~points.in_datum.any(axis=1), count, 0)
