"""Linear rows of coordinates: single ones, barycentres, combinations of the coordinates of many points."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import FirstPlace, ObservationKind, Site


@dataclass(frozen=True)
class Coordinate(ObservationKind):
    """One coordinate of a point, which is both its first and its last point.

    Attributes:
        axis: 0, 1 or 2.
    """

    axis: int = 0

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The point."""
        return {"point": site.ends(rows)[0]}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """Coefficients of the point: its axis."""
        return np.tile(np.eye(3)[self.axis], (len(rows), 1))


@dataclass(frozen=True)
class BarycentreComponent(ObservationKind):
    """One coordinate of a point minus the mean of those of the members of its group.

    Attributes:
        axis: 0, 1 or 2, of the frame.
    """

    axis: int = 0

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The barycentre, and the members."""
        members, _ = site.members(rows)
        listed = {f"member {k + 1}": column for k, column in enumerate(members.T)}
        return {"barycentre": site.ends(rows)[0], **listed}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3 + 3 k) 1 for the barycentre, minus its share for each member, along the axis."""
        _, shares = site.members(rows)
        weights = np.hstack([np.ones((len(rows), 1)), -shares])
        return np.asarray(np.einsum("nk,i->nki", weights, np.eye(3)[self.axis]).reshape(len(rows), -1))


@dataclass(frozen=True)
class NormalRow(ObservationKind):
    """A combination of the geocentric coordinates of the members of its group (m), with unit coefficients.

    The eigenvectors of normal equations are such rows, with sigmas of one over the roots of the
    eigenvalues: what the equations leave free, no row holds.
    """

    def blocks(self, site: Site, rows: IntArray) -> dict[str, IntArray]:
        """The members."""
        members, _ = site.combinations(rows)
        return {f"member {k + 1}": column for k, column in enumerate(members.T)}

    def context(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, 3 k) coefficients, along the axes of the frame."""
        members, geocentric = site.combinations(rows)
        rotation, _ = site.to_geocentric(rows)
        return np.asarray((geocentric @ rotation).reshape(len(members), -1))

    def values(self, site: Site, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """From the origin of the frame on."""
        _, translation = site.to_geocentric(rows)
        _, geocentric = site.combinations(rows)
        return np.asarray(site.measured(rows) - (geocentric @ translation).sum(axis=1))


POINT_X, POINT_Y, POINT_Z = (
    Coordinate(
        f"P{name}",
        141 + axis,
        f"coordinate {name} of a point",
        family="Coordinates",
        is_absolute=True,
        axis=axis,
    )
    for axis, name in enumerate("xyz")
)
BARY_X, BARY_Y, BARY_Z = (
    BarycentreComponent(
        f"Bary{name}",
        191 + axis,
        f"{name.lower()} of a barycentre",
        first_place=FirstPlace.BARYCENTRE,
        family="Barycentre",
        axis=axis,
    )
    for axis, name in enumerate("XYZ")
)
NORMAL_ROW = NormalRow("Normal", 194, "row of normal equations")
