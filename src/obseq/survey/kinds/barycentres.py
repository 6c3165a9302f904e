"""Points that are the barycentre of others: a condition for each coordinate, with a sigma."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import FirstPlace, ObservationKind

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.kinds.kind import Site


@dataclass(frozen=True)
class BarycentreComponent(ObservationKind):
    """One coordinate of a point minus the mean of those of the members of its group.

    Attributes:
        axis: 0, 1 or 2, of the frame.
    """

    axis: int = 0

    def is_linear(self, site: Site) -> bool:
        """Linear rows."""
        return True

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


def _along(axis: int) -> BarycentreComponent:
    name = "XYZ"[axis]
    return BarycentreComponent(
        f"Bary{name}",
        191 + axis,
        f"{name.lower()} of a barycentre",
        "",
        first_place=FirstPlace.BARYCENTRE,
        family="Barycentre",
        takes_heights=False,
        is_line=False,
        axis=axis,
    )


BARY_X, BARY_Y, BARY_Z = map(_along, range(3))
