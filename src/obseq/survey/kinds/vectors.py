"""Vectors between two points, along geocentric axes (GNSS baselines) or along those of the frame."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import FirstPlace, ObservationKind, Site


@dataclass(frozen=True)
class VectorComponent(ObservationKind):
    """One component of a vector; components are correlated by clusters.

    Attributes:
        axis: 0, 1 or 2.
    """

    axis: int = 0
    is_component: bool = True
    is_raised: bool = True

    def direction(self, site: Site, rows: IntArray) -> FloatArray:
        """(3,) its axis, in the frame."""
        return np.asarray(np.eye(3)[self.axis])

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Coefficients of both ends: minus and plus the axis."""
        axis = self.direction(site, rows)
        return np.tile(np.hstack([-axis, axis]), (len(rows), 1))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Between the points themselves: without heights of instrument and target."""
        return np.asarray(site.measured(rows) - site.offsets(rows, coordinates) @ self.direction(site, rows))


@dataclass(frozen=True)
class GeocentricComponent(VectorComponent):
    """One component of a vector along geocentric axes."""

    def direction(self, site: Site, rows: IntArray) -> FloatArray:
        """(3,) the geocentric axis, in the frame."""
        rotation, _ = site.to_geocentric(rows)
        return np.asarray(rotation[self.axis])


VECTOR, VECTOR_Y, VECTOR_Z = (
    GeocentricComponent(
        f"V{name}",
        107 + axis,
        f"geocentric {name} of a vector",
        first_place=FirstPlace.VECTOR,
        family="Vector",
        axis=axis,
    )
    for axis, name in enumerate("XYZ")
)
LOCAL_X, LOCAL_Y, LOCAL_Z = (
    VectorComponent(
        f"L{name}",
        131 + axis,
        f"{name.lower()} of a vector, along the axes of the frame",
        first_place=FirstPlace.LOCAL_VECTOR,
        family="LocalVector",
        axis=axis,
    )
    for axis, name in enumerate("XYZ")
)
