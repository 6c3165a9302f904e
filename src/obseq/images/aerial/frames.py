"""Euclidean frames of aerial work: rays are straight there, and coordinates look like those of the map.

A frame is attached to a map point, its centre. The local frame is tangent to the ellipsoid at the centre,
with axes along the grid of the map, shifted by the map coordinates of the centre: exact. The approximate
frame takes the Earth for a sphere and the map for a stereographic plane: for shots whose z carries the
linear alteration. Both hold many centres at once: one per row, or one for all rows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.aerial.mapping import MapSystem


EARTH_RADIUS = 6_366_000.0
"""Radius of the sphere of the approximate frame, metres (IGN's)."""


class Frames(Protocol):
    """Euclidean frames with one centre per row, or one for all."""

    def to_euclidean(self, points: FloatArray) -> FloatArray:
        """Euclidean coordinates (n, 3) of map points (n, 3)."""

    def to_map(self, points: FloatArray) -> FloatArray:
        """Map points (n, 3) of Euclidean coordinates (n, 3)."""

    def to_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """Rotations (n, 3, 3) from the frame to the image, of rotations from the map at points (n, 2)."""

    def from_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """The inverse of `to_frame`."""


@dataclass(frozen=True)
class LocalFrames:
    """Frames tangent to the ellipsoid, axes along the grid; z is the height above the tangent plane.

    Attributes:
        system: the map.
        centres: (n, 2) or (1, 2) map coordinates.
    """

    system: MapSystem
    centres: FloatArray

    @cached_property
    def _geodetic(self) -> FloatArray:
        return self.system.geodetic(self.centres)

    @cached_property
    def axes(self) -> FloatArray:
        """(n, 3, 3) rotations from geocentric vectors to the frames."""
        return self.system.axes(self.centres, self._geodetic)

    @cached_property
    def origins(self) -> FloatArray:
        """(n, 3) geocentric coordinates of the centres, on the ellipsoid."""
        return self.system.ellipsoid.geocentric(self._geodetic, np.zeros(len(self.centres)))

    @cached_property
    def _offsets(self) -> FloatArray:
        return np.concatenate([self.centres, np.zeros((len(self.centres), 1))], axis=1)

    def to_euclidean(self, points: FloatArray) -> FloatArray:
        """Euclidean coordinates (n, 3) of map points (n, 3) with ellipsoidal heights."""
        return turned(self.axes, self.system.geocentric(points) - self.origins) + self._offsets

    def to_map(self, points: FloatArray) -> FloatArray:
        """Map points (n, 3) with ellipsoidal heights of Euclidean coordinates (n, 3)."""
        moved = turned(np.swapaxes(self.axes, -1, -2), points - self._offsets) + self.origins
        return self.system.from_geocentric(moved)

    def to_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """Rotations (n, 3, 3) from the frame to the image; verticals and convergences of both are used."""
        return matrices @ self.system.axes(plan) @ np.swapaxes(self.axes, -1, -2)

    def from_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """Rotations (n, 3, 3) from the map at points (n, 2) to the image."""
        return matrices @ self.axes @ np.swapaxes(self.system.axes(plan), -1, -2)


@dataclass(frozen=True)
class ApproximateFrames:
    """Frames on a sphere with the map as stereographic plane; rotations stay as they are.

    Attributes:
        centres: (n, 2) or (1, 2) map coordinates.
    """

    centres: FloatArray

    def to_euclidean(self, points: FloatArray) -> FloatArray:
        """Euclidean coordinates (n, 3) of map points (n, 3)."""
        plan, z = points[:, :2] - self.centres, points[:, 2]
        depth = (plan**2).sum(axis=1) / (4.0 * EARTH_RADIUS)
        scale = (EARTH_RADIUS + z) / (EARTH_RADIUS + depth)
        up = (EARTH_RADIUS - depth) * scale - EARTH_RADIUS
        return np.concatenate([plan * scale[:, None], up[:, None]], axis=1)

    def to_map(self, points: FloatArray) -> FloatArray:
        """Map points (n, 3) of Euclidean coordinates (n, 3)."""
        plan, up = points[:, :2], EARTH_RADIUS + points[:, 2]
        radius = np.sqrt((plan**2).sum(axis=1) + up**2)
        scale = 2.0 * EARTH_RADIUS / (up + radius)
        return np.concatenate(
            [self.centres + plan * scale[:, None], (radius - EARTH_RADIUS)[:, None]], axis=1
        )

    def to_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """The rotations themselves."""
        del plan
        return matrices

    def from_frame(self, matrices: FloatArray, plan: FloatArray) -> FloatArray:
        """The rotations themselves."""
        del plan
        return matrices


def turned(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Each vector (n, 3) turned by its rotation (n, 3, 3), or all by one (1, 3, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", np.broadcast_to(matrices, (len(vectors), 3, 3)), vectors))
