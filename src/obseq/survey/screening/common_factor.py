"""One factor or one constant of all distances, where an adjustment is rejected and no observation stands out.

A wrong scale of some hundred ppm moves no distance of a small network by ten sigmas, and bends it all: known
points, or the sigmas, would be blamed for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.leastsquares.statistics.hypothesis_tests import global_test
from obseq.survey.kinds.registry import codes_where
from obseq.survey.screening.distances import LEAST, changed, described
from obseq.survey.screening.robust import QUICK
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.computation import Computation
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.findings import GrossError
    from obseq.survey.screening.robust import Model

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LARGEST = 20_000
"""Observations up to which a network is adjusted again for that."""
_SIGNIFICANT = 25.0
"""Weighted squares that the unknown must take away: five sigmas."""
_LEAST_REDUNDANCY = 3
"""Redundancy that must remain to confirm it."""
_SHARE = 0.95
"""Share of the squares that a single gross error explains which the unknown must explain too."""


def common_factor(
    model: Model, computation: Computation, given: Determined, adjustment: Adjustment
) -> tuple[GrossError, ...]:
    """The factor or constant of all distances with which an adjustment is accepted; none else.

    Args:
        model: how the network is estimated.
        computation: how it was adjusted.
        given: the network.
        adjustment: what came out.
    """
    rows = given.book.observations
    slopes = codes_where(lambda kind: kind.horizontal is not None)
    mine = np.flatnonzero(np.isin(rows.types, slopes) & rows.active)
    if len(mine) < LEAST or len(rows) > _LARGEST or _is_accepted(adjustment):
        return ()
    accepted = _accepted(computation, given, mine)
    if accepted is None:
        return ()
    left, what, book = accepted
    gain = adjustment.solution.cost - left
    estimate = estimated(model, given.points, book, QUICK)
    if estimate is None or gain < max(_SIGNIFICANT, _SHARE * _of_one(adjustment)):
        return ()
    values = [value for part, value in estimate.instruments if part == what]
    size = float(np.max(np.abs(np.nan_to_num(adjustment.normalised_residuals[mine]))))
    error = described(given.book, mine, what, values, size, computation.point_system, model.units)
    return (replace(error, text=f"{error.text}{_or(adjustment, gain)}"),)


def _accepted(computation: Computation, given: Determined, mine: Rows) -> tuple[float, str, FieldBook] | None:
    """The unknown with which the adjustment is accepted: weighted squares, name, observations; the best."""
    found: list[tuple[float, str, FieldBook]] = []
    for what in ("scale", "constant"):
        book = changed(given.book, mine, what)
        if book is None:
            continue
        try:
            corrected = computation.plain().determined(replace(given, book=book), strict=True)
        except ObseqError:
            continue
        if corrected.solution.redundancy >= _LEAST_REDUNDANCY and _is_accepted(corrected):
            found.append((corrected.solution.cost, what, book))
    return min(found, key=lambda one: one[0], default=None)


def _is_accepted(adjustment: Adjustment) -> bool:
    """Whether the residuals are not larger than the sigmas announce."""
    solution = adjustment.solution
    if not solution.redundancy:
        return True
    test = global_test(solution)
    return test.statistic <= test.upper


def _of_one(adjustment: Adjustment) -> float:
    """Weighted squares that the one gross error explains which is suspected."""
    return 0.0 if adjustment.suspicion is None else adjustment.suspicion.statistic**2


def _or(adjustment: Adjustment, gain: float) -> str:
    """What else explains it as well."""
    suspicion = adjustment.suspicion
    if suspicion is None or suspicion.statistic**2 < gain - _SIGNIFICANT:
        return ""
    return f"; or, which nothing tells apart, a gross error in one of {', '.join(suspicion.observations)}"
