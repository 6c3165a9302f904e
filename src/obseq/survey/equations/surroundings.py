"""Where points are on the Earth: what many equations ask of the same coordinates is worked out once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from obseq import crs
from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.kernels.calculator import calculator

Found = TypeVar("Found")

_MOST, _FEW = 8, 1000
"""Coordinates of which is kept what was found, where they are those of so few points; else the last ones."""

_INNERMOST = 0.99
"""Equatorial radii from the middle of the Earth below which an origin is not on the ground."""


class Recent(Generic[Found]):
    """What was worked out for the last few coordinates: trials come back to the same ones.

    Args:
        work_out: coordinates (n, 3) -> what is wanted; it may keep them.
    """

    def __init__(self, work_out: Callable[[FloatArray], Found]) -> None:
        self._work_out = work_out
        self._kept: dict[bytes, Found] = {}

    def of(self, coordinates: FloatArray) -> Found:
        """What there is at coordinates, to the last bit."""
        key = coordinates.tobytes()
        found = self._kept.pop(key, None)
        if found is None:
            found = self._work_out(coordinates.copy())
            most = _MOST if len(coordinates) <= _FEW else 1
            for oldest in list(self._kept)[: len(self._kept) - most + 1]:
                del self._kept[oldest]
        self._kept[key] = found
        return found


class Surroundings:
    """What a system has at coordinates of points, each thing worked out when it is first asked for.

    Args:
        system: The system of the coordinates, with a place on the Earth.
        coordinates: (n, 3), which do not change.
    """

    def __init__(self, system: crs.CoordinateSystem, coordinates: FloatArray) -> None:
        self._system = system
        self._coordinates = coordinates

    @cached_property
    def geocentric(self) -> FloatArray:
        """(n, 3) geocentric coordinates."""
        return self._system.to_geocentric(self._coordinates)

    @cached_property
    def geodetic(self) -> FloatArray:
        """(n, 3) longitude, latitude (rad), height (m) on the ellipsoid to which heights refer."""
        ground = self._system.ground if isinstance(self._system, crs.RigidSystem) else crs.WGS84
        return ground.geodetic(self.geocentric)

    @cached_property
    def heights(self) -> FloatArray:
        """(n,) heights (m) of `geodetic`; as precise as coordinates where the origin is on the ground.

        They are that of the origin and the difference from there: geocentric ones are rounded to 1e-9 m.
        """
        if not isinstance(self._system, crs.RigidSystem):
            return np.asarray(self.geodetic[:, 2])
        ground, (rotation, translation) = self._system.ground, self._system.ground_pose()
        if np.linalg.norm(translation) < _INNERMOST * ground.equatorial:
            return np.asarray(self.geodetic[:, 2])
        squared = ground.flattening * (2.0 - ground.flattening)
        there = np.hstack([rotation.ravel(), translation, ground.equatorial, squared, 0.0])
        ends = np.hstack([np.zeros_like(self._coordinates), self._coordinates])
        rises = calculator("TopoDH").values(ends, np.tile(there, (len(ends), 1)))[:, 0]
        return np.asarray(Surroundings(self._system, np.zeros((1, 3))).geodetic[0, 2] + rises)

    @cached_property
    def verticals(self) -> FloatArray:
        """(n, 3, 3) rotations to east, north, up, of a Euclidean system."""
        if not isinstance(self._system, crs.RigidSystem):
            return self._system.vertical_rotation(self._coordinates)
        return self._system.verticals_at(self.geodetic)

    @cached_property
    def turns(self) -> FloatArray:
        """(n, 3, 3) what east, north, up turn by when points move, in a Euclidean system (rad per m)."""
        assert isinstance(self._system, crs.RigidSystem)
        return crs.turn_of_vertical(self._system, self._coordinates, self.verticals)
