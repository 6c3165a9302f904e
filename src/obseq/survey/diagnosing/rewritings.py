"""Trials of what many values of a network may have wrong: each is computed from the beginning."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.survey.causes.rewriting import rewritten

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from obseq.arrays import FloatArray
    from obseq.survey.causes.cause import Rewritten
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
        model: The network without it.
        left: Contradictions, counted softly.
        others: Mistakes that explain as much.
    """

    rewriting: Rewritten
    model: NetworkModel
    left: float
    others: tuple[Rewritten, ...] = ()


def best_rewriting(
    model: NetworkModel, begin: Callable[[Points, FieldBook], Determined], *, is_many: bool
) -> Trial | None:
    """The mistake of many values without which a network contradicts itself least; None where none helps.

    Args:
        model: The network.
        begin: Points and observations -> what can be computed of them, at initial values.
        is_many: Whether many single errors were found, however few observations they are.
    """
    before, is_off, known_off = model.contradictions(model.robust())
    shares = [one.mean() for one in (is_off, known_off) if one.size]
    if not is_many and max(shares) < POLICY.share:
        return None
    noise = (len(is_off) + len(known_off)) / POLICY.suspect**2 + POLICY.equal
    trials: list[Trial] = []
    for some in rewritten(model.notes, model.point_system, is_off, POLICY.whole, _LEAST):
        trials += _raced(model, some, begin, noise)
        if trials and min(map(_price, trials)) < noise:
            break
    best = min(trials, key=_price, default=None)
    if best is None or best.left >= POLICY.better * before:
        return None
    others = (
        one.rewriting for one in trials if one is not best and _price(one) < _price(best) + POLICY.equal
    )
    return replace(best, others=tuple(others))


def _raced(
    model: NetworkModel,
    some: Iterable[Rewritten],
    begin: Callable[[Points, FieldBook], Determined],
    noise: float,
) -> list[Trial]:
    """The trials of some mistakes: those that look best at a glance are computed to their end.

    Args:
        model: The network.
        some: It without each of them.
        begin: Points and observations -> what can be computed of them, at initial values.
        noise: Contradictions that are none: once a trial leaves no more, only others as good are wanted.
    """
    seen = sorted((one for one in map(partial(_glanced, model, begin), some) if one), key=itemgetter(0))
    trials: list[Trial] = []
    for left, one, other in seen[: POLICY.trials]:
        if trials and min(map(_price, trials)) < noise < left:
            break
        if (trial := _tried(model, one, other)) is not None:
            trials.append(trial)
    return trials


def _price(trial: Trial) -> float:
    """What it leaves, and more where nothing explains it."""
    return trial.left + POLICY.nameless * (not trial.rewriting.slip)


def _in_order(points: Points, others: Points, coordinates: FloatArray) -> FloatArray:
    """(n, 3) coordinates of points, found for those that can be computed; NaN of the rest."""
    found = np.full((len(points), 3), np.nan)
    found[[points.index[name] for name in others.names]] = coordinates[: len(others)]
    return found


def _glanced(
    model: NetworkModel, begin: Callable[[Points, FieldBook], Determined], one: Rewritten
) -> tuple[float, Rewritten, NetworkModel] | None:
    """What a network without a mistake contradicts after a few iterations; None where it has no start."""
    try:
        other = model.like(begin(one.points, one.book))
        return other.contradictions(other.soon())[0], one, other
    except ObseqError:
        return None


def _tried(model: NetworkModel, one: Rewritten, other: NetworkModel) -> Trial | None:
    """A network without a mistake; None where it cannot be computed, or that is not what is wrong."""
    try:
        place = other.robust()
        left, _, _ = other.contradictions(place)
    except ObseqError:
        return None
    counts = (int(np.count_nonzero(net.given.book.observations.active)) for net in (model, other))
    lost = next(counts) - next(counts)
    told = one.told(_in_order(one.points, other.given.points, place.coordinates))
    if told is None:
        return None
    return Trial(replace(one, text=f"{one.text}{told}"), other, left + max(lost, 0))
