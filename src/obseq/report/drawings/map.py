"""The coordinates in which a plan is drawn: those of the map of the points, or of the computation frame.

Axes, grid and north of a plan are then those that its reader knows. What is computed in the frame (ellipses,
displacements, directions) is turned by the similarity that leads from one to the other.
"""

from __future__ import annotations

import cmath

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord

MOST = 0.01
"""Share of the extent by which the places may differ after the similarity: maps do by far less, other systems
(geocentric ones, axes to the south) by far more."""


@dataclass(frozen=True)
class Similarity:
    """From the frame to the map, as complex numbers: factor and shift.

    Attributes:
        factor: Its argument turns, counter-clockwise.
        shift: Added after that.
        is_map: Whether places are those of the map.
    """

    factor: complex = 1.0 + 0.0j
    shift: complex = 0.0j
    is_map: bool = False

    def place(self, x: float, y: float) -> tuple[float, float]:
        """A place of the frame, in the map."""
        found = self.factor * complex(x, y) + self.shift
        return found.real, found.imag

    def turned(self, x: float, y: float) -> tuple[float, float]:
        """A vector of the frame, along the axes of the map."""
        found = self.factor / abs(self.factor) * complex(x, y)
        return found.real, found.imag

    def bearing(self, bearing: float) -> float:
        """A bearing of the frame (rad, clockwise from y), in the map."""
        return bearing - cmath.phase(self.factor)


def similarity(record: AdjustmentRecord) -> Similarity:
    """The similarity to the map of the points; to the frame itself where they are in no map in metres."""
    is_other = record.points_crs != record.frame and not record.points_crs_is_angular
    pairs = [
        (complex(*point.plan), complex(point.crs_x, point.crs_y))
        for point in record.points
        if point.plan and point.crs_x is not None and point.crs_y is not None
    ]
    if not is_other or record.points_crs_unit not in (None, "m") or len(pairs) < 2:
        return Similarity()
    frame, given = (sum(pair[k] for pair in pairs) / len(pairs) for k in (0, 1))
    arms = [(one - frame, other - given) for one, other in pairs]
    size = sum(abs(one) ** 2 for one, _ in arms)
    factor = sum(one.conjugate() * other for one, other in arms) / (size or 1.0)
    off = sum(abs(factor * one - other) ** 2 for one, other in arms)
    if not factor or off > MOST**2 * size:
        return Similarity()
    return Similarity(factor, given - factor * frame, True)
