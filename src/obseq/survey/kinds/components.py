"""Components of the vector to a target, in the axes of an instrument."""

from __future__ import annotations

from obseq.survey.kinds.kind import ObservationKind, Start

DX = ObservationKind(
    "DX", 14, "component to the right", "TopoDX", needs_station=True, orients=-1, start=Start.DX
)
DY = ObservationKind(
    "DY", 15, "component to the front", "TopoDY", needs_station=True, orients=-1, start=Start.DY
)
DZ = ObservationKind("DZ", 16, "component upwards", "TopoDZ", needs_station=True, start=Start.DZ)
