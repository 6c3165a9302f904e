"""Covariances of adjusted points together, whether or not an observation joins them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.errors import InputError
from obseq.printable import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares import LeastSquaresResult

MOST_NAMES = 8


def covariance_of(
    solution: LeastSquaresResult, known: Sequence[str], names: Sequence[str], a_priori: bool
) -> FloatArray:
    """(3 k, 3 k) covariance of points, m^2; of all of them when none is named.

    Args:
        solution: What holds the cofactors.
        known: Names of all points.
        names: Those that are asked for.
        a_priori: Whether the given sigmas are trusted.

    Raises:
        InputError: A point is not in the network.
    """
    wrong = [name for name in names if name not in known]
    if wrong:
        there = listed(known, MOST_NAMES)
        raise InputError(f"{wrong[0]} is no point of this adjustment; its points are {there}")
    cofactors = solution.cofactors
    scalars = cofactors.table.scalars(
        cofactors.table.find(list(names or known), "Point3"), "covariance"
    ).ravel()
    factor = 1.0 if a_priori else solution.variance_factor or 1.0
    return cofactors.between(scalars, scalars) * factor
