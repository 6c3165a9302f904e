"""Causes tried one after the other: each is put right, and the network is computed anew."""

from __future__ import annotations

import math
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.survey.screening.robust import (
    GROSS,
    QUICK,
    WELL_CONTROLLED,
    Estimate,
    Model,
    Stages,
    estimate,
    first_sight,
)

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, IntArray
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

REMAINS = 0.35
"""Share of the contradictions that may remain once the right cause has been found."""
_PROMISING = 0.8
"""Share of the contradictions at first sight, with initial values only, that a cause worth trying leaves."""
_MOST_TRIALS, _FEWEST_TRIALS = 60, 4
_MOST_WORK = 600_000
"""Observations in all trials of groups, and of known points: about a minute."""
_FEW = 0.2
"""Share of suspects, and of some observations, up to which it is asked whether others agree without these."""
_SOME = 0.5
"""Share of observations up to which it is asked whether others may agree without these, at first sight."""
_MARGIN = 1.0
"""Contradictions that the others may have beyond those with which a cause explains a network."""
NO_WEIGHT = 1e5
"""By which sigmas are multiplied of what is to have no weight."""


@dataclass
class Trials:
    """Causes tried one after the other on a network: how much each leaves unexplained.

    Attributes:
        model: how the network is computed.
        found: the network as it is.
        before: contradictions of it.
        untried: what was not tried, since the network is large.
    """

    model: Model
    found: Estimate
    untried: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.model = self.model.for_trials()
        self.before = self.found.disagreement(GROSS)
        self._agreeing: dict[bytes, bool] = {}
        self._open: dict[bytes, bool] = {}
        self._count = 0

    def _tell(self) -> None:
        """Says how many causes have been tried."""
        self._count += 1
        if self.model.progress is not None:
            self.model.progress(f"gross errors: cause {self._count}")

    @cached_property
    def _at_start(self) -> float:
        """Contradictions of the network as it is, at first sight."""
        try:
            return first_sight(self.model, self.found.start)
        except ObseqError:
            return math.inf

    @property
    def _most_left(self) -> float:
        """Contradictions that may remain: all that noise makes, and a share of the others."""
        return self.found.noise + REMAINS * (self.before - self.found.noise)

    @property
    def most(self) -> int:
        """How many groups are tried, and how many mistakes of known points."""
        affordable = _MOST_WORK // max(len(self.found.book.observations), 1)
        return max(_FEWEST_TRIALS, min(_MOST_TRIALS, affordable))

    def start(self, points: Points, book: FieldBook) -> Determined | None:
        """What can be computed of a network that is tried; None for nothing."""
        try:
            return self.model.start(points, book)
        except ObseqError:
            return None

    def tried(
        self, points: Points, book: FieldBook, start: Determined | None = None, *, most_lost: float = math.inf
    ) -> Estimate | None:
        """The network with points or observations put right; None when that does not help at first sight.

        Args:
            points: of the network that is tried.
            book: its observations.
            start: what `Model.start` gives of them, where that is known.
            most_lost: observations that may be left out for nothing determining where they are.
        """
        promising = _PROMISING * self._at_start
        self._tell()
        try:
            start = start or self.model.start(points, book)
            more = lost(book, start) - lost(self.found.book, self.found.start)
            if more > promising or lost(book, start) > most_lost:
                return None
            if first_sight(self.model, start) + more > promising:
                return None
            return estimate(self.model, points, book, QUICK, start)
        except ObseqError:
            return None

    def explaining(self, points: Points, book: FieldBook, start: Determined | None = None) -> Estimate | None:
        """The network with points or observations put right, where that explains it; None else."""
        most_lost = self._most_left + (1.0 - REMAINS) * self.found.lost
        corrected = self.tried(points, book, start, most_lost=most_lost)
        return corrected if corrected is not None and self.explains(corrected) else None

    def put_right(self, book: FieldBook, rows: IntArray, least: float) -> Estimate | None:
        """The network with some observations put right, where others may be wrong too; None if they are not.

        They must fit, and at least so many contradictions must be gone in all. It is computed from where the
        network was found, and anew where that may be astray.
        """
        self._tell()
        found, start = self.found, self.start(self.found.points, book)
        if start is None or lost(book, start) > found.lost:
            return None
        for begin in (found.places_in(start), start):
            one = estimated(self.model, found.points, book, QUICK, begin)
            if (
                one
                and not (one.ratios[rows] > one.limit).any()
                and one.disagreement(GROSS) <= self.before - least
            ):
                return one
        return None

    @property
    def is_mostly_right(self) -> bool:
        """Whether suspects are few in a network whose majority is right."""
        found = self.found
        most = _FEW * np.count_nonzero(found.book.observations.active)
        return found.control > WELL_CONTROLLED and bool(len(found.suspects) <= most)

    def may_be_of(self, rows: IntArray) -> bool:
        """Whether the others agree without some observations: else no mistake of these explains all.

        It is asked where the majority is right, and suspects and these are few; else yes.
        """
        if not self.is_mostly_right or len(rows) > _FEW * len(self.found.book.observations):
            return True
        key = rows.tobytes()
        if key not in self._agreeing:
            self._agreeing[key] = self._agree_without(rows)
        return self._agreeing[key]

    def may_be_among(self, rows: IntArray) -> bool:
        """Whether the others may agree without some observations, at first sight.

        What contradicts without them contradicts with some of them put right, too: no mistake among them is
        to be tried then. Yes where they are most of all, and where the majority is right and they are few,
        which `may_be_of` judges better.
        """
        n = len(self.found.book.observations)
        if len(rows) > _SOME * n or (self.is_mostly_right and len(rows) <= _FEW * n):
            return True
        key = rows.tobytes()
        if key not in self._open:
            self._open[key] = self._may_agree_without(rows)
        return self._open[key]

    def _may_agree_without(self, rows: IntArray) -> bool:
        book = self.found.book
        start = self.start(self.found.points, book.without(_mask(book, rows)))
        try:
            return start is None or first_sight(self.model, start) <= _PROMISING * self._at_start
        except ObseqError:
            return True

    def _agree_without(self, rows: IntArray) -> bool:
        """From where the network was found; anew where nearby points may have been led astray."""
        found, most = self.found, self._most_left + _MARGIN
        start = replace(found.end, book=unweighted(found.end.book, rows))
        without = estimated(self.model, found.points, unweighted(found.book, rows), QUICK, start)
        if without is None:
            return True
        left = without.contradictions(GROSS)
        if left.sum() <= most or left[~_near(found.book, rows)].sum() > most:
            return bool(left.sum() <= most)
        anew = estimated(self.model, found.points, found.book.without(_mask(found.book, rows)), QUICK)
        return anew is None or bool(anew.contradictions(GROSS).sum() <= most)

    def is_decisive(self, corrected: Estimate) -> bool:
        """Whether hardly any contradiction is left beyond noise, so that no other cause need be tried.

        Observations that were lost before and are still do not count: maybe nothing determines their points.
        """
        left = corrected.disagreement(GROSS) - min(corrected.lost, self.found.lost)
        return left - corrected.noise <= max(0.5, 0.03 * self.before)

    def explains(self, corrected: Estimate) -> bool:
        """Whether a cause explains the network; what is lost before and after counts on neither side."""
        lost = min(corrected.lost, self.found.lost)
        left, most = corrected.disagreement(GROSS), self._most_left + (1.0 - REMAINS) * lost
        beyond_noise = self.before - lost - self.found.noise
        return left <= most and self.before - left >= min(1.5, 0.65 * beyond_noise)

    def is_more_than_scaled(self, corrected: Estimate, factor: float) -> bool:
        """Whether misfits became smaller by more than a factor makes everything smaller: a loop's as well.

        Their sum is taken, which does not depend on how a misclosure is shared out.
        """
        if factor == 1.0:
            return True
        return float(corrected.ratios.sum()) <= REMAINS * factor * float(self.found.ratios.sum())


def estimated(
    model: Model, points: Points, book: FieldBook, stages: Stages, start: Determined | None = None
) -> Estimate | None:
    """An estimate; None when nothing of the network can be computed."""
    try:
        return estimate(model, points, book, stages, start)
    except ObseqError:
        return None


def _near(book: FieldBook, rows: IntArray) -> BoolArray:
    """(k,) which observations name a point that some of them name."""
    observations, named = book.observations, np.zeros(len(book.point_names), np.bool_)
    for ends in (observations.from_points, observations.to_points):
        named[ends[rows]] = True
    return book.naming(named)


def _mask(book: FieldBook, rows: IntArray) -> BoolArray:
    """(k,) true for some observations."""
    mask = np.zeros(len(book.observations), np.bool_)
    mask[rows] = True
    return mask


def lost(book: FieldBook, start: Determined) -> int:
    """Observations that cannot be compared, since nothing determines where they are."""
    return int(np.count_nonzero(book.observations.active & ~start.book.observations.active))


def unweighted(book: FieldBook, rows: IntArray) -> FieldBook:
    """The observations, some of them with no weight."""
    sigmas = book.observations.sigmas.copy()
    sigmas[rows] *= NO_WEIGHT
    return replace(book, observations=replace(book.observations, sigmas=sigmas))
