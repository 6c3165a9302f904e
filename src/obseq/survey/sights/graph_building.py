"""Makes the graph of sights from the columns of a field book, kind by kind.

When a quantity was measured several times, the first one is used: initial values need one, and the first is
the one that a reader of the file finds. Field books of trials, which differ in values and sigmas only, share
the graph that was made once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from obseq.arrays import IntArray, IntRows
from obseq.survey.kinds.kind import ObservationKind, Start
from obseq.survey.kinds.registry import IS_ANGLE, KINDS, among, codes_where
from obseq.survey.model import FieldBook, Orientation
from obseq.survey.sights.sight_graph import Measured, SightGraph, decimals
from obseq.survey.sights.sights import DISTANCE, DZ, HZ, SLOTS, ZENITH, Measures, make_sights
from obseq.survey.sights.ways import PlumbWays

Part = tuple[ObservationKind, Measured]

_SLOT_OF: dict[Start, int] = {start: slot for slot, start in enumerate(SLOTS) if start is not Start.DISTANCE}
_NO_ROWS: IntArray = np.zeros(0, np.int64)
_NOTHING = Measured(_NO_ROWS, _NO_ROWS, _NO_ROWS, np.zeros(0))


def build_graph(
    book: FieldBook,
    n_points: int,
    orientations: npt.NDArray[np.int8],
    *,
    is_level: bool = False,
    bend: float = 0.0,
) -> SightGraph:
    """The graph of a field book whose rows are rows of `n_points` points.

    The angles at a point from one backsight become a plumb station with the reading 0 there; such stations
    come after those of the field book.

    Args:
        book: the field book.
        n_points: number of points.
        orientations: of its stations.
        is_level: whether all points have the same height: every sight is level then.
        bend: what zenith angles have to be corrected by for each metre of a distance (rad / m).
    """
    parts = _parts(book)
    distances, flats = _lengths(parts, n_points, is_level=is_level)
    ends, measures = _sights(book, [part for part in parts if part[0].start in _SLOT_OF])
    angles = _AngleStations(book, _of(parts, Start.ANGLE))
    ends, measures = angles.after(ends, measures)
    _take_distances(measures, ends[1:], distances, n_points)
    _straighten(book, measures, bend)
    if is_level:
        _lay_level(measures)
    observations = book.observations
    return SightGraph(
        orientations.tolist() + [int(Orientation.VERT)] * len(angles.origins),
        book.stations.origins.tolist() + angles.origins,
        n_points,
        decimals(observations.sigmas),
        IS_ANGLE[observations.types],
        make_sights(ends, measures, observations.sigmas),
        distances,
        flats,
        _of(parts, Start.RISE),
        bend,
    )


def measured_anew(graph: SightGraph, book: FieldBook) -> SightGraph:
    """The graph of a field book that differs from that of a graph in values and sigmas only.

    All that is in the graph is measured: neither angles from backsights nor sights that are taken for level.
    """
    sights, sigmas = graph.sights, book.observations.sigmas
    values = np.full(len(book.observations) + 1, np.nan)  # the last one is for what was not measured
    for _, measured in _parts(book):
        values[measured.rows] = measured.values
    measures = replace(sights.measures, values=values[sights.measures.rows])
    _straighten(book, measures, graph.bend)
    ends = np.array((sights.stations, sights.origins, sights.targets))
    slopes, flats, rises = (
        replace(part, values=values[part.rows]) for part in (graph.slopes, graph.flats, graph.rises)
    )
    return graph.with_numbers(decimals(sigmas), make_sights(ends, measures, sigmas), slopes, flats, rises)


def _parts(book: FieldBook) -> list[Part]:
    """The active observations by kind, with the values that initial values make of theirs."""
    observations = book.observations
    usable = np.flatnonzero(observations.active)
    types = observations.types[usable]
    counts = np.bincount(types, minlength=len(IS_ANGLE))
    present = [kind for kind in KINDS if counts[kind.code] and kind.start is not Start.NOTHING]
    return [(kind, _measured(book, kind, usable[types == kind.code])) for kind in present]


def _measured(book: FieldBook, kind: ObservationKind, rows: IntArray) -> Measured:
    observations = book.observations
    heights = observations.from_heights[rows], observations.to_heights[rows]
    values = kind.start_values(observations.values[rows], *heights)
    ends = observations.from_points[rows], observations.to_points[rows]
    return Measured(rows, ends[0].astype(np.int64), ends[1].astype(np.int64), values)


def _of(parts: Sequence[Part], *starts: Start) -> Measured:
    """The observations of all kinds that give one of these things."""
    return _together([measured for kind, measured in parts if kind.start in starts])


def _together(chosen: Sequence[Measured]) -> Measured:
    """Observations one kind after the other."""
    if len(chosen) < 2:
        return chosen[0] if chosen else _NOTHING
    columns = zip(*((part.rows, part.origins, part.targets, part.values) for part in chosen), strict=True)
    rows, origins, targets, values = (np.concatenate(column) for column in columns)
    return Measured(rows, origins, targets, values)


def _lengths(parts: Sequence[Part], n_points: int, *, is_level: bool) -> tuple[Measured, Measured]:
    """The first slope distance of each pair of points, and its first horizontal distance of each kind."""
    if is_level:
        return _firsts(_of(parts, Start.DISTANCE, Start.FLAT), n_points), _NOTHING
    flats = [_firsts(measured, n_points) for kind, measured in parts if kind.start is Start.FLAT]
    return _firsts(_of(parts, Start.DISTANCE), n_points), _together(flats)


def _firsts(measured: Measured, n_points: int) -> Measured:
    """The first observation of each pair of points, whichever of these comes first."""
    first, _ = _numbered(_pairs(measured.origins, measured.targets, n_points))
    return measured if len(first) == len(measured.rows) else measured.chosen(first)


def _pairs(first: IntArray, second: IntArray, n_points: int) -> IntArray:
    """(k,) a number for each pair of points."""
    return np.asarray(np.minimum(first, second) * n_points + np.maximum(first, second))


def _numbered(keys: IntArray) -> tuple[IntArray, IntArray]:
    """Where each key comes first, in that order, and (k,) which of these each of the keys is."""
    order, begins = keys.argsort(kind="stable"), np.ones(len(keys), np.bool_)
    ordered, which = keys[order], np.empty(len(keys), np.int64)
    np.not_equal(ordered[1:], ordered[:-1], out=begins[1:])
    first = order[begins]
    places = first.argsort()
    which[order] = places.argsort()[begins.cumsum() - 1]
    return first[places], which


def _sights(book: FieldBook, parts: Sequence[Part]) -> tuple[IntRows, Measures]:
    """Station, origin and target (3, n) of each sight, in reading order, and its measures."""
    rows = np.sort(_together([measured for _, measured in parts]).rows)
    observations, n_points = book.observations, len(book.point_names)
    pairs = observations.stations[rows].astype(np.int64) * n_points + observations.to_points[rows]
    first, numbers = _numbered(pairs)
    sight_of = np.empty(len(observations), np.int64)
    sight_of[rows] = numbers
    stations, targets = np.divmod(pairs[first], max(n_points, 1))
    ends = np.array((stations, book.stations.origins[stations], targets))
    return ends, _measures(book, parts, sight_of, len(first))


def _measures(book: FieldBook, parts: Sequence[Part], sight_of: IntArray, n: int) -> Measures:
    """The first measure of each sight and slot: what comes later is written first."""
    measures = Measures.none(n)
    for kind, measured in reversed(parts):
        slot, rows = _SLOT_OF[kind.start], measured.rows[::-1]
        sights = sight_of[rows]
        measures.rows[slot, sights] = rows
        measures.values[slot, sights] = measured.values[::-1]
    rows = np.where(measures.rows[ZENITH] >= 0, measures.rows[ZENITH], measures.rows[DZ])
    heights = book.observations.to_heights[rows] - book.observations.from_heights[rows] if n else 0.0
    measures.lifts[:] = np.where(rows >= 0, heights, 0.0)
    return measures


class _AngleStations:
    """Stations of angles from one backsight each, which reads 0; the others read their angles.

    Attributes:
        origins: point of each station.
    """

    def __init__(self, book: FieldBook, angles: Measured) -> None:
        self.origins: list[int] = []
        self._n_before = len(book.stations)
        self._stations: dict[tuple[int, int], int] = {}
        self._readings: dict[tuple[int, int, int], tuple[float, int]] = {}
        columns = angles.rows, angles.origins, angles.targets, book.observations.backsights[angles.rows]
        lines = zip(*(column.tolist() for column in (*columns, angles.values)), strict=True)
        for row, origin, target, backsight, value in lines:
            station = self._station(origin, backsight, row)
            self._readings.setdefault((station, origin, target), (value, row))

    def _station(self, origin: int, backsight: int, row: int) -> int:
        """The station of the angles at a point from a backsight."""
        number = self._stations.get((origin, backsight))
        if number is None:
            number = self._stations[origin, backsight] = self._n_before + len(self.origins)
            self.origins.append(origin)
            self._readings[number, origin, backsight] = 0.0, row
        return number

    def after(self, ends: IntRows, measures: Measures) -> tuple[IntRows, Measures]:
        """Stations, origins and targets (3, n) of other sights and then of these, and all measures."""
        if not self._readings:
            return ends, measures
        mine = Measures.none(len(self._readings))
        mine.values[HZ], mine.rows[HZ] = np.array(list(self._readings.values())).T
        return np.hstack((ends, np.array(list(self._readings)).T)), measures.followed_by(mine)


def _take_distances(measures: Measures, ends: IntRows, distances: Measured, n_points: int) -> None:
    """Gives each sight, by its two points (2, n), the distance between them."""
    pairs = _pairs(distances.origins, distances.targets, n_points)
    if not len(pairs):
        return
    order = np.argsort(pairs)
    wanted = _pairs(ends[0], ends[1], n_points)
    places = order[np.minimum(np.searchsorted(pairs, wanted, sorter=order), len(pairs) - 1)]
    has_distance = pairs[places] == wanted
    measures.values[DISTANCE] = np.where(has_distance, distances.values[places], np.nan)
    measures.rows[DISTANCE] = np.where(has_distance, distances.rows[places], -1)


def _straighten(book: FieldBook, measures: Measures, bend: float) -> None:
    """Corrects zenith angles of sights whose distances are known for refraction: 15 m in 40 km."""
    rows = measures.rows[ZENITH]
    is_bent = (rows >= 0) & (measures.rows[DISTANCE] >= 0)
    is_bent[is_bent] = among(
        book.observations.types[rows[is_bent]], codes_where(lambda kind: kind.is_refracted)
    )
    measures.values[ZENITH, is_bent] += bend * measures.values[DISTANCE, is_bent]


def _lay_level(measures: Measures) -> None:
    """Sights without zenith angle are level."""
    is_laid = (measures.rows[ZENITH] < 0) & (measures.rows[HZ] >= 0)
    measures.values[ZENITH, is_laid] = math.pi / 2.0
    measures.rows[ZENITH, is_laid] = measures.rows[HZ, is_laid]


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
        if not is_large(book):
            self._last = made
        return made.graph, made.ways


def is_large(book: FieldBook) -> bool:
    """Whether what is made of the observations one by one takes much memory."""
    return len(book.observations) > _MOST


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
