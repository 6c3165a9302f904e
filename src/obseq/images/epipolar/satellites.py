"""Sensors of the catalogue: rational polynomials in geocentric WGS 84, and a polynomial on any image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.images.aerial.mapping import WGS84
from obseq.kernels import calculator

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.images.aerial.rpc import Rpc
    from obseq.images.epipolar.sensors import Sensor
    from obseq.kernels import Calculator

STEPS = 20
SMALL = 1e-5
"""Degrees of the difference that gives the derivative of the projection."""
ARRIVED = 1e-9
"""Pixels."""
ABOVE = 10.0
"""How far above its range of heights a ray begins, in lengths of that range: no ground is above it."""
DEGREES = {2: 0, 6: 1, 12: 2, 20: 3}
"""Degree of a correction with so many parameters."""


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


@dataclass(frozen=True)
class CorrectedSensor:
    """A sensor whose image is corrected by a polynomial, MMVII's generic sensor.

    Its image of a point is ``(i + D_x(i, j), j + D_y(i, j))`` of the image (i, j) of the sensor itself, as in
    the observation equation ``Dist_Polyn2D_Degree_D_EqColin``.

    Attributes:
        sensor: the one that is corrected.
        parameters: (2,), (6,), (12,) or (20,) ``x_i_j, y_i_j`` of degree 0 to 3, in its order.
    """

    sensor: Sensor
    parameters: FloatArray

    def __post_init__(self) -> None:
        given = np.asarray(self.parameters, dtype=np.float64)
        if given.shape not in {(size,) for size in DEGREES} or not np.isfinite(given).all():
            raise InputError(
                f"corrected sensor: parameters of shape {given.shape} must be 2, 6, 12 or 20 finite numbers."
            )
        object.__setattr__(self, "parameters", given)

    @cached_property
    def _correction(self) -> Calculator:
        return calculator(f"Dist_Polyn2D_Degree_{DEGREES[len(self.parameters)]}_EqDist")

    def rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A point (n, 3) of each line of sight; its unit direction (n, 3) from the sensor to the scene."""
        return self.sensor.rays(self.uncorrected(pixels))

    def project(self, points: FloatArray) -> FloatArray:
        """Pixels (n, 2) of points (n, 3)."""
        seen = self.sensor.project(points)
        return self._correction.values(seen, self._rows(seen))

    def uncorrected(self, pixels: FloatArray) -> FloatArray:
        """Pixels (n, 2) of the sensor itself, of corrected ones (n, 2): Newton's iterations.

        nan where they do not arrive: a correction that folds the image has no inverse there.
        """
        found = np.array(pixels, dtype=np.float64)
        for _ in range(STEPS):
            values, jacobian = self._correction.values_and_jacobian(found, self._rows(found))
            left = pixels - values
            found += np.linalg.solve(jacobian, left[:, :, None])[:, :, 0]
            if not (np.abs(left) > ARRIVED).any():
                break
        found[~(np.abs(left) <= ARRIVED).all(axis=1)] = np.nan
        return found

    def _rows(self, pixels: FloatArray) -> FloatArray:
        return np.broadcast_to(self.parameters, (len(pixels), len(self.parameters)))
