"""Directions and lengths at the coordinates of stations, for what changes hardly with them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.formats.snap.lines import Sight
from obseq.formats.snap.stations import Mark
from obseq.formats.snap.systems import System
from obseq.survey.kinds.geodetic import curvatures


class Places:
    """Directions and lengths at the coordinates of the stations, for what changes hardly with them."""

    def __init__(self, marks: dict[str, Mark], system: System) -> None:
        self._marks, self._system = marks, crs.parse(system.definition)

    def _geocentric(self, names: Sequence[str]) -> FloatArray:
        return self._system.to_geocentric(np.array([self._marks[name].geodetic for name in names]))

    def axes(self, sights: Sequence[Sight]) -> FloatArray:
        """(3, 3) east, north and up, in columns, in the middle of the stations of a set."""
        named = dict.fromkeys(name for sight in sights for name in sight.ends)
        names = [name for name in named if name in self._marks]
        if not names:  # of stations that are left out
            return np.eye(3)
        places = np.radians([self._marks[name].geodetic[:2] for name in names])
        up = np.mean([crs.east_north_up(*place)[:, 2] for place in places], axis=0)
        longitude, latitude = math.atan2(up[1], up[0]), math.atan2(up[2], math.hypot(up[0], up[1]))
        return np.asarray(crs.east_north_up(longitude, latitude))

    def _local(self, sight: Sight) -> FloatArray:
        """(3,) the sight to east, north and up of its first station."""
        first, last = self._geocentric(sight.ends)
        longitude, latitude = np.radians(self._marks[sight.ends[0]].geodetic[:2])
        return np.asarray((last - first) @ crs.east_north_up(longitude, latitude))

    def lengths(self, sight: Sight) -> tuple[float, float]:
        """Horizontal and slope distance, m."""
        east, north, up = self._local(sight)
        return max(math.hypot(east, north), 1e-3), max(math.hypot(east, north, up), 1e-3)

    def chord(self, sight: Sight) -> float:
        """A distance at the mean height of its ends, or an arc on the geoid, as a chord on the ellipsoid."""
        marks = [self._marks[name] for name in sight.ends]
        (value,) = sight.values
        if sight.code == "HD":
            height = sum(mark.geodetic[2] for mark in marks) / 2.0 + sum(sight.heights) / 2.0
        else:
            height = sum(mark.geoid[0] for mark in marks) / 2.0
            latitude = np.radians([marks[0].geodetic[1]])
            twice = 2.0 * (math.sqrt(math.prod(curvatures(latitude)[0])) + height)
            value = twice * math.sin(value / twice)
        feet = [np.array([[*mark.geodetic[:2], level]]) for level in (0.0, height) for mark in marks]
        low, high, low_raised, high_raised = (self._system.to_geocentric(foot) for foot in feet)
        raised = float(np.linalg.norm(high_raised - low_raised))
        return value * float(np.linalg.norm(high - low)) / raised if raised > 0.0 else value

    def convergence(self, sight: Sight, projection: System) -> float:
        """Azimuth less bearing in the grid, rad."""
        east, north, _ = self._local(sight)
        places = np.array([self._marks[name].geodetic for name in sight.ends])
        rise = np.diff(projection.grid(places), axis=0)[0]
        return math.remainder(math.atan2(east, north) - math.atan2(rise[0], rise[1]), 2.0 * math.pi)
