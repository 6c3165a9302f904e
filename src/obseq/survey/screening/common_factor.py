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
from obseq.survey.screening.distances import (
    LEAST,
    changed,
    described,
    distances_of,
    may_be,
    or_known_points,
    values_of,
)
from obseq.survey.screening.robust import QUICK
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from obseq.leastsquares import LeastSquaresResult
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.computation import Computation
    from obseq.survey.adjustment.equations import Equations
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
    model: Model,
    computation: Computation,
    given: Determined,
    equations: Equations,
    adjustment: Adjustment,
) -> tuple[GrossError, ...]:
    """The factor or constant of all distances with which an adjustment is accepted; none else.

    Args:
        model: how the network is estimated.
        computation: how it was adjusted.
        given: the network.
        equations: its equations.
        adjustment: what came out.
    """
    mine = distances_of(given.book)
    if len(mine) < LEAST or len(given.book.observations) > _LARGEST or _is_accepted(adjustment.solution):
        return ()
    if len(adjustment.left_out) > len(given.left_out):
        return ()  # what its observations leave undetermined stays so
    accepted = _accepted(computation, _settled(given, equations, adjustment), mine)
    if accepted is None:
        return ()
    left, what, book = accepted
    gain = adjustment.solution.cost - left
    if gain < max(_SIGNIFICANT, _SHARE * _of_one(adjustment)):
        return ()
    estimate = estimated(model, given.points, book, QUICK)
    if estimate is None:
        return ()
    values = values_of(estimate, what)
    if not may_be(what, values):
        return ()
    size = float(np.max(np.abs(np.nan_to_num(adjustment.normalised_residuals[mine]))))
    error = described(given.book, mine, what, values, size, computation.point_system, model.units)
    error = or_known_points(error, what, given.points)
    return (replace(error, text=f"{error.text}{_or(adjustment, gain)}"),)


def _settled(given: Determined, equations: Equations, adjustment: Adjustment) -> Determined:
    """The network at its adjustment, from where one more unknown moves it little."""
    initial = replace(
        given.initial,
        coordinates=adjustment.points.coordinates,
        rotations=equations.instruments.rotations(adjustment.solution),
    )
    return replace(given, initial=initial)


def _accepted(computation: Computation, start: Determined, mine: Rows) -> tuple[float, str, FieldBook] | None:
    """The unknown with which the adjustment is accepted: weighted squares, name, observations; the best."""
    found: list[tuple[float, str, FieldBook]] = []
    for what in ("scale", "constant"):
        book = changed(start.book, mine, what)
        if book is None:
            continue
        try:
            solution = computation.solved(replace(start, book=book))
        except ObseqError:
            continue
        if solution.redundancy >= _LEAST_REDUNDANCY and _is_accepted(solution):
            found.append((solution.cost, what, book))
    return min(found, key=lambda one: one[0], default=None)


def _is_accepted(solution: LeastSquaresResult) -> bool:
    """Whether the residuals are not larger than the sigmas announce."""
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
