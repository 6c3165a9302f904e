"""Trials of what many values of a network may have wrong: each is computed from the beginning."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from operator import itemgetter

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.graphs import outwards
from obseq.survey.causes.cause import Rewritten
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.rewriting import rewritten
from obseq.survey.causes.values import is_possible
from obseq.survey.diagnosing.network_model import NetworkModel
from obseq.survey.initial.left_out import Determined, part_of
from obseq.survey.model import FieldBook, Points

Begin = Callable[[Points, FieldBook], Determined]


@dataclass(frozen=True, eq=False)
class Trial:
    """A network without a mistake of many values, and how much it still contradicts itself.

    Attributes:
        rewriting: The mistake.
        model: The network without it.
        left: Contradictions, counted softly.
        count: The same one by one.
        given: The mistake before it was tried.
        others: Mistakes that explain as much.
    """

    rewriting: Rewritten
    model: NetworkModel
    left: float
    count: int
    given: Rewritten
    others: tuple[Rewritten, ...] = ()


def best_rewriting(model: NetworkModel, begin: Begin, *, is_many: bool) -> Trial | None:
    """The mistake of many values without which a network contradicts itself least; None where none helps.

    Of a large network a part shows it: the others are tried there, it alone on the whole.

    Args:
        model: The network.
        begin: Points and observations -> what can be computed of them, at initial values.
        is_many: Whether many single errors were found, however few observations they are.
    """
    found = model.contradictions(model.robust())
    _, is_off, known_off = found
    shares = [one.mean() for one in (is_off, known_off) if one.size]
    if not is_many and max(shares) < POLICY.share:
        return None
    points, book = model.notes.points, model.notes.book
    off = np.where(book.observations.active, is_off, np.nan)
    off_points = book.counts(is_off, len(points)) + np.bincount(
        model.catalogue.known[known_off, 0], minlength=len(points)
    )
    kept = part_that_shows(model.notes, off_points, POLICY.part)
    if kept is None:
        return _best(model, begin, found, rewritten(model.notes, model.point_system, off, off_points))
    off[book.naming(np.append(~kept, np.ones(len(book.point_names) - len(kept), np.bool_)))] = np.nan
    some = rewritten(model.notes, model.point_system, off, np.where(kept, off_points, 0))
    try:
        part = model.like(begin(*part_of(points, book, kept)))
        seen = part.contradictions(part.robust())
    except ObseqError:
        return None
    best = _best(part, lambda points, book: begin(*part_of(points, book, kept)), seen, some)
    whole = None if best is None else _begun(model, begin, best.given)
    trial = None if best is None or whole is None else _tried(model, best.given, whole)
    before = sum(map(np.count_nonzero, (is_off, known_off)))  # soft counts of so many are mostly noise
    if best is None or trial is None or trial.count >= POLICY.better * before:
        return None
    return replace(trial, others=best.others)


def _best(
    model: NetworkModel,
    begin: Begin,
    found: tuple[float, BoolArray, BoolArray],
    rewritings: Iterable[Iterable[Rewritten]],
) -> Trial | None:
    """The best of some mistakes.

    Args:
        model: The network.
        begin: Points and observations -> what can be computed of them, at initial values.
        found: What contradicts it, with the mistake.
        rewritings: It without each of them.
    """
    before, is_off, known_off = found
    noise = (len(is_off) + len(known_off)) / POLICY.suspect**2 + POLICY.equal
    trials: list[Trial] = []
    for some in rewritings:
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


def part_that_shows(notes: Notes, off_points: IntArray, most: int) -> BoolArray | None:
    """(k,) the points about the worst with so many observations, and those that join them to known ones.

    About few known points that nearly nothing agrees with, too: each may have the name of another.

    Args:
        notes: The network.
        off_points: (k,) how many contradictions each point has.
        most: Observations, about; None where the network has no more.
    """
    rows = notes.book.observations
    if np.count_nonzero(rows.active) <= most:
        return None
    n = len(notes.points)
    ends = rows.from_points[rows.active], rows.to_points[rows.active]
    is_known: BoolArray = np.any(~notes.points.is_free, axis=1)
    counts = notes.book.counts(rows.active, n)
    (astray,) = np.nonzero(is_known & (off_points > POLICY.whole * counts))
    others = astray if len(astray) <= POLICY.most else astray[:0]
    order, before = outwards(n, *ends, np.append(int(np.argmax(off_points)), others))
    rank = np.full(n, n)
    rank[order] = np.arange(len(order))
    cut = min(int(np.sort(np.maximum(rank[ends[0]], rank[ends[1]]))[most]), n - 1)
    kept = np.less_equal(rank, cut)
    for point in order[is_known[order]][: POLICY.most].tolist():
        while not kept[point]:
            kept[point] = True
            point = int(before[point])
    return np.asarray(kept, np.bool_)


def _raced(model: NetworkModel, some: Iterable[Rewritten], begin: Begin, noise: float) -> list[Trial]:
    """The trials of some mistakes: those that look best at a glance, and better than none, are computed.

    Args:
        model: The network.
        some: It without each of them.
        begin: Points and observations -> what can be computed of them, at initial values.
        noise: Contradictions that are none: once a trial leaves no more, only others as good are wanted.
    """
    possible = (one for one in some if is_possible(one.slip, model.units))
    seen = sorted((one for one in map(partial(_glanced, model, begin), possible) if one), key=itemgetter(0))
    trials: list[Trial] = []
    as_given = model.contradictions(model.soon())[0] if seen else 0.0
    for left, one, other in seen[: POLICY.trials]:
        if left >= as_given or (trials and min(map(_price, trials)) < noise < left):
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


def _begun(model: NetworkModel, begin: Begin, one: Rewritten) -> NetworkModel | None:
    """A network without a mistake; None where it has no start."""
    try:
        return model.like(begin(one.points, one.book))
    except ObseqError:
        return None


def _glanced(
    model: NetworkModel, begin: Begin, one: Rewritten
) -> tuple[float, Rewritten, NetworkModel] | None:
    """What a network without a mistake contradicts after a few iterations; None where it has no start."""
    try:
        other = _begun(model, begin, one)
        return None if other is None else (other.contradictions(other.soon())[0], one, other)
    except ObseqError:
        return None


def _tried(model: NetworkModel, one: Rewritten, other: NetworkModel) -> Trial | None:
    """A network without a mistake; None where it cannot be computed, or that is not what is wrong."""
    try:
        place = other.robust()
        left, *off = other.contradictions(place)
    except ObseqError:
        return None
    counts = (int(np.count_nonzero(net.given.book.observations.active)) for net in (model, other))
    lost = next(counts) - next(counts)
    told = one.told(_in_order(one.points, other.given.points, place.coordinates))
    if told is None:
        return None
    lost = max(lost, 0)
    count = lost + sum(map(int, map(np.count_nonzero, off)))
    return Trial(replace(one, text=f"{one.text}{told}"), other, left + lost, count, given=one)
