"""Distances and height differences: two points, no instrument axes."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Site, Start


@dataclass(frozen=True)
class Distance(ObservationKind):
    """A distance: positive."""

    def problem(self, value: float) -> str | None:
        """Distances are positive."""
        return None if value > 0.0 else "is not positive"


@dataclass(frozen=True)
class ReducedDistance(Distance):
    """A horizontal distance on the sphere that stands for height 0; in a plane, the plane distance."""

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Centre and radius of the sphere."""
        centre, radius = site.sphere(rows)
        return np.tile((*centre, radius), (len(rows), 1))


@dataclass(frozen=True)
class HorizontalDistance(Distance):
    """A horizontal distance in the horizon of its first point."""

    depends_on_place: bool = True

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The upward vertical of the first point."""
        return site.verticals(rows, coordinates)[:, 2]


@dataclass(frozen=True)
class HeightDifference(ObservationKind):
    """A height difference: along the vertical of the ellipsoid, or of z in a plane frame."""

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """Between the points, not between instrument and target."""
        return np.asarray(values + from_heights - to_heights)

    def is_linear(self, site: Site) -> bool:
        """In a plane it is a difference of z."""
        return site.is_plane

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """R and T to the axes of the ellipsoid, and its shape; in a plane the coefficients of z."""
        if site.is_plane:
            return np.tile((0.0, 0.0, -1.0, 0.0, 0.0, 1.0), (len(rows), 1))
        return np.tile(site.to_ground(rows), (len(rows), 1))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Between the points, along the vertical of the frame."""
        return site.levelled(rows, coordinates)

    def slopes(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """Of the deflections along the line."""
        slopes = site.slopes_of_levelled(rows, coordinates)
        return None if slopes is None else -slopes


DH = HeightDifference(
    "DH",
    4,
    "height of the target above the origin",
    "TopoDH",
    start=Start.RISE,
    is_line=True,
    is_levelled=True,
    needs_deflections=True,
)
DIST_HZ0 = ReducedDistance(
    "DistHz0", 2, "horizontal distance at height 0", "TopoDistHz0", start=Start.FLAT, is_line=True
)
DIST_HZ = HorizontalDistance(
    "DistHz",
    101,
    "horizontal distance",
    "TopoDistHz",
    start=Start.FLAT,
    is_plumb=True,
    takes_heights=True,
    is_line=True,
)
DIST = Distance(
    "Dist",
    3,
    "slope distance",
    "TopoDist",
    start=Start.DISTANCE,
    horizontal=DIST_HZ,
    takes_heights=True,
    is_line=True,
)
