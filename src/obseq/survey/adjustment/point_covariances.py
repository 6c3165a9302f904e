"""Covariances of adjusted points together, whether or not an observation joins them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.printable import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.survey.adjustment.adjusted import Adjustment

MOST_NAMES = 8


def covariance_of(found: Adjustment, names: Sequence[str]) -> FloatArray:
    """(3 k, 3 k) covariance of points, m^2; of all of them when none is named.

    Raises:
        InputError: A point is not in the network.
    """
    known = found.points.names
    wrong = [name for name in names if name not in known]
    if wrong:
        there = listed(known, MOST_NAMES)
        raise InputError(f"{wrong[0]} is no point of this adjustment; its points are {there}")
    cofactors = found.solution.cofactors
    ids = cofactors.table.find(list(names or known), "Point3")
    scalars = cofactors.table.scalars(ids, "covariance").ravel()
    factor = 1.0 if found.quality.a_priori else found.solution.variance_factor or 1.0
    return cofactors.between(scalars, scalars) * factor
