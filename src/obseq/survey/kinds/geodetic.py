"""What is observed of a place on the ellipsoid: height, latitude, longitude, geocentric coordinates, chords.

Their equations are linear rows that are made anew wherever the points go.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.crs.refraction import EQUATORIAL_RADIUS, SQUARED_ECCENTRICITY
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import FirstPlace, ObservationKind, Site


def curvatures(
    latitude: FloatArray, radius: float = EQUATORIAL_RADIUS, squared: float = SQUARED_ECCENTRICITY
) -> FloatArray:
    """(n, 2) radii of curvature along the parallel and along the meridian, at latitudes (n,)."""
    inside = 1.0 - squared * np.square(np.sin(latitude))
    parallel = radius / np.sqrt(inside)
    return np.column_stack([parallel, parallel * (1.0 - squared) / inside])


@dataclass(frozen=True)
class OfPlace(ObservationKind):
    """Something observed of one point, which stands at both ends of the observation."""

    is_absolute: bool = True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The point."""
        return {"point": site.ends(rows)[1]}


@dataclass(frozen=True)
class GeocentricCoordinate(OfPlace):
    """A geocentric coordinate of a point, from GNSS or another adjustment.

    Attributes:
        axis: 0, 1 or 2.
    """

    axis: int = 0
    is_component: bool = True
    is_raised: bool = True

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The geocentric axis, in the frame."""
        return np.tile(site.to_geocentric(rows)[0][self.axis], (len(rows), 1))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Of the mark, without the height of the antenna, from the origin of the frame on."""
        rotation, translation = site.to_geocentric(rows)
        raised = site.offsets(rows, coordinates) @ rotation[self.axis]
        return np.asarray(site.measured(rows) - translation[self.axis] - raised)


@dataclass(frozen=True)
class Geodetic(OfPlace):
    """Ellipsoidal height, latitude or longitude of a point.

    Attributes:
        axis: 0 longitude, 1 latitude, 2 height.
    """

    axis: int = 2
    depends_on_place: bool = True

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """East, north or up there, over the radius of its circle."""
        place = site.geodetic(rows, coordinates)
        axes = site.normals(rows, coordinates)[:, self.axis]
        if self.axis == 2:
            return axes
        radii = curvatures(place[:, 1], *site.to_ground(rows)[-2:])[:, self.axis] + place[:, 2]
        if self.axis == 0:
            radii = radii * np.cos(place[:, 1])
        return np.asarray(axes / radii[:, None])

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """What makes the row that of the tangent there."""
        gap = site.measured(rows) - self._found(site, rows, coordinates)
        if self.axis == 0:
            gap = np.remainder(gap + np.pi, 2.0 * np.pi) - np.pi
        _, here = site.positions(rows, coordinates)
        along = self.context(site, rows, coordinates)
        raised = np.einsum("ni,ni->n", along, site.offsets(rows, coordinates))
        return np.asarray(gap - raised + np.einsum("ni,ni->n", along, here))

    def _found(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        if self.axis == 2:
            return site.heights(rows, coordinates)
        return site.geodetic(rows, coordinates)[:, self.axis]


@dataclass(frozen=True)
class EllipsoidChord(ObservationKind):
    """The straight distance between the feet of two points on the ellipsoid."""

    depends_on_place: bool = True

    def problem(self, value: float) -> str | None:
        """Distances are positive."""
        return None if value > 0.0 else "is not positive"

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """How far the feet come along the chord with their points."""
        _, sight, both = self._chords(site, rows, coordinates)
        return _columns(sight, both)

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """What makes the row that of the tangent there."""
        length, sight, both = self._chords(site, rows, coordinates)
        ends = np.hstack(site.positions(rows, coordinates))
        here = np.einsum("ni,ni->n", _columns(sight, both), ends)
        return np.asarray(site.measured(rows) - length + here)

    @staticmethod
    def _chords(
        site: Site, rows: IntArray, coordinates: FloatArray
    ) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
        """(n,) lengths, (n, 3) directions, and for each end (n, 3, 3) movement of the foot with the point."""
        feet, moves = [], []
        for place, axes, point in site.places(rows, coordinates):
            radii = curvatures(place[:, 1], *site.to_ground(rows)[-2:])
            shares = np.column_stack([radii / (radii + place[:, 2:]), np.zeros(len(rows))])
            moves.append(np.einsum("nki,nk,nkj->nij", axes, shares, axes))
            feet.append(point - place[:, 2:] * axes[:, 2])
        sight = feet[1] - feet[0]
        length = np.linalg.norm(sight, axis=1)
        return length, sight / np.maximum(length, 1e-9)[:, None], moves


def _columns(sight: FloatArray, moves: list[FloatArray]) -> FloatArray:
    """(n, 6) coefficients of both ends."""
    first, last = (np.einsum("ni,nij->nj", sight, move) for move in moves)
    return np.hstack([-first, last])


GEO_X, GEO_Y, GEO_Z = (
    GeocentricCoordinate(
        f"Geo{name}",
        117 + axis,
        f"geocentric {name} of a point",
        first_place=FirstPlace.POSITION,
        family="Position",
        axis=axis,
    )
    for axis, name in enumerate("XYZ")
)
HEIGHT = Geodetic("Height", 151, "height of a point above the ellipsoid")
LATITUDE = Geodetic("Lat", 152, "latitude of a point", is_angle=True, axis=1)
LONGITUDE = Geodetic("Lon", 153, "longitude of a point", is_angle=True, axis=0)
CHORD = EllipsoidChord("Chord", 154, "straight distance between feet on the ellipsoid")
