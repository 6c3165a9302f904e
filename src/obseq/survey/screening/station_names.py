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
from obseq.survey.screening.field_blocks import blocks_of
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.robust import GROSS, WELL_CONTROLLED
from obseq.survey.screening.standpoints import renamed
from obseq.survey.screening.substitutes import End, near_approximate, tolerance_of, with_every_point

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
        suspects: how many observations that name the written point are suspected.
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
    names = list(_names(found, _set_ups(found), found))
    if not names and found.control <= WELL_CONTROLLED:
        names = list(_names_without(trials))
    for name in sorted(names, key=lambda one: -one.suspects)[: min(_MOST, trials.most)]:
        least = _GAIN * float(found.contradictions(GROSS)[_naming(found, name.written)].sum())
        corrected = trials.put_right(_with(found.book, name), name.rows, least)
        if corrected is not None:
            tried.append((corrected.disagreement(GROSS), name, corrected))
    if not tried:
        return None
    least = min(left for left, _, _ in tried)
    equal = [(name, corrected) for left, name, corrected in tried if left <= least + _EQUAL]
    return any_of([_described(found, name) for name, _ in equal]), equal[0][1]


def _set_ups(found: Estimate) -> list[Rows]:
    """The set-ups of points that suspects name: if wrong ones are more, those that are right contradict."""
    observations, n = found.book.observations, len(found.book.point_names)
    read = codes_for(Start.HZ, Start.ZENITH, Start.DISTANCE, Start.FLAT, Start.ANGLE)
    chosen = observations.active & np.isin(observations.types, read)
    named = [part[found.suspects] for part in (observations.from_points, observations.to_points)]
    is_named = np.bincount(np.concatenate(named), minlength=n)[observations.from_points] >= _LEAST
    return list(blocks_of(found.book, np.flatnonzero(chosen & is_named)))


def _naming(found: Estimate, point: int) -> BoolArray:
    """(k,) the observations that name a point."""
    mask = np.zeros(len(found.book.point_names), np.bool_)
    mask[point] = True
    return found.book.naming(mask)


def _names(found: Estimate, set_ups: list[Rows], places: Estimate) -> Iterator[_Name]:
    """Points that set-ups fit, other than the one that is written, where a network has its points."""
    parts: dict[tuple[int, int], list[Rows]] = {}
    for rows in set_ups:
        origin = int(found.book.observations.from_points[rows[0]])
        for point in np.flatnonzero(_fitting(places, rows)).tolist():
            parts.setdefault((origin, point), []).append(rows)
    for (origin, point), members in parts.items():
        suspects = np.count_nonzero(found.ratios[_naming(found, origin)] > found.limit)
        yield _Name(tuple(members), origin, point, int(suspects))


def _names_without(trials: Trials) -> Iterator[_Name]:
    """The same where little is redundant, and a wrong name moves all: by the others without a set-up."""
    found = trials.found
    set_ups = sorted(_set_ups(found), key=lambda rows: -np.count_nonzero(found.ratios[rows] > found.limit))
    for rows in set_ups[: min(_MOST, trials.most)]:
        mask = np.zeros(len(found.book.observations), np.bool_)
        mask[rows] = True
        without = trials.explaining(found.points, found.book.without(mask))
        if without is not None:
            yield from _names(found, [rows], without)


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
    size = float(found.ratios[_naming(found, name.written)].max())
    return GrossError(what, Cause.WRONG_POINT, text, size, tuple(rows.tolist()), (written, right))
