"""What is read on an instrument as an angle: directions, azimuths, zenith angles."""

from __future__ import annotations

import math

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Site, Start


@dataclass(frozen=True)
class InstrumentAngle(ObservationKind):
    """An angle that is read on an instrument."""

    is_angle: bool = True
    needs_station: bool = True
    takes_heights: bool = True


@dataclass(frozen=True)
class ZenithAngle(InstrumentAngle):
    """A zenith angle, corrected for refraction, which grows with the distance."""

    is_refracted: bool = True
    depends_on_place: bool = True

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """Folded into [0, pi]: the same directions above the horizon."""
        return np.asarray(np.abs(values - 2.0 * math.pi * np.round(values / (2.0 * math.pi))))

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """The refraction."""
        return site.refraction(rows, coordinates)[:, None]

    def slopes(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Of the refraction."""
        coefficient = site.refraction_coefficient - site.is_plane
        return -coefficient * site.slopes_of_refraction(rows, coordinates)


@dataclass(frozen=True)
class HorizontalAngle(ObservationKind):
    """An angle at the first point, clockwise from the backsight to the last point."""

    depends_on_place: bool = True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The three points."""
        stations, targets = site.ends(rows)
        return {"station": stations, "backsight": site.backsights(rows), "target": targets}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """East, north and up at the first point."""
        return site.verticals(rows, coordinates).reshape(-1, 9)


@dataclass(frozen=True)
class PolarAngle(InstrumentAngle):
    """An angle of a sub-frame, counted as a mathematician does: its complement to a right angle is read."""

    def start_values(
        self, values: FloatArray, from_heights: FloatArray, to_heights: FloatArray
    ) -> FloatArray:
        """The directions, or the zenith angles."""
        return np.asarray(math.pi / 2.0 - values)


HZ = InstrumentAngle(
    "Hz",
    5,
    "horizontal direction, clockwise",
    "TopoHz",
    orients=1,
    start=Start.HZ,
    is_of_circle=True,
    is_line=True,
)
AZIM = InstrumentAngle(
    "Azim",
    8,
    "azimuth from geographic north, clockwise",
    "TopoHz",
    orients=1,
    start=Start.HZ,
    is_from_north=True,
    is_line=True,
)
ANGLE = HorizontalAngle(
    "Angle",
    111,
    "horizontal angle from a backsight, clockwise",
    "TopoAngle",
    is_angle=True,
    start=Start.ANGLE,
    is_plumb=True,
)
ZEN = ZenithAngle("Zen", 6, "zenith angle", "TopoZen", start=Start.ZENITH, is_line=True)
ALPHA = PolarAngle(
    "Alpha",
    121,
    "angle from the first axis of a sub-frame, counter-clockwise",
    "TopoAlpha",
    orients=1,
    start=Start.HZ,
)
BETA = PolarAngle(
    "Beta",
    122,
    "elevation above the first two axes of a sub-frame",
    "TopoBeta",
    start=Start.ZENITH,
)
