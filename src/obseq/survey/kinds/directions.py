"""What is read on an instrument as an angle: directions, azimuths, zenith angles."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Start

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site


@dataclass(frozen=True)
class ZenithAngle(ObservationKind):
    """A zenith angle, corrected for refraction."""

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

    @property
    def is_refracted(self) -> bool:
        """It is."""
        return True

    @property
    def depends_on_place(self) -> bool:
        """Refraction grows with the distance."""
        return True


@dataclass(frozen=True)
class HorizontalAngle(ObservationKind):
    """An angle at the first point, clockwise from the backsight to the last point."""

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The three points."""
        stations, targets = site.ends(rows)
        return {"station": stations, "backsight": site.backsights(rows), "target": targets}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """East, north and up at the first point."""
        return site.verticals(rows, coordinates).reshape(-1, 9)

    @property
    def depends_on_place(self) -> bool:
        """The vertical does."""
        return True


HZ = ObservationKind(
    "Hz",
    5,
    "horizontal direction, clockwise",
    "TopoHz",
    is_angle=True,
    needs_station=True,
    orients=1,
    start=Start.HZ,
    is_of_circle=True,
)
AZIM = ObservationKind(
    "Azim",
    8,
    "azimuth from geographic north, clockwise",
    "TopoHz",
    is_angle=True,
    needs_station=True,
    orients=1,
    start=Start.HZ,
    is_from_north=True,
)
ANGLE = HorizontalAngle(
    "Angle",
    111,
    "horizontal angle from a backsight, clockwise",
    "TopoAngle",
    is_angle=True,
    start=Start.ANGLE,
    is_plumb=True,
    takes_heights=False,
    is_line=False,
)
ZEN = ZenithAngle("Zen", 6, "zenith angle", "TopoZen", is_angle=True, needs_station=True, start=Start.ZENITH)
