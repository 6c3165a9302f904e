"""Ways from station to station: how one that is oriented sees another that is not.

A way gives the other station its place and the azimuth of one of its sights, in the axes of the first one, so
that it depends on no coordinates: all ways of many stations are computed at once, as arrays.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray, FloatRows, IntArray, IntRows
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.survey.sights.sight_graph import SightGraph
from obseq.survey.sights.sights import Sights, lengths

_MOST_STATIONS = 50
"""Stations that are linked through one common target."""
_BLOCK = 1 << 16
"""Pairs of sights to common targets that are treated together."""


@dataclass(frozen=True, eq=False)
class Views:
    """What stations see, station by station: their own points first, then the ends of complete sights.

    Attributes:
        stations: (v,) of each view, ascending.
        points: (v,) what is seen.
        numbers: (v,) sights; -1 for the point of the station itself.
        vectors: (v, 3) from the station, in plumb axes (m).
        sigmas: (v,) expected errors of the vectors (m).
    """

    stations: IntArray
    points: IntArray
    numbers: IntArray
    vectors: FloatRows
    sigmas: FloatArray

    @classmethod
    def of(cls, graph: SightGraph, stations: Sequence[int]) -> Views:
        """What some stations, in ascending order, see in the axes of their instruments."""
        sights, numbers = graph.sights, _flat([graph.sights_from[station] for station in stations])
        numbers = numbers[np.isfinite(sights.vectors[numbers, 0])]
        own = np.array(stations, np.int64)
        every = np.concatenate((own, sights.stations[numbers]))
        order = every.argsort(kind="stable")
        points = np.concatenate(([graph.origins[station] for station in stations], sights.targets[numbers]))
        return cls(
            every[order],
            points[order],
            np.concatenate((np.full(len(own), -1), numbers))[order],
            np.concatenate((np.zeros((len(own), 3)), sights.vectors[numbers]))[order],
            np.concatenate((np.zeros(len(own)), sights.vector_sigmas[numbers]))[order],
        )

    def turned(self, rotation: FloatRows) -> Views:
        """These, in axes (3, 3) that the instruments are turned to."""
        return Views(self.stations, self.points, self.numbers, self.vectors @ rotation.T, self.sigmas)


def _flat(lists: Sequence[Sequence[int]]) -> IntArray:
    return np.fromiter(chain.from_iterable(lists), np.int64)


@dataclass(frozen=True, eq=False)
class _Shared:
    """What two stations share: views of one, and sights of the other to the same points.

    Attributes:
        views: (k,) of the first station.
        sights: (k,) of the other one.
        starts: (g,) where each pair of stations begins.
        pairs: (k,) the pair of stations of each item.
    """

    views: IntArray
    sights: IntArray
    starts: IntArray
    pairs: IntArray

    @classmethod
    def ordered(cls, views: IntArray, sights: IntArray, keys: IntArray) -> _Shared:
        """Items whose keys, of their pairs of stations, ascend."""
        begins = np.ones(len(keys), np.bool_)
        np.not_equal(keys[1:], keys[:-1], out=begins[1:])
        return cls(views, sights, begins.nonzero()[0], begins.cumsum() - 1)

    def chosen(self, which: BoolArray) -> _Shared:
        """Some of the items."""
        return _Shared.ordered(self.views[which], self.sights[which], self.pairs[which])

    def least(self, values: FloatArray) -> IntArray:
        """(g,) of each pair of stations, the first item with the least value (k,)."""
        smallest = np.minimum.reduceat(values, self.starts)
        places = (values == smallest[self.pairs]).nonzero()[0]
        return np.asarray(places[self.pairs[places].searchsorted(np.arange(len(self.starts)))])


def _shared(graph: SightGraph, views: Views) -> _Shared:
    """What the stations of the views share with each plumb station."""
    seen_by = [graph.sights_to[point][:_MOST_STATIONS] for point in views.points.tolist()]
    sights = _flat(seen_by)
    of_views = np.arange(len(seen_by)).repeat(list(map(len, seen_by)))
    stations, others = views.stations[of_views], graph.sights.stations[sights]
    kept = (graph.is_plumb[others] & (others != stations)).nonzero()[0]
    keys = stations[kept] * len(graph.origins) + others[kept]
    order = keys.argsort(kind="stable")
    kept = kept[order]
    return _Shared.ordered(of_views[kept], sights[kept], keys[order])


class Ways:
    """Ways from stations to others, by the stations.

    Attributes:
        views: what the stations see.
        others: (w,) where the ways end.
        positions: (w, 3) the points of the others, in the axes of the views (m).
        relative_sigmas: (w,) expected errors of the positions (m).
        azimuth_sigmas: (w,) expected errors of azimuths (rad), but for that of the first station.
        seen: (w, 2) views of the targets that give the azimuth; -1 where one does.
        sights: (w, 2) sights of the others to these targets, likewise.
    """

    def __init__(self, graph: SightGraph, views: Views, parts: Sequence[_Part]) -> None:
        self.views = views
        part = parts[0] if len(parts) == 1 else _in_order(views, parts)
        self.seen, self.sights, self.positions, self.relative_sigmas, self.azimuth_sigmas = part
        self.others: IntArray = graph.sights.stations[self.sights[:, 0]]
        self._first, last = int(views.stations[0]), int(views.stations[-1])
        stations = views.stations[self.seen[:, 0]]
        self._starts = stations.searchsorted(np.arange(self._first, last + 2)).tolist()

    def of(self, station: int) -> slice:
        """Those of one of the stations."""
        first = station - self._first
        return slice(self._starts[first], self._starts[first + 1])


class _Part(NamedTuple):
    """Ways of one method, with the attributes of `Ways`."""

    seen: IntRows
    sights: IntRows
    positions: FloatRows
    relative_sigmas: FloatArray
    azimuth_sigmas: FloatArray

    def chosen(self, which: BoolArray | IntArray) -> _Part:
        """Some of them."""
        sigmas = self.relative_sigmas[which], self.azimuth_sigmas[which]
        return _Part(self.seen[which], self.sights[which], self.positions[which], *sigmas)


def _in_order(views: Views, parts: Sequence[_Part]) -> _Part:
    """Ways of several methods, by the stations that they start from; each part is so ordered."""
    together = _Part(
        np.concatenate([part.seen for part in parts]),
        np.concatenate([part.sights for part in parts]),
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.relative_sigmas for part in parts]),
        np.concatenate([part.azimuth_sigmas for part in parts]),
    )
    return together.chosen(views.stations[together.seen[:, 0]].argsort(kind="stable"))


def find_ways(graph: SightGraph, views: Views) -> Ways:
    """The surest way from each station of the views to each plumb station."""
    shared = _shared(graph, views)
    by_sight, is_seen = _by_sight(graph, views, shared)
    is_complete = np.isfinite(graph.sights.vectors[shared.sights, 0])
    is_free = ~is_seen[shared.pairs] & is_complete
    if not is_free.any():
        return Ways(graph, views, [by_sight])
    return Ways(graph, views, [by_sight, _by_two_targets(graph.sights, views, shared.chosen(is_free))])


def _by_sight(graph: SightGraph, views: Views, shared: _Shared) -> tuple[_Part, BoolArray]:
    """The one station sees the other; a common target, or the sight back, gives the azimuth.

    Returns:
        The ways, and which of the pairs of stations (g,) have one.
    """
    ends, sights = _views_of_others(graph, views, shared), graph.sights
    items, origins = shared.views, ends[shared.pairs]
    apart = _flat_lengths(views.vectors[items] - views.vectors[origins])
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = np.hypot(views.sigmas[items], views.sigmas[origins]) / apart
        read = sights.reading_sigmas[shared.sights] + sights.shift_sigmas[shared.sights] / apart
    is_usable = (origins >= 0) & (apart > 0.0) & np.isfinite(sights.readings[shared.sights])
    azimuth_sigmas = np.where(is_usable, np.hypot(turned, read), np.inf)
    best = shared.least(azimuth_sigmas)
    is_seen = np.isfinite(azimuth_sigmas[best])
    best, ends = best[is_seen], ends[is_seen]
    seen, of_others = np.full((2, len(best), 2), -1)
    seen[:, 0], of_others[:, 0] = items[best], shared.sights[best]
    return _Part(seen, of_others, views.vectors[ends], views.sigmas[ends], azimuth_sigmas[best]), is_seen


def _views_of_others(graph: SightGraph, views: Views, shared: _Shared) -> IntArray:
    """(g,) of each pair of stations, the view of the other's point; -1 where it is not seen."""
    keys = views.stations * graph.n_points + views.points
    order = keys.argsort(kind="stable")
    first = shared.starts
    wanted = views.stations[shared.views[first]] * graph.n_points + graph.sights.origins[shared.sights[first]]
    found = order[np.minimum(keys.searchsorted(wanted, sorter=order), len(keys) - 1)]
    return np.where(keys[found] == wanted, found, -1)


def _by_two_targets(sights: Sights, views: Views, shared: _Shared) -> _Part:
    """Free stations, each on two common targets that are far apart."""
    there = views.vectors[shared.views]
    b = shared.least(-_flat_lengths(there - there[shared.starts][shared.pairs]))
    a = shared.least(-_flat_lengths(there - there[b][shared.pairs]))
    both = np.stack((a, b), axis=1)
    return _free_stations(sights, views, shared.views[both], shared.sights[both])


def _free_stations(sights: Sights, views: Views, seen: IntRows, of_others: IntRows) -> _Part:
    """Free stations on two targets, where these are as far apart as both stations see them."""
    there, own = views.vectors[seen], sights.vectors[of_others]
    (base, azimuth), (own_base, own_azimuth) = _base(there), _base(own)
    sigmas = np.concatenate((views.sigmas[seen], sights.vector_sigmas[of_others]), axis=1)
    relative_sigmas = lengths(sigmas.T)
    ends = there - _turned(own, azimuth - own_azimuth)
    positions = ends.mean(axis=1)
    azimuth_sigmas = relative_sigmas / np.where(base > 0.0, base, np.nan)
    moved = azimuth_sigmas * _flat_lengths(positions - there.mean(axis=1))
    alike = np.abs(base - own_base) <= 0.02 * base + 5.0 * relative_sigmas
    found = _Part(seen, of_others, positions, np.hypot(relative_sigmas, moved), azimuth_sigmas)
    return found.chosen((base > 0.0) & (own_base > 0.0) & alike)


def _base(ends: FloatRows) -> tuple[FloatArray, FloatArray]:
    """(k,) horizontal lengths and azimuths from the first to the second of two vectors (k, 2, 3)."""
    east, north = (ends[:, 1] - ends[:, 0])[:, :2].T
    return np.hypot(east, north), np.arctan2(east, north)


def _turned(vectors: FloatRows, angles: FloatArray) -> FloatRows:
    """Vectors (k, 2, 3) of plumb instruments turned clockwise by angles (k,)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return np.stack((x * cosine + y * sine, y * cosine - x * sine, z), axis=-1)


def _flat_lengths(vectors: FloatRows) -> FloatArray:
    """(k,) horizontal lengths of vectors (k, 3)."""
    return lengths(vectors[:, :2].T)


class PlumbWays:
    """Ways from stations whose instruments are plumb, computed for many of them when one needs its own."""

    def __init__(self, graph: SightGraph) -> None:
        self._graph = graph
        self._ways: dict[int, Ways] = {}

    @cached_property
    def _blocks(self) -> list[int]:
        """The block that each station belongs to."""
        graph = self._graph
        if len(graph.sights) * _MOST_STATIONS < _BLOCK:
            return [0] * len(graph.origins)
        seen_by = np.minimum(list(map(len, graph.sights_to)), _MOST_STATIONS)
        sizes = np.bincount(graph.sights.stations, seen_by[graph.sights.targets], len(graph.origins))
        blocks: list[int] = (np.cumsum(sizes) // _BLOCK).astype(np.int64).tolist()
        return blocks

    def of(self, station: int) -> Ways:
        """Ways from a station and from others near it."""
        block = self._blocks[station]
        ways = self._ways.get(block)
        if ways is None:
            first, end = bisect_left(self._blocks, block), bisect_right(self._blocks, block)
            ways = self._ways[block] = find_ways(self._graph, Views.of(self._graph, range(first, end)))
        return ways
