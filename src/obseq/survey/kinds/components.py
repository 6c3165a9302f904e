"""Components of the vector to a target, in the axes of an instrument."""

from __future__ import annotations

from functools import partial

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Shared, Site, Start


@dataclass(frozen=True)
class ScaledComponent(ObservationKind):
    """A component in a frame with a scale of its own: true = read (1 + scale).

    Attributes:
        axis: 0, 1 or 2.
    """

    axis: int = 0
    is_raised: bool = True
    depends_on_place: bool = True

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """Station, target, and the scale of the frame."""
        return super().blocks(site, rows) | {"scale": site.shared(rows, "scale")}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 6) offsets by heights of instrument and target, and the axis."""
        axes = np.tile(np.eye(3)[self.axis], (len(rows), 1))
        return np.hstack([site.offsets(rows, coordinates), axes])

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 1) what was read."""
        return site.measured(rows)[:, None]

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """A frame in metres."""
        return {"scale": Shared(0.0)}


def _scaled(kind: ObservationKind, axis: int) -> ScaledComponent:
    return ScaledComponent(
        f"{kind.name}S",
        171 + axis,
        f"{kind.words}, with unknown scale",
        "TopoScaledFrame",
        needs_station=True,
        orients=kind.orients,
        start=kind.start,
        family="ScaledFrame",
        plain=kind,
        with_unknowns=("frame-scale",),
        axis=axis,
    )


_READ = partial(ObservationKind, needs_station=True, takes_heights=True, is_line=True)

DX = _READ("DX", 14, "component to the right", "TopoDX", orients=-1, start=Start.DX)
DY = _READ("DY", 15, "component to the front", "TopoDY", orients=-1, start=Start.DY)
DZ = _READ("DZ", 16, "component upwards", "TopoDZ", start=Start.DZ)
DX_SCALE, DY_SCALE, DZ_SCALE = (_scaled(kind, axis) for axis, kind in enumerate((DX, DY, DZ)))
