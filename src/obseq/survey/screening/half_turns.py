"""A direction or an angle that is half a turn off: read in the other face, or backwards.

Initial values then put its target, or all that is seen from its set-up, on the wrong side, and iterations
that begin there stay there: right observations contradict it together, or the known points are blamed.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import codes_where
from obseq.survey.screening.findings import GrossError, any_of
from obseq.survey.screening.robust import WHOLE
from obseq.survey.screening.sights import single_errors
from obseq.survey.screening.substitutes import sigma_of
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

_MOST = 8
"""Directions that are tried: all of a network, or those that name a point which all contradictions name."""
_LEAST_SUSPECTS = 2


def half_turn_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The directions any one of which, turned, leaves no contradiction, and the network of the first."""
    steps: list[tuple[GrossError, Estimate]] = []
    for row in _candidates(trials.found):
        corrected = _freed(trials, row)
        if corrected is not None:
            steps += [(_described(trials.found, corrected, row), corrected)]
    return (any_of([error for error, _ in steps]), steps[0][1]) if steps else None


def _freed(trials: Trials, row: int) -> Estimate | None:
    """The network with one direction turned, where no contradiction is left; else None.

    Others may show, fewer of them, that were hidden before.
    """
    found, book = trials.found, _turned(trials.found.book, row)
    turned = estimated(trials.model, found.points, book, WHOLE)
    if turned is None or turned.lost > found.lost or turned.control <= 0.0:
        return None
    is_left = np.isin([row, *found.suspects.tolist()], turned.suspects).any()
    return None if is_left or len(turned.suspects) >= len(found.suspects) else turned


def _candidates(found: Estimate) -> list[int]:
    """Directions and angles in plan that may be the reason of all contradictions, where these are few."""
    observations = found.book.observations
    codes = codes_where(lambda kind: kind.start in (Start.HZ, Start.ANGLE))
    rows = np.flatnonzero(observations.active & np.isin(observations.types, codes))
    if len(rows) <= _MOST:
        return [int(row) for row in rows]
    suspects = found.suspects
    if len(suspects) < _LEAST_SUSPECTS:
        return []
    ends = np.stack([observations.from_points, observations.to_points], axis=1)
    shared = [point for point in ends[suspects[0]] if (ends[suspects] == point).any(axis=1).all()]
    named = [rows[(ends[rows] == point).any(axis=1)] for point in shared]
    return sorted({int(row) for at_point in named if len(at_point) <= _MOST for row in at_point})


def _turned(book: FieldBook, row: int) -> FieldBook:
    values = book.observations.values.copy()
    values[row] = math.remainder(values[row] + math.pi, 2.0 * math.pi)
    return replace(book, observations=replace(book.observations, values=values))


def _described(found: Estimate, corrected: Estimate, row: int) -> GrossError:
    """One direction as it was read, in the network that is right with it turned."""
    misfits, ratios = corrected.misfits.copy(), corrected.ratios.copy()
    misfits[row] = math.remainder(misfits[row] + math.pi, 2.0 * math.pi)
    ratios[row] = abs(misfits[row]) / sigma_of(corrected, row)
    [error] = single_errors(replace(corrected, book=found.book, misfits=misfits, ratios=ratios), [row])
    return error
