"""Polar coordinates in a sub-frame: as a mathematician counts them, not as an instrument does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Start

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site

QUARTER = math.pi / 2.0


@dataclass(frozen=True)
class PolarAngle(ObservationKind):
    """An angle whose complement to a right angle is a direction or a zenith angle of the same axes."""

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """The directions, or the zenith angles."""
        return np.asarray(QUARTER - values)

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The complements."""
        return np.asarray(QUARTER - site.measured(rows))

    def residuals(self, equation: FloatArray) -> FloatArray:
        """The complement grows when the angle shrinks."""
        return -equation


@dataclass(frozen=True)
class Elevation(PolarAngle):
    """An elevation above the plane of the first two axes; no refraction."""

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """A correction of zero."""
        return np.zeros((len(rows), 1))


ALPHA = PolarAngle(
    "Alpha",
    121,
    "angle from the first axis of a sub-frame, counter-clockwise",
    "TopoHz",
    is_angle=True,
    needs_station=True,
    orients=1,
    start=Start.HZ,
    is_line=False,
)
BETA = Elevation(
    "Beta",
    122,
    "elevation above the first two axes of a sub-frame",
    "TopoZen",
    is_angle=True,
    needs_station=True,
    start=Start.ZENITH,
    is_line=False,
)
