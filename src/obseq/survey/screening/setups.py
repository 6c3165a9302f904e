"""Two set-ups under one: from some direction on, all of them are turned by one angle.

A code 5 where a new round begins, an instrument that was bumped, a circle that was set anew: each direction
after it contradicts those before, and all by the same angle.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.registry import codes_where
from obseq.survey.model import Stations, group_by_station
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.robust import GROSS, QUICK
from obseq.survey.screening.substitutes import sigma_of
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 2
"""Directions that a set-up needs for its turn to show."""
_MOST_TOLD = 5
_LEFT, _WRONG = 0.1, 0.3
"""Share of a turn by which directions of a part may differ, and share of those that may differ by more."""
_BETTER = 0.5
"""Contradictions that must go where another direction is the first."""
_MOST_BESIDE, _GAIN = 4, 0.2
"""Set-ups that are tried where other things are wrong too; contradictions that must go for each suspect of
one: other errors may show only then."""


@dataclass(frozen=True, eq=False)
class _Split:
    """Directions of a set-up with a turn of their own from `first` on: what is left, and the network so."""

    left: float
    rows: Rows
    first: int
    estimate: Estimate


def setup_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The set-up that is two, or several that all are, with the network in which they are; None without."""
    best: _Split | None = None
    splits = list(_splits(trials.found))
    if len(splits) > trials.most:
        trials.untried.append("set-ups that are two")
    for rows, first in splits[: trials.most]:
        corrected = trials.explaining(trials.found.points, _split(trials.found.book, int(rows[first])))
        if corrected is None:
            continue
        left = corrected.disagreement(GROSS)
        if best is None or left < best.left:
            best = _Split(left, rows, first, corrected)
    if best is None and len(splits) > 1 and (several := _several(trials, splits)):
        return several
    best = best or _beside_others(trials, splits)
    if best is None:
        return None
    best = _improved(trials, best)
    rows, first, corrected = best.rows, best.first, best.estimate
    size = float(trials.found.ratios[rows].max())
    what, text = _described(trials.found, rows, first, corrected, -1)
    text = f"{text}: likely a new set-up, or the circle was turned (in an OBS file, code 7 on that line)"
    return GrossError(what, Cause.NEW_SETUP, text, size, tuple(rows[first:].tolist())), corrected


def _improved(trials: Trials, best: _Split) -> _Split:
    """A set-up that is two, from where least contradicts: turned directions may have moved their targets."""
    if trials.is_decisive(best.estimate):
        return best
    found, rows = trials.found, best.rows
    for step in (-1, 1):
        while _LEAST <= (first := best.first + step) <= len(rows) - _LEAST:
            corrected = estimated(trials.model, found.points, _split(found.book, int(rows[first])), QUICK)
            if corrected is None or corrected.disagreement(GROSS) > best.left - _BETTER:
                break
            best = _Split(corrected.disagreement(GROSS), rows, first, corrected)
    return best


def _beside_others(trials: Trials, splits: list[tuple[Rows, int]]) -> _Split | None:
    """The set-up that is two where other things are wrong as well, which leave much unexplained; or None."""
    found = trials.found
    for rows, first in splits[: min(_MOST_BESIDE, trials.most)]:
        corrected = estimated(trials.model, found.points, _split(found.book, int(rows[first])), QUICK)
        if corrected is None or corrected.lost > found.lost:
            continue
        left = corrected.disagreement(GROSS)
        was, still = (np.count_nonzero(one.ratios[rows] > one.limit) for one in (found, corrected))
        if still <= _WRONG * len(rows) and was - still >= _LEAST and trials.before - left >= _GAIN * was:
            return _Split(left, rows, first, corrected)
    return None


def _several(trials: Trials, splits: list[tuple[Rows, int]]) -> tuple[GrossError, Estimate] | None:
    """Set-ups that are two each, of which none alone explains much."""
    found, book = trials.found, trials.found.book
    for rows, first in splits:
        book = _split(book, int(rows[first]))
    corrected = trials.explaining(found.points, book)
    if corrected is None:
        return None
    told = [_described(found, *one, corrected, k - len(splits)) for k, one in enumerate(splits)]
    listed = "; ".join(f"{what}: {text}" for what, text in told[:_MOST_TOLD])
    more = f"; and {len(told) - _MOST_TOLD} more" if len(told) > _MOST_TOLD else ""
    text = (
        f"likely new set-ups, or circles that were turned (in an OBS file, code 7 on these lines): {listed}"
    )
    turned = tuple(row for members, first in splits for row in members[first:].tolist())
    size = float(found.ratios[list(turned)].max())
    return GrossError(f"{len(splits)} set-ups", Cause.NEW_SETUP, f"{text}{more}", size, turned), corrected


def _splits(found: Estimate) -> Iterator[tuple[Rows, int]]:
    """Directions of set-ups in which suspects are, and the first of those that a turn of their own fits."""
    observations = found.book.observations
    of_circle = codes_where(lambda kind: kind.is_of_circle)
    chosen = observations.active & np.isin(observations.types, of_circle) & np.isfinite(found.misfits)
    suspects = chosen & (found.ratios > GROSS)
    stations = np.unique(observations.stations[suspects & (observations.stations >= 0)]).tolist()
    is_controlled = _controlled(found) if stations else np.zeros(0, np.bool_)
    for station in stations:
        members = found.book.stations.observations(station)
        rows = members[chosen[members]].astype(np.intp)
        if len(rows) < 2 * _LEAST:
            continue
        telling = rows[is_controlled[observations.to_points[rows]]]
        if len(telling) < 2 * _LEAST:
            continue
        first = _turn_of(_turned(found.misfits[telling]), _tolerances(found, telling))
        if first is not None:
            yield rows, int(np.searchsorted(rows, telling[first]))


def _controlled(found: Estimate) -> BoolArray:
    """(n,) the points that are known, or joined to two others: to these, directions say something."""
    observations, n = found.book.observations, len(found.book.point_names)
    ends = np.stack([observations.from_points, observations.to_points], axis=1)[observations.active]
    pairs = np.unique(np.sort(ends, axis=1), axis=0)
    is_known = np.zeros(n, np.bool_)
    is_known[: len(found.points)] = ~found.points.is_free.all(axis=1)
    return np.asarray(is_known | (np.bincount(pairs.ravel(), minlength=n) > 1))


def _tolerances(found: Estimate, rows: Rows) -> FloatArray:
    """(n,) how far a good direction may be from the others."""
    return np.array([found.limit * sigma_of(found, row) for row in rows.tolist()])


def _turn_of(misfits: FloatArray, tolerances: FloatArray) -> int | None:
    """The first of some directions from which on nearly all are turned by one angle; None for no turn.

    Others among them may be wrong on their own; of equal choices that with the smallest deviations is taken.
    """
    choices = []
    for first in range(_LEAST, len(misfits) - _LEAST + 1):
        parts = misfits[:first], misfits[first:]
        turn = abs(float(np.median(parts[1]) - np.median(parts[0])))
        off = np.concatenate([np.abs(part - np.median(part)) for part in parts])
        is_off = off > np.maximum(tolerances, _LEFT * turn)
        agree = min(np.count_nonzero(~is_off[:first]), np.count_nonzero(~is_off[first:]))
        if turn > 2.0 * tolerances.max() and agree >= _LEAST:
            choices.append((int(np.count_nonzero(is_off)), float(off.sum()), first))
    if not choices:
        return None
    wrong, _, first = min(choices)
    return first if wrong <= _WRONG * len(misfits) else None


def _turned(angles: FloatArray) -> FloatArray:
    """Angles from the first of them, in [-pi, pi]."""
    return np.asarray(np.remainder(angles - angles[0] + math.pi, 2.0 * math.pi) - math.pi)


def _split(book: FieldBook, first: int) -> FieldBook:
    """The observations, with a new set-up from one of them on."""
    station = int(book.observations.stations[first])
    members = book.stations.observations(station)
    stations = book.observations.stations.copy()
    stations[members[int(np.flatnonzero(members == first)[0]) :]] = len(book.stations)
    grouped = Stations(
        np.append(book.stations.origins, book.stations.origins[station]),
        np.append(book.stations.orientations, book.stations.orientations[station]),
        *group_by_station(stations, len(book.stations) + 1),
    )
    return replace(book, observations=replace(book.observations, stations=stations), stations=grouped)


def _described(found: Estimate, rows: Rows, first: int, corrected: Estimate, new: int) -> tuple[str, str]:
    """Which set-up is two, and by how much its parts are turned; the second is `new` of the network."""
    before = corrected.rotations[found.book.observations.stations[rows[0]]]
    zero = before.T @ corrected.rotations[new][:, 1]
    turn = found.units.angle.text(-math.atan2(zero[0], zero[1]))
    label, point = found.book.label(int(rows[first])), found.book.observations.from_points[rows[0]]
    what = f"set-up of {found.book.point_names[point]}, from {label} on"
    text = (
        f"the {len(rows) - first} directions from there on are all turned by {turn} against the "
        f"{first} before"
    )
    return what, text
