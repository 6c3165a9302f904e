"""Polar coordinates in a sub-frame: as a mathematician counts them, not as an instrument does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Start

if TYPE_CHECKING:
    from obseq.arrays import FloatArray

QUARTER = math.pi / 2.0


@dataclass(frozen=True)
class PolarAngle(ObservationKind):
    """An angle whose complement to a right angle is a direction or a zenith angle of the same axes."""

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """The directions, or the zenith angles."""
        return np.asarray(QUARTER - values)


ALPHA = PolarAngle(
    "Alpha",
    121,
    "angle from the first axis of a sub-frame, counter-clockwise",
    "TopoAlpha",
    is_angle=True,
    needs_station=True,
    orients=1,
    start=Start.HZ,
    is_line=False,
)
BETA = PolarAngle(
    "Beta",
    122,
    "elevation above the first two axes of a sub-frame",
    "TopoBeta",
    is_angle=True,
    needs_station=True,
    start=Start.ZENITH,
    is_line=False,
)
