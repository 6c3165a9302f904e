"""Which of several places a point starts at: the one from which least squares fits the observations best."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from obseq.errors import ObseqError
from obseq.survey.equations.equations import Equations
from obseq.survey.initial.closed_forms import Space
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.initial.left_out import Determined, leave_out
from obseq.survey.initial.rivals import Choice
from obseq.survey.model import FieldBook, Points

MOST_TRIALS = 16
"""Adjustments that are tried: for points with many observations first; others start at their first place."""
ITERATIONS, LOOSE = 20, 0.1
"""Of a trial: places are told apart long before they are known to the last digit."""
SAME = 0.1
"""Share of the distance of the places within which two ends are one."""
CLEAR = 9.0
"""Difference of two sums of squares, over the variance of most residuals if that is above 1, that decides."""
OF_MEDIAN = 1.4826
"""Standard deviation over the median of sizes, of normal errors: gross ones elsewhere do not count in it."""


def decided(
    points: Points,
    book: FieldBook,
    found: InitialValues,
    values: Callable[[Choice], InitialValues],
    equations: Callable[[Determined], Equations],
) -> Choice:
    """The best of the places of each point that has several; none where two ends of it are as good.

    Args:
        points: of the network.
        book: its observations.
        found: its initial values, from the first of the places.
        values: gives others.
        equations: gives the equations of a network.
    """
    chosen: dict[str, Space] = {}
    undecided: set[str] = set()
    counts, trials = book.counts(book.observations.active, len(points)), 0
    for point in sorted(found.rivals, key=lambda row: -int(counts[row])):
        name, places = points.names[point], found.rivals[point]
        trials += len(places)
        if trials > MOST_TRIALS:
            break
        starts = [Choice({**chosen, name: place}, frozenset(undecided)) for place in places]
        fits = [_fit(name, points, book, values(start), equations) for start in starts]
        best = min(fits, key=lambda fit: fit.misfit)
        apart = max(math.dist(places[0], place) for place in places[1:])
        if all(best.settles(fit, apart) for fit in fits):
            chosen[name] = places[fits.index(best)]
        else:
            undecided.add(name)
    return Choice(chosen, frozenset(undecided))


class _Fit(NamedTuple):
    """How an adjustment fits: sum of squares, the same over the redundancy, the variance of most residuals.

    The end is where it puts the point.
    """

    cost: float
    misfit: float
    variance: float
    end: Space

    def settles(self, other: _Fit, apart: float) -> bool:
        """Whether this is clearly better than another fit, or the other has come to the same place."""
        if math.isinf(other.misfit):
            return math.isfinite(self.misfit)
        is_clear = other.cost - self.cost > CLEAR * max(self.variance, 1.0)
        return is_clear or math.dist(self.end, other.end) < SAME * apart


_NONE = _Fit(math.inf, math.inf, 0.0, (math.nan, math.nan, math.nan))


def _fit(
    name: str,
    points: Points,
    book: FieldBook,
    initial: InitialValues,
    equations: Callable[[Determined], Equations],
) -> _Fit:
    """How an adjustment fits, and where it puts a point; infinitely badly where there is none."""
    try:
        start = leave_out(Determined(points, book, initial), initial.unplaced)
        made = equations(start)
        solution = made.system.solve(
            max_iterations=ITERATIONS,
            tolerance=LOOSE,
            before_iteration=made.follow,
            strategy="controlled",
        )
    except ObseqError:
        return _NONE
    if name not in start.points.names:
        return _NONE
    residuals, sigmas = made.fitted(solution)
    variance = (OF_MEDIAN * float(np.nanmedian(np.abs(residuals / sigmas)))) ** 2
    x, y, z = solution.values(made.points[[start.points.names.index(name)]])[0].tolist()
    return _Fit(solution.cost, solution.cost / max(solution.redundancy, 1), variance, (x, y, z))
