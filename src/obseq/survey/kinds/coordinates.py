"""Coordinates of a point as observations, along the axes of the frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site


@dataclass(frozen=True)
class Coordinate(ObservationKind):
    """One coordinate of a point, which is both its first and its last point.

    Attributes:
        axis: 0, 1 or 2.
    """

    axis: int = 0

    def is_linear(self, site: Site) -> bool:
        """It is an unknown itself."""
        return True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The point."""
        return {"point": site.ends(rows)[0]}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Coefficients of the point: its axis."""
        return np.tile(np.eye(3)[self.axis], (len(rows), 1))


def _along(axis: int) -> Coordinate:
    name = "xyz"[axis]
    return Coordinate(
        f"P{name}",
        141 + axis,
        f"coordinate {name} of a point",
        "TopoSubFrame",
        family="Coordinates",
        is_absolute=True,
        takes_heights=False,
        is_line=False,
        axis=axis,
    )


POINT_X, POINT_Y, POINT_Z = map(_along, range(3))
