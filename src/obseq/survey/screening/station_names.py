"""Set-ups under the name of another point, found by what they measured: the point at which it all fits.

A set-up may give too little for a place of its own, as in a traverse, where it sees two points. But what it
measured fits where it stood, if other observations determine this point.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import codes_for
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.robust import GROSS, QUICK
from obseq.survey.screening.standpoints import blocks_of, renamed
from obseq.survey.screening.substitutes import End, near_approximate, tolerance_of, with_every_point
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 2
"""Suspects of a set-up, and observations that another point must fit."""
_SHARE = 0.4
"""Share of suspects in a network beyond which more is wrong than a name."""
_MOST = 6
"""Names that are tried, those of set-ups with most suspects first."""
_LEAST_NEAR = 4
"""Distances that must fit approximate coordinates, which say less."""
_FIT = 0.7
"""Share of the distances, or of the directions, that must fit."""
_GAIN = 0.65
"""Share of the contradictions of a set-up that its right name must remove in all."""
_EQUAL = 0.1
"""Contradictions by which two names may differ that explain a network equally well."""


@dataclass(frozen=True, eq=False)
class _Name:
    """Set-ups that fit another point than the one that is written.

    Attributes:
        set_ups: the observations of each.
        written: the point of the file.
        right: the point that fits.
        suspects: how many of the observations are suspected.
    """

    set_ups: tuple[Rows, ...]
    written: int
    right: int
    suspects: int

    @property
    def rows(self) -> Rows:
        """All their observations."""
        return np.concatenate(self.set_ups)


def station_name_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The set-ups whose name is wrong, with the network in which it is put right; None when there is none."""
    found = trials.found
    tried: list[tuple[float, _Name, Estimate]] = []
    if not _LEAST <= len(found.suspects) <= _SHARE * np.count_nonzero(found.book.observations.active):
        return None
    for name in sorted(_names(found), key=lambda one: -one.suspects)[: min(_MOST, trials.most)]:
        corrected = estimated(trials.model, found.points, _with(found.book, name), QUICK)
        if corrected is None or corrected.lost > found.lost:
            continue
        left, explained = corrected.disagreement(GROSS), found.contradictions(GROSS)[name.rows].sum()
        is_right = not (corrected.ratios[name.rows] > corrected.limit).any()
        if is_right and trials.before - left >= _GAIN * explained:
            tried.append((left, name, corrected))
    if not tried:
        return None
    least = min(left for left, _, _ in tried)
    equal = [(name, corrected) for left, name, corrected in tried if left <= least + _EQUAL]
    return any_of([_described(found, name) for name, _ in equal]), equal[0][1]


def _names(found: Estimate) -> Iterator[_Name]:
    """Points that set-ups with suspects fit, other than the one that is written."""
    observations = found.book.observations
    read = codes_for(Start.HZ, Start.ZENITH, Start.DISTANCE, Start.FLAT, Start.ANGLE)
    chosen = observations.active & np.isin(observations.types, read)
    is_suspect = chosen & (found.ratios > found.limit)
    for origin in np.unique(observations.from_points[is_suspect]).tolist():
        parts: dict[int, list[Rows]] = {}
        for rows in blocks_of(found.book, np.flatnonzero(chosen & (observations.from_points == origin))):
            if np.count_nonzero(is_suspect[rows]) >= _LEAST:
                for point in np.flatnonzero(_fitting(found, rows)).tolist():
                    parts.setdefault(point, []).append(rows)
        for point, set_ups in parts.items():
            count = int(sum(np.count_nonzero(is_suspect[rows]) for rows in set_ups))
            yield _Name(tuple(set_ups), origin, point, count)


def _fitting(found: Estimate, rows: Rows) -> BoolArray:
    """(n,) the points from which most distances of a set-up fit; of one without, most directions."""
    observations = found.book.observations
    types = observations.types[rows]
    lengths = rows[np.isin(types, codes_for(Start.DISTANCE, Start.FLAT))]
    turns = rows[np.isin(types, codes_for(Start.HZ))]
    if len(lengths) >= _LEAST:
        fits = _fit_at(found, lengths)
    elif len(turns) > _LEAST:
        fits = _turn_at(found, turns)
    else:
        return np.zeros(len(found.points), np.bool_)
    named = np.concatenate([observations.from_points[rows], observations.to_points[rows]])
    fits[named[named < len(fits)]] = False
    return fits


def _fit_at(found: Estimate, lengths: Rows) -> BoolArray:
    """(n,) the points from which most of some distances fit."""
    count = np.zeros(len(found.points), np.intp)
    for row in lengths.tolist():
        gaps = np.abs(with_every_point(found, row, End.ORIGIN) - found.book.observations.values[row])
        count += gaps <= 2.0 * tolerance_of(found, row)
    near = near_approximate(found, lengths.tolist(), End.ORIGIN)
    least = _FIT * len(lengths)
    return np.asarray((count >= max(_LEAST, least)) | (near >= max(_LEAST_NEAR, least)))


def _turn_at(found: Estimate, turns: Rows) -> BoolArray:
    """(n,) the points from which most of some directions fit, whatever the zero of the circle."""
    observations, n = found.book.observations, len(found.points)
    targets = observations.to_points[turns]
    places = np.full((len(targets), 3), np.nan)
    places[targets < n] = found.coordinates[targets[targets < n]]
    sights = places[None, :, :2] - found.coordinates[:, None, :2]
    off = np.arctan2(sights[..., 0], sights[..., 1]) - observations.values[turns]
    tolerances = np.array([2.0 * tolerance_of(found, row) for row in turns.tolist()])
    most = np.zeros(n, np.intp)
    for k in range(len(turns)):
        from_this = np.abs(np.remainder(off - off[:, [k]] + math.pi, 2.0 * math.pi) - math.pi)
        most = np.maximum(most, np.count_nonzero(from_this <= tolerances, axis=1))
    return np.asarray(most >= max(_LEAST + 1, _FIT * len(turns)))


def _with(book: FieldBook, name: _Name) -> FieldBook:
    """The observations with set-ups on another point."""
    for rows in name.set_ups:
        book = renamed(book, rows, book.point_names[name.right])
    return book


def _described(found: Estimate, name: _Name) -> GrossError:
    written, right = (found.points.names[row] for row in (name.written, name.right))
    rows = name.rows
    many = "a set-up" if len(name.set_ups) == 1 else f"{len(name.set_ups)} set-ups"
    label = found.book.label(int(rows[0]))
    what = f"the {len(rows)} observations of {many} of {written} (the first: {label})"
    text = f"they fit {right}, not {written}: the name of the station is wrong"
    size = float(found.ratios[rows].max())
    return GrossError(what, Cause.WRONG_POINT, text, size, tuple(rows.tolist()), (written, right))
