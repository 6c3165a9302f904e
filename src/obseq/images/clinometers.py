"""Clinometers that cameras carry: inclinations of their axes, read when an image is taken."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError

if TYPE_CHECKING:
    from obseq.arrays import FloatArray

DEGREES = (0, 1, 2, 3)
STEEPEST = np.radians(85.0)
"""Inclination beyond which the sine of an angle says too little of it."""


@dataclass(frozen=True, eq=False)
class Clinometer:
    """An axis fixed to a camera, whose inclination above the horizon is read.

    The sine of the inclination of the axis is `sum_k correction[k] sin(reading)^k` (MMVII's `Clino_0_3`): a
    perfect instrument has the correction (0, 1, 0, 0).

    Attributes:
        name: of the clinometer.
        axis: (3,) direction in the frame of the camera, of any length.
        correction: (4,) coefficients of degrees 0 to 3.
        free_degrees: of the correction, that are unknowns.
        is_fixed: True when the axis is known exactly.
    """

    name: str
    axis: FloatArray
    correction: tuple[float, ...] = (0.0, 1.0, 0.0, 0.0)
    free_degrees: tuple[int, ...] = ()
    is_fixed: bool = False

    def __post_init__(self) -> None:
        axis = np.array(self.axis, dtype=np.float64)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise InputError(f"clinometer {self.name}: its axis is a direction of three numbers, not {axis}")
        if len(self.correction) != len(DEGREES) or not np.isfinite(self.correction).all():
            raise InputError(f"clinometer {self.name}: the correction has four coefficients, degrees 0 to 3")
        if not set(self.free_degrees) <= set(DEGREES):
            raise InputError(
                f"clinometer {self.name}: free degrees are among 0 to 3, not {self.free_degrees}"
            )
        object.__setattr__(self, "axis", axis / np.linalg.norm(axis))


@dataclass(frozen=True, eq=False)
class Inclinations:
    """Readings of a clinometer.

    Attributes:
        clinometer: its name.
        images: (n,) images that were taken at the same time by the camera that carries it.
        angles: (n,) radians, positive where the axis points above the horizon.
        sigmas: (n,) radians.
    """

    clinometer: str
    images: tuple[str, ...]
    angles: FloatArray
    sigmas: FloatArray

    def __post_init__(self) -> None:
        n = len(self.images)
        for name in ("angles", "sigmas"):
            given = np.broadcast_to(np.asarray(getattr(self, name), dtype=np.float64), (n,))
            object.__setattr__(self, name, np.array(given))
        if not np.isfinite(self.angles).all() or not ((self.sigmas > 0.0) & np.isfinite(self.sigmas)).all():
            raise InputError(f"clinometer {self.clinometer}: readings must be finite, and sigmas positive")
        steep = np.flatnonzero(np.abs(self.angles) > STEEPEST)
        if steep.size:
            raise InputError(
                f"clinometer {self.clinometer}, image {self.images[steep[0]]}: an inclination of "
                f"{np.degrees(self.angles[steep[0]]):g} degrees; its equation is one of sines, and says "
                "nothing near the vertical (angles are in radians here)"
            )
