"""Trials of what many values of a network may have wrong: each is computed from the beginning."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.survey.causes.rewriting import rewritten

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.survey.causes.rewriting import Rewritten
    from obseq.survey.diagnosing.network_model import NetworkModel
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

_LEAST = 3
"""Observations that a group has at least."""
_NAMELESS = 0.5
"""Contradictions that a mistake which nothing explains must leave less than one with a slip."""
_BETTER = 0.5
"""Contradictions that a rewriting leaves at most, of those that there are."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A network without a mistake of many values, and how much it still contradicts itself.

    Attributes:
        rewriting: The mistake.
        start: The network without it, at a robust place.
        left: Contradictions, counted softly.
    """

    rewriting: Rewritten
    start: Determined
    left: float


def best_rewriting(
    model: NetworkModel,
    begin: Callable[[Points, FieldBook], Determined],
    of: Callable[[Determined], NetworkModel],
    *,
    is_many: bool,
) -> Trial | None:
    """The mistake of many values without which a network contradicts itself least; None where none helps.

    Args:
        model: The network.
        begin: Points and observations -> what can be computed of them, at initial values.
        of: Such a network -> its model.
        is_many: Whether many single errors were found, however few observations they are.
    """
    before, is_off = model.contradictions()
    if not is_many and is_off.mean() < POLICY.share:
        return None
    trials = []
    for one in rewritten(model.notes, model.point_system, is_off, POLICY.whole, _LEAST):
        try:
            start = begin(one.points, one.book)
            other = of(start)
            left, _ = other.contradictions()
        except ObseqError:
            continue
        counts = (int(np.count_nonzero(net.book.observations.active)) for net in (model.given, start))
        lost = next(counts) - next(counts)
        place = other.robust()
        initial = replace(start.initial, coordinates=place.coordinates, rotations=place.rotations)
        trials.append(Trial(one, replace(start, initial=initial), left + max(lost, 0)))
    best = min(trials, key=lambda one: one.left + _NAMELESS * (not one.rewriting.slip), default=None)
    return best if best is not None and best.left < _BETTER * before else None
