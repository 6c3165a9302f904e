"""The search for gross errors: causes of many observations first, then known points, then single values."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.groups import group_cause
from obseq.survey.screening.known_points import PointSystem, known_point_cause
from obseq.survey.screening.robust import Estimate, Model, estimate
from obseq.survey.screening.sights import single_errors

if TYPE_CHECKING:
    from obseq.survey.model import FieldBook, Points

_MOST_CAUSES = 3
_MOST_SINGLE = 0.25
"""Share of suspects beyond which they are not taken one by one."""

_MOST_NAMED = 5


def gross_errors(
    model: Model, system: PointSystem, points: Points, book: FieldBook
) -> tuple[GrossError, ...]:
    """The gross errors of a network with their likely causes, the worst first; none for an honest network.

    Args:
        model: how initial values and equations are made.
        system: the coordinates of the point files.
        points: of the network, as `join` made them.
        book: its observations.
    """
    try:
        found = estimate(model, points, book)
    except ObseqError:
        return ()
    errors: list[GrossError] = []
    for _ in range(_MOST_CAUSES):
        step = _cause_of_many(model, system, found)
        if step is None:
            break
        errors.append(step[0])
        found = step[1]
    singles = _left_over(found)
    return tuple(sorted([*errors, *singles], key=lambda error: -error.size))


def _left_over(found: Estimate) -> list[GrossError]:
    """The remaining suspects one by one; together when they are too many for that."""
    suspects, n = found.suspects, int(np.count_nonzero(found.book.observations.active))
    if len(suspects) <= max(3.0, _MOST_SINGLE * n):
        return single_errors(found)
    worst = ", ".join(found.book.label(int(row)) for row in suspects[:_MOST_NAMED])
    text = f"no single cause explains them; the worst are {worst}"
    what, size = f"{len(suspects)} of {n} observations", float(found.ratios[suspects[0]])
    return [GrossError(what, Cause.UNKNOWN, text, size, tuple(suspects.tolist()))]


def _cause_of_many(model: Model, system: PointSystem, found: Estimate) -> tuple[GrossError, Estimate] | None:
    """The one mistake, of a group or of a known point, that removes most contradictions."""
    if len(found.suspects) < 2:
        return None
    ways = [group_cause(model, found), known_point_cause(model, system, found)]
    steps = [step for step in ways if step is not None]
    return min(steps, key=lambda step: len(step[1].suspects), default=None)


def is_doubtful(ratios: np.ndarray[tuple[int], np.dtype[np.float64]], limit: float) -> bool:
    """Whether some observation is so far from the others that gross errors are to be looked for."""
    return bool(np.nanmax(ratios, initial=0.0) > limit)
