"""Height differences, or distances, that are equal without being known."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind, Shared, Site
from obseq.survey.kinds.lengths import DH


@dataclass(frozen=True)
class EqualHeightDifferences(ObservationKind):
    """Height differences of one unknown value, `rise`."""

    def is_linear(self, site: Site) -> bool:
        """In a plane they are differences of z."""
        return site.is_plane

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The unknown value, and both ends."""
        origins, targets = site.ends(rows)
        return {"rise": site.shared(rows, "rise"), "origin": origins, "target": targets}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """What `DH` takes; in a plane the coefficients of the unknown and of z.

        Level surfaces slope by deflections along the line: the target is as much higher.
        """
        context = DH.context(site, rows, coordinates)
        if site.is_plane:
            return np.hstack([np.full((len(rows), 1), -1.0), context])
        up = site.normals(rows, coordinates)[:, 2]
        return np.hstack([-site.levelled(rows, coordinates)[:, None] * up, context])

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Its formula takes no value; linear rows take 0."""
        return np.zeros((len(rows), int(site.is_plane)))

    def slopes(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray | None:
        """Of the deflections along the line."""
        return DH.slopes(site, rows, coordinates)

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """The value, from the first pair."""
        first, last = site.positions(rows[:1], coordinates)
        return {"rise": Shared(float(last[0, 2] - first[0, 2]))}


@dataclass(frozen=True)
class EqualDistances(ObservationKind):
    """Distances of one unknown value, `distance`."""

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The unknown value, and both ends."""
        origins, targets = site.ends(rows)
        return {"distance": site.shared(rows, "distance"), "p1": origins, "p2": targets}

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Its formula takes no value."""
        return np.zeros((len(rows), 0))

    def shared_unknowns(self, site: Site, rows: IntArray, coordinates: FloatArray) -> dict[str, Shared]:
        """The value, from the first pair."""
        first, last = site.positions(rows[:1], coordinates)
        return {"distance": Shared(float(np.linalg.norm(last - first)))}


EQUAL_DH = EqualHeightDifferences(
    "EqualDH",
    21,
    "equal height difference",
    "TopoDHParamOff",
    is_levelled=True,
    needs_deflections=True,
)
EQUAL_DIST = EqualDistances("EqualDist", 22, "equal distance", "Dist3DParam")
