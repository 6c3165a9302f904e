"""Errors of a levelling, told by least squares: its equations are linear, so that it is exact for any size.

A robust estimate does not know which of two bench marks is wrong, and may share an error out between them.
Here the equation of the largest test is left out, and so on until nothing that remains is gross; then each is
compared, without the others, with what would explain as much. Source: W. Baarda, A testing procedure for use
in geodetic networks, Delft 1968.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import codes_where
from obseq.survey.screening.alternatives import Alternative, Tested, adjusted, as_good, stiff
from obseq.survey.screening.robust import GROSS, LARGEST_SCALE

if TYPE_CHECKING:
    from obseq.leastsquares import LeastSquaresResult
    from obseq.survey.screening.robust import Estimate, Model

_MOST = 3
"""Errors that are looked for."""
_LEAST_REDUNDANCY = 3
"""Redundancy that must remain to confirm several errors."""
_ROUNDING = 1e-3
"""Weighted squares of a network without redundancy."""


def errors_of_levelling(model: Model, found: Estimate) -> list[list[Alternative]]:
    """The errors that explain all misfits of a levelling, each with what would explain it as well.

    Args:
        model: how initial values and equations are made.
        found: the network.

    Returns:
        The places of each error, the best first; none where more errors were needed, or it is no levelling.
    """
    rows = found.start.book.observations
    if not np.isin(rows.types[rows.active], codes_where(lambda kind: kind.start is Start.RISE)).all():
        return []
    try:
        wrong = _wrong(model, found)
        return [_places(model, found, [other for other in wrong if other is not one]) for one in wrong]
    except ObseqError:
        return []


def _wrong(model: Model, found: Estimate) -> list[Alternative]:
    """The places without which nothing is gross, as few as it takes; none where that is too many."""
    wrong: list[Alternative] = []
    tested = _without(model, found, wrong)
    while (one := _gross(tested)) is not None:
        if len(wrong) == _MOST:
            return []
        wrong.append(one)
        tested = _without(model, found, wrong)
    return wrong if _is_confirmed(tested.solution, len(wrong)) else []


def _gross(tested: Tested) -> Alternative | None:
    """What has the largest test, where that is gross against the noise of all others."""
    w, one = max(tested.explanations, key=lambda pair: abs(pair[0]), default=(0.0, None))
    freedom, others = tested.solution.redundancy - 1, tested.solution.cost - w**2
    noise = (max(others, 0.0) / freedom) ** 0.5 if freedom > 0 else 1.0
    return one if abs(w) > GROSS * min(max(1.0, noise), LARGEST_SCALE) else None


def _places(model: Model, found: Estimate, others: list[Alternative]) -> list[Alternative]:
    """Where the one error may be that is left without others."""
    every = _without(model, found, others).explanations
    w = max((w for w, _ in every), key=abs)
    return as_good(every, w, w)


def _without(model: Model, found: Estimate, wrong: list[Alternative]) -> Tested:
    """The network without some observations and known coordinates."""
    points, gone = stiff(found, found.points.coordinates), np.zeros(len(found.book.observations), np.bool_)
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    for one in wrong:
        if one.row >= 0:
            gone[one.row] = True
        else:
            coordinates[one.point, one.component] = sigmas[one.point, one.component] = np.nan
    points = replace(points, coordinates=coordinates, sigmas=sigmas)
    return adjusted(model, found, points, found.book.without(gone))


def _is_confirmed(solution: LeastSquaresResult, count: int) -> bool:
    """Whether what remains is noise, and enough to say so of several errors."""
    is_noise = solution.cost <= LARGEST_SCALE**2 * solution.redundancy + _ROUNDING
    return is_noise and (count <= 1 or solution.redundancy >= _LEAST_REDUNDANCY)
