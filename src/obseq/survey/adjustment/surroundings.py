"""Where points are on the Earth: what many equations ask of the same coordinates is worked out once."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


class Surroundings:
    """What a system has at coordinates of points, each thing worked out when it is first asked for.

    Args:
        system: The system of the coordinates, with a place on the Earth.
        coordinates: (n, 3), of which it keeps a copy.
    """

    def __init__(self, system: crs.CoordinateSystem, coordinates: FloatArray) -> None:
        self._system = system
        self._coordinates = coordinates.copy()

    def are_at(self, coordinates: FloatArray) -> bool:
        """Whether they are those of these coordinates (n, 3), to the last bit."""
        return np.array_equal(coordinates, self._coordinates)

    @cached_property
    def geocentric(self) -> FloatArray:
        """(n, 3) geocentric coordinates."""
        return self._system.to_geocentric(self._coordinates)

    @cached_property
    def geodetic(self) -> FloatArray:
        """(n, 3) longitude, latitude (rad), ellipsoidal height (m)."""
        return crs.geodetic_from_geocentric(self.geocentric)

    @cached_property
    def verticals(self) -> FloatArray:
        """(n, 3, 3) rotations to east, north, up, of a Euclidean system."""
        if not isinstance(self._system, crs.RigidSystem):
            return self._system.vertical_rotation(self._coordinates)
        return self._system.verticals_at(self.geodetic)
