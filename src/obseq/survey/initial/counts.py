"""How many unknowns the observations of a point have to give."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import among, codes_for
from obseq.survey.model import Orientation

if TYPE_CHECKING:
    from obseq.arrays import BoolArray
    from obseq.survey.model import FieldBook, IntArray, Points

Orientations: TypeAlias = "np.ndarray[tuple[int], np.dtype[np.int8]]"
"""(m,) values of `Orientation`, one for each station."""


def unknown_zeros(points: Points, book: FieldBook, orientations: Orientations, active: BoolArray) -> IntArray:
    """(n,) unknown zeros of circles set up on each free point, which its readings have to give as well."""
    rows = book.observations
    readings = active & among(rows.types, codes_for(Start.HZ)) & (rows.stations >= 0)
    stations = np.flatnonzero(np.bincount(rows.stations[readings]))
    stations = stations[orientations[stations] == Orientation.VERT.value]
    count = np.bincount(book.stations.origins[stations], minlength=len(points))[: len(points)]
    return np.where(points.is_free.any(axis=1) & ~points.in_datum.any(axis=1), count, 0)
