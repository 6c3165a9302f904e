"""Rows of the normal equations of another adjustment: combinations of the coordinates of many points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site


@dataclass(frozen=True)
class NormalRow(ObservationKind):
    """A combination of the geocentric coordinates of the members of its group (m), with unit coefficients.

    The eigenvectors of normal equations are such rows, with sigmas of one over the roots of the
    eigenvalues: what the equations leave free, no row holds.
    """

    def is_linear(self, site: Site) -> bool:
        """Linear rows."""
        return True

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


NORMAL_ROW = NormalRow(
    "Normal",
    194,
    "row of normal equations",
    "",
    takes_heights=False,
    is_line=False,
)
