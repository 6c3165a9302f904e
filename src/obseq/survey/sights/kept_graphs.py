"""Graphs that are made once for field books that differ in values and sigmas only: those of trials."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from obseq.survey.sights.graph_building import build_graph, measured_anew
from obseq.survey.sights.ways import PlumbWays

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from obseq.survey.model import FieldBook
    from obseq.survey.sights.sight_graph import SightGraph

_MOST = 5000
"""Observations up to which a graph is kept: those of large networks take memory."""

_OF_GRAPHS = ("types", "from_points", "to_points", "stations", "backsights", "active")
"""Columns of the observations, besides the heights, from which it follows what is in a graph."""


class _Made(NamedTuple):
    """A graph, the ways between its stations, and what they were made of."""

    book: FieldBook
    n_points: int
    is_level: bool
    graph: SightGraph
    ways: PlumbWays


class Graphs:
    """Graphs of field books, one after the other: what one shares with the next is not made anew.

    Args:
        bend: as of `build_graph`.
    """

    def __init__(self, bend: float = 0.0) -> None:
        self._bend = bend
        self._last: _Made | None = None

    def of(
        self, book: FieldBook, n_points: int, orientations: npt.NDArray[np.int8], *, is_level: bool
    ) -> tuple[SightGraph, PlumbWays]:
        """The graph of a field book, and the ways between its stations; arguments as of `build_graph`."""
        last = self._last
        if last is None or (last.n_points, last.is_level) != (n_points, is_level):
            graph = build_graph(book, n_points, orientations, is_level=is_level, bend=self._bend)
        elif _is_the_same(last.book, book):
            return last.graph, last.ways
        elif _differ_in_numbers(last, book, orientations):
            graph = measured_anew(last.graph, book)
        else:
            graph = build_graph(book, n_points, orientations, is_level=is_level, bend=self._bend)
        made = _Made(book, n_points, is_level, graph, PlumbWays(graph))
        if len(book.observations) <= _MOST:
            self._last = made
        return made.graph, made.ways


def _is_the_same(book: FieldBook, other: FieldBook) -> bool:
    return book.observations is other.observations and book.stations is other.stations


def _differ_in_numbers(last: _Made, book: FieldBook, orientations: npt.NDArray[np.int8]) -> bool:
    """Whether a book differs from that of a graph in values and sigmas only, and all in this is measured."""
    first, other = last.book.observations, book.observations
    n_assumed = len(last.graph.origins) - len(book.stations)
    return (
        not (last.is_level or n_assumed)
        and last.book.stations is book.stations
        and last.graph.orientations == orientations.tolist()
        and all(getattr(first, name) is getattr(other, name) for name in _OF_GRAPHS)
        and first.from_heights is other.from_heights
        and first.to_heights is other.to_heights
    )
