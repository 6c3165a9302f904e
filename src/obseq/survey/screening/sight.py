"""One sight that is wrong where little controls it, and other sights seem to be: each is left out in turn.

In a traverse or a chain of vectors hardly anything is redundant. The estimate that trusts the majority then
blames sights that are right. So each sight, and each of its observations, is given no weight in turn, and
the one without which nothing contradicts is the wrong one.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.findings import Cause, GrossError, gap_of
from obseq.survey.screening.robust import GROSS, QUICK, WELL_CONTROLLED
from obseq.survey.screening.substitutes import tolerance_of
from obseq.survey.screening.trials import estimated, lost, unweighted
from obseq.survey.screening.values import difference, explain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_EQUAL = 0.3
"""Contradictions by which equally good explanations may differ."""
_NAMED = 6
_FEW = 3
"""The worst suspects, which are tried where the majority is right."""


@dataclass(frozen=True, eq=False)
class _Without:
    """A network in which some observations have no weight, and how many contradictions it has."""

    rows: Rows
    left: float
    estimate: Estimate


def sight_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The wrong sight, or the one of several, with the network without it; None when there is none."""
    found: list[_Without] = []
    choices = _worst if trials.found.control > WELL_CONTROLLED else _choices
    for number, rows in enumerate(choices(trials.found)):
        if number == trials.most:
            trials.untried.append("sights one by one")
            break
        one = _without(trials, rows)
        if one is not None:
            found.append(one)
    if not found:
        return None
    least = min(one.left for one in found)
    best = [one for one in found if one.left <= least + _EQUAL]
    fewest = min(len(one.rows) for one in best)
    equal = [one for one in best if len(one.rows) == fewest]
    if len(equal) == 1 and set(trials.found.suspects.tolist()) <= set(equal[0].rows.tolist()):
        return None  # it is what is suspected anyway
    return _described(trials, equal), equal[0].estimate


def _worst(found: Estimate) -> Iterator[Rows]:
    """The worst suspects, one of which may have spoilt the estimate by its size."""
    yield from (np.array([row], np.intp) for row in found.suspects[:_FEW].tolist())


def _choices(found: Estimate) -> Iterator[Rows]:
    """Single observations, then sights with several, those near the suspects first."""
    observations = found.book.observations
    suspects = found.suspects
    ends = (observations.from_points, observations.to_points)
    near = np.zeros(len(found.book.point_names), np.int64)
    for part in ends:
        near[part[suspects]] = 1
    rows = np.flatnonzero(observations.active & np.isfinite(found.misfits))
    order = rows[np.argsort(-(near[ends[0]] + near[ends[1]])[rows], kind="stable")]
    sights: dict[tuple[int, int], list[int]] = {}
    for row in order.tolist():
        sights.setdefault((int(ends[0][row]), int(ends[1][row])), []).append(row)
    yield from (np.array([row], np.intp) for row in order.tolist())
    yield from (np.array(sight, np.intp) for sight in sights.values() if len(sight) > 1)


def _without(trials: Trials, rows: Rows) -> _Without | None:
    """The network without some observations, or with no weight of theirs where a start needs them."""
    found = trials.found
    mask = np.zeros(len(found.book.observations), np.bool_)
    mask[rows] = True
    book = found.book.without(mask)
    start = trials.start(found.points, book)
    estimate = None if start is None else trials.explaining(found.points, book, start)
    if estimate is None and (start is None or lost(book, start) > lost(found.book, found.start)):
        estimate = trials.explaining(found.points, unweighted(found.book, rows))
    if estimate is None or estimate.suspects.size:
        return None
    return _Without(rows, estimate.disagreement(GROSS), estimate)


def _computed(trials: Trials, one: _Without) -> FloatArray:
    """(k,) what each observation should have been; NaN where it cannot be said."""
    points, located = trials.found.points, np.isfinite(one.estimate.coordinates)
    there = replace(points, coordinates=np.where(located, one.estimate.coordinates, points.coordinates))
    found = estimated(trials.model, there, unweighted(trials.found.book, one.rows), QUICK)
    return np.full(len(located), np.nan) if found is None else found.computed


def _described(trials: Trials, equal: list[_Without]) -> GrossError:
    book = trials.found.book
    names = [", ".join(book.label(int(row)) for row in one.rows) for one in equal]
    rows = tuple(dict.fromkeys(int(row) for one in equal for row in one.rows))
    size = float(trials.found.ratios.max())
    told = [_words(trials, one) for one in equal[:_NAMED]]
    if len(equal) == 1:
        text = f"without it nothing contradicts; {told[0][0].removeprefix(f'{names[0]}: ')}"
        return GrossError(names[0], told[0][1], text, size, rows, is_one=True)
    likely = [pair for pair in told if pair[1] is not Cause.UNKNOWN] or told[:1]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    text = "nothing tells them apart, without any one of them nothing contradicts: "
    text += "; or ".join(words for words, _ in likely[:3])
    what = f"one of {'; '.join(names[:_NAMED])}{more}"
    return GrossError(what, likely[0][1], text, size, rows, is_one=True)


def _words(trials: Trials, one: _Without) -> tuple[str, Cause]:
    """What the others give of the observations that are left out, where these differ from it."""
    parts, cause, found = [], Cause.UNKNOWN, trials.found
    computed = _computed(trials, one)
    for row in one.rows.tolist():
        kind = BY_CODE[int(found.book.observations.types[row])]
        value, expected = float(found.book.observations.values[row]), float(computed[row])
        off = difference(kind, value, expected) if np.isfinite(expected) else 0.0
        tolerance = tolerance_of(found, row)
        if abs(off) <= tolerance:
            continue
        why = explain(kind, value, expected, tolerance, found.units)
        cause = why.cause if why and cause is Cause.UNKNOWN else cause
        gap = gap_of(found.units, kind, value - off, off)
        parts.append(f"{found.book.label(row)}: {gap}{f', likely: {why.text}' if why else ''}")
    return "; ".join(parts) or "no usual slip explains it", cause
