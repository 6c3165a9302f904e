"""Sensors given by rational polynomials: rays and projection in geocentric WGS 84 coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.images.aerial.ellipsoid import WGS84

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.aerial.rpc import Rpc

STEPS = 20
SMALL = 1e-5
"""Degrees of the difference that gives the derivative of the projection."""
ARRIVED = 1e-9
"""Pixels."""
ABOVE = 10.0
"""How far above its range of heights a ray begins, in lengths of that range: no ground is above it."""


@dataclass(frozen=True)
class RationalSensor:
    """An image with rational polynomial coefficients.

    Attributes:
        rpc: from longitude, latitude, height to line and sample.
    """

    rpc: Rpc

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A point high above the ground (n, 3), and unit directions (n, 3) down to it."""
        middle, half = self.rpc.offsets["HEIGHT"], self.rpc.scales["HEIGHT"]
        high, low = self._at(pixels, middle + half), self._at(pixels, middle - half)
        way = low - high
        return high - ABOVE * way, way / np.sqrt((way**2).sum(axis=1, keepdims=True))

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2), column and line, of geocentric points (n, 3)."""
        geodetic, heights = WGS84.geodetic(points)
        return self.rpc.project(np.column_stack([np.rad2deg(geodetic), heights]))

    def ground(self, pixels: FloatArray, heights: FloatArray) -> FloatArray:
        """Longitude and latitude (n, 2), degrees, of pixels (n, 2) at heights (n,): Newton's iterations."""
        start = [self.rpc.offsets["LONG"], self.rpc.offsets["LAT"]]
        place = np.column_stack([np.broadcast_to(start, pixels.shape), heights])
        for _ in range(STEPS):
            left = pixels - self.rpc.project(place)
            place[:, :2] += np.linalg.solve(self._derivative(place), left[:, :, None])[:, :, 0]
            if not (np.abs(left) > ARRIVED).any():
                break
        return np.ascontiguousarray(place[:, :2])

    def _at(self, pixels: FloatArray, height: float) -> FloatArray:
        heights = np.full(len(pixels), height)
        return WGS84.geocentric(np.deg2rad(self.ground(pixels, heights)), heights)

    def _derivative(self, place: FloatArray) -> FloatArray:
        """(n, 2, 2) of column and line by longitude and latitude."""
        step = SMALL * np.eye(3)[:2]
        columns = [(self.rpc.project(place + s) - self.rpc.project(place - s)) / (2.0 * SMALL) for s in step]
        return np.stack(columns, axis=2)
