"""Vectors between two points in geocentric axes, such as GNSS baselines, with their full covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.kind import ObservationKind

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site


@dataclass(frozen=True)
class GeocentricVector(ObservationKind):
    """A vector in geocentric axes: its first component stands for the three."""

    def is_linear(self, site: Site) -> bool:
        """The frame only turns it."""
        return True

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Coefficients of both ends for each component: minus and plus the rotation to geocentric axes."""
        rotation, _ = site.to_geocentric(rows)
        return np.tile(np.hstack([-rotation, rotation]), (len(rows), 1, 1))


@dataclass(frozen=True)
class FollowingComponent(ObservationKind):
    """The second or third component of a vector, whose equation is that of the first."""


VECTOR = GeocentricVector(
    "VX", 107, "geocentric X of a vector", "TopoSubFrame", size=3, takes_heights=False, is_line=False
)
VECTOR_Y = FollowingComponent(
    "VY", 108, "geocentric Y of a vector", "TopoSubFrame", size=0, takes_heights=False, is_line=False
)
VECTOR_Z = FollowingComponent(
    "VZ", 109, "geocentric Z of a vector", "TopoSubFrame", size=0, takes_heights=False, is_line=False
)
