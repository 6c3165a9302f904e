"""Trials of what many values of a network may have wrong: each is computed from the beginning."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.survey.causes.rewriting import rewritten, rewritten_points

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import FloatArray
    from obseq.survey.causes.rewritten import Rewritten
    from obseq.survey.diagnosing.network_model import NetworkModel
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

_LEAST = 3
"""Observations that a group has at least."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A network without a mistake of many values, and how much it still contradicts itself.

    Attributes:
        rewriting: The mistake.
        start: The network without it, at a robust place.
        left: Contradictions, counted softly.
        others: Mistakes that explain as much.
    """

    rewriting: Rewritten
    start: Determined
    left: float
    others: tuple[Rewritten, ...] = ()


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
    before, is_off, known_off = model.contradictions()
    shares = [one.mean() for one in (is_off, known_off) if one.size]
    if not is_many and max(shares) < POLICY.share:
        return None
    values = rewritten(model.notes, model.point_system, is_off, POLICY.whole, _LEAST)
    best: Trial | None = None
    for some in (values, rewritten_points(model.notes, model.point_system)):
        trials = [trial for one in some if (trial := _tried(model, one, begin, of))]
        best = min([*([best] if best else []), *trials], key=_price, default=None)
        if best is not None and best.left < POLICY.share * before:
            break
    if best is None or best.left >= POLICY.better * before:
        return None
    others = (
        one.rewriting for one in trials if one is not best and _price(one) < _price(best) + POLICY.equal
    )
    return replace(best, others=tuple(others))


def _price(trial: Trial) -> float:
    """What it leaves, and more where nothing explains it."""
    return trial.left + POLICY.nameless * (not trial.rewriting.slip)


def _in_order(points: Points, others: Points, coordinates: FloatArray) -> FloatArray:
    """(n, 3) coordinates of points, found for those that can be computed; NaN of the rest."""
    found = np.full((len(points), 3), np.nan)
    found[[points.index[name] for name in others.names]] = coordinates[: len(others)]
    return found


def _tried(
    model: NetworkModel,
    one: Rewritten,
    begin: Callable[[Points, FieldBook], Determined],
    of: Callable[[Determined], NetworkModel],
) -> Trial | None:
    """A network without a mistake; None where it cannot be computed, or that is not what is wrong."""
    try:
        start = begin(one.points, one.book)
        other = of(start)
        left, _, _ = other.contradictions()
    except ObseqError:
        return None
    counts = (int(np.count_nonzero(net.book.observations.active)) for net in (model.given, start))
    lost = next(counts) - next(counts)
    place = other.robust()
    told = one.told(_in_order(one.points, start.points, place.coordinates))
    if told is None:
        return None
    initial = replace(start.initial, coordinates=place.coordinates, rotations=place.rotations)
    named = replace(one, text=f"{one.text}{told}")
    return Trial(named, replace(start, initial=initial), left + max(lost, 0))
