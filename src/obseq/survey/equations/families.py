"""Observations whose equations are of one family of kinds: what their coordinates do not change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from obseq.arrays import Array, IntArray
from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.registry import BY_CODE, FAMILIES, among
from obseq.survey.model import Observations


@dataclass(frozen=True, eq=False)
class Family:
    """Observations of one family.

    Attributes:
        rows: (n,) rows of the field book.
        kinds: Each of their kinds, with the positions (k,) of its own among the rows.
        has_heights: Whether some have a height of instrument or target.
    """

    rows: IntArray
    kinds: tuple[tuple[ObservationKind, IntArray], ...]
    has_heights: bool

    @property
    def has_offsets(self) -> bool:
        """Whether the equation takes the offsets that heights make."""
        return self.has_heights and self.kinds[0][0].takes_heights

    @property
    def depends_on_place(self) -> bool:
        """Whether what the equation takes changes with the coordinates, even without deflections."""
        return self.has_heights or any(kind.depends_on_place for kind, _ in self.kinds)

    def gathered(self, parts: list[Array]) -> Array:
        """(n, m) rows of all, from those of each kind."""
        if len(parts) == 1:
            return parts[0]
        whole = np.empty((len(self.rows), *parts[0].shape[1:]), parts[0].dtype)
        for (_, chosen), part in zip(self.kinds, parts, strict=True):
            whole[chosen] = part
        return whole


def family_of(observations: Observations, rows: IntArray) -> Family:
    """What is to be known of rows of the field book that are of one family."""
    types = observations.types[rows]
    heights = observations.from_heights[rows].any() or observations.to_heights[rows].any()
    kinds = ((BY_CODE[code], np.flatnonzero(types == code)) for code in present(types))
    return Family(rows, tuple(kinds), bool(heights))


def present(types: NDArray[np.int16]) -> list[int]:
    """The codes there are, ascending."""
    counts: IntArray = np.bincount(types)
    return np.flatnonzero(counts).tolist()


def rows_by_family(observations: Observations, chosen: IntArray) -> dict[str, IntArray]:
    """Some rows, by the name of their family, in the order in which families are listed."""
    types = observations.types[chosen]
    there = {BY_CODE[code].group for code in present(types)}
    return {
        name: chosen[among(types, [kind.code for kind in kinds])]
        for name, kinds in FAMILIES.items()
        if name in there
    }
