"""Targets of a set-up under wrong names: one sight to another point, or two targets under each other's names.

Where a name is wrong, the robust estimate often moves the point, or the instrument, and right observations
seem wrong. So all that a sight measured is compared with every point in place of its target; what fits is
tried, and the network is computed anew with the name put right.
"""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import BY_CODE, codes_for
from obseq.survey.screening.field_blocks import blocks_of
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.robust import GROSS
from obseq.survey.screening.substitutes import End, near_approximate, substitutes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LEAST = 2
"""Suspects from which names are thought of: one alone is told by what its value may be."""
_MOST_SUSPECTS, _SHARE, _MOST = 300, 0.4, 12
"""Suspects up to which names are thought of, and their share; names that are tried, those that explain most
suspects first."""
_CHANCE = 0.01
"""Points that may fit a sight by accident."""
_FEW = 3
"""Targets of a set-up of which each two are tried: what it measures says little of its own."""
_NEAR = 0.01
"""How far from where they were found points may be (m) that a short sight fits."""
_WHOLE = 3
"""Observations of a sight that must fit approximate coordinates, which say less."""
_GAIN = 0.65
"""Share of the contradictions of the sights that another name must remove in all."""
_EQUAL = 0.1
"""Contradictions by which two names may differ that explain a network equally well."""
_LISTED = 6
"""Observations up to which each of them is named."""


@dataclass(frozen=True, eq=False)
class _Sight:
    """Observations of one sight, and the points other than its target that they fit."""

    rows: Rows
    fits: frozenset[int]


@dataclass(frozen=True, eq=False)
class _SetUp:
    """Observations that follow each other from one point, and the sights among them by their targets."""

    rows: Rows
    sights: dict[int, list[_Sight]]


@dataclass(frozen=True, eq=False)
class _Names:
    """Sights from one point under other names.

    Attributes:
        rows: their observations.
        backsights: observations of their set-ups whose backsights they name.
        pair: the written target and the right one; of exchanged ones both.
        is_exchange: whether the two are exchanged.
        suspects: how many of the observations are suspected.
    """

    rows: Rows
    backsights: Rows
    pair: tuple[int, int]
    is_exchange: bool
    suspects: int


@dataclass(frozen=True, eq=False)
class _Tried:
    names: _Names
    left: float
    estimate: Estimate


def target_name_cause(trials: Trials) -> tuple[GrossError, Estimate] | None:
    """The targets of a set-up whose names are wrong, with the network where they are put right, or None."""
    found = trials.found
    most = min(_MOST_SUSPECTS, _SHARE * np.count_nonzero(found.book.observations.active))
    if not _LEAST <= len(found.suspects) <= most:
        return None
    choices = sorted(_of_one_point(found, list(_choices(found))), key=lambda one: -one.suspects)
    tried = [one for names in choices[: min(_MOST, trials.most)] if (one := _tried(trials, names))]
    if not tried:
        return None
    least = min(one.left for one in tried)
    equal = [one for one in tried if one.left <= least + _EQUAL]
    return any_of([_described(found, one.names) for one in equal]), equal[0].estimate


def is_told_by_names_alone(trials: Trials, step: tuple[GrossError, Estimate]) -> bool:
    """Whether no other cause need be tried: exchanged names of two known points may be those of a file."""
    error, corrected = step
    points = trials.found.points
    is_free = points.is_free[[points.index[name] for name in error.points]].all(axis=1)
    is_of_file = error.cause is Cause.SWAPPED_NAMES and not is_free.any()
    return trials.is_decisive(corrected) and not is_of_file


def _of_one_point(found: Estimate, choices: list[_Names]) -> list[_Names]:
    """The names without those of two known points that fit from several others: the file is wrong."""
    origins, is_free = found.book.observations.from_points, np.asarray(found.points.is_free.all(axis=1))
    points: dict[tuple[int, int, bool], set[int]] = {}
    for one in choices:
        points.setdefault((*one.pair, one.is_exchange), set()).add(int(origins[one.rows[0]]))
    return [
        one
        for one in choices
        if len(points[*one.pair, one.is_exchange]) == 1 or is_free[list(one.pair)].any()
    ]


def _choices(found: Estimate) -> Iterator[_Names]:
    """Names that fit sights in place of what is written, at each point with suspects."""
    observations = found.book.observations
    read = codes_for(Start.HZ, Start.ZENITH, Start.DISTANCE, Start.FLAT, Start.ANGLE)
    chosen = observations.active & np.isin(observations.types, read)
    suspects: BoolArray = np.asarray(chosen & (found.ratios > found.limit), np.bool_)
    for origin in np.unique(observations.from_points[suspects]).tolist():
        rows = np.flatnonzero(chosen & (observations.from_points == origin))
        blocks = [block for block in blocks_of(found.book, rows) if suspects[block].any()]
        set_ups = [_SetUp(block, _sights(found, block)) for block in blocks]
        names = [*_renamed(found, set_ups), *_exchanged(found, set_ups)]
        yield from (one for one in names if one.suspects)


def _sights(found: Estimate, rows: Rows) -> dict[int, list[_Sight]]:
    """The sights of a set-up by their targets.

    Where a target is written for two, the second observation of a kind is of the second sight.
    """
    observations, count = found.book.observations, Counter[tuple[int, int]]()
    sights: dict[tuple[int, int], list[int]] = {}
    for row in rows.tolist():
        seen = int(observations.to_points[row]), int(observations.types[row])
        sights.setdefault((seen[0], count[seen]), []).append(row)
        count[seen] += 1
    by_target: dict[int, list[_Sight]] = {}
    for (target, _), members in sights.items():
        by_target.setdefault(target, []).append(_Sight(np.array(members, np.intp), _fitting(found, members)))
    return by_target


def _fitting(found: Estimate, rows: list[int]) -> frozenset[int]:
    """The points that a sight fits: with distances these and zenith angles say it, which need no circle."""
    starts = [BY_CODE[int(found.book.observations.types[row])].start for row in rows]
    checks = rows
    if any(start in (Start.DISTANCE, Start.FLAT) for start in starts):
        checks = [
            row for row, start in zip(rows, starts, strict=True) if start not in (Start.HZ, Start.ANGLE)
        ]
    fits = substitutes(found, checks, End.TARGET, near=_NEAR)
    if fits is not None and fits.points:
        return frozenset(fits.points) if fits.chance <= _CHANCE else frozenset()
    if len(rows) < _WHOLE:
        return frozenset()
    near = near_approximate(found, rows, End.TARGET)
    return frozenset(np.flatnonzero(near == len(rows)).tolist())


def _renamed(found: Estimate, set_ups: list[_SetUp]) -> Iterator[_Names]:
    """One target under another name, in all sights that this fits; as backsight too, or as target alone."""
    fitting: dict[tuple[int, int], list[tuple[Rows, _SetUp]]] = {}
    for one in set_ups:
        for target, members in one.sights.items():
            for sight in members:
                for point in sight.fits:
                    fitting.setdefault((target, point), []).append((sight.rows, one))
    for pair, sights in fitting.items():
        rows, whole = [part for part, _ in sights], [one.rows for _, one in sights]
        names = _names(found, rows, whole, pair, is_exchange=False)
        yield names
        if len(names.backsights):
            yield _names(found, rows, [], pair, is_exchange=False)


def _exchanged(found: Estimate, set_ups: list[_SetUp]) -> Iterator[_Names]:
    """Two targets under each other's names, in all set-ups in which a sight to one of them fits the other."""
    rows: dict[tuple[int, int], list[Rows]] = {}
    whole: dict[tuple[int, int], list[Rows]] = {}
    for one in set_ups:
        for pair in itertools.combinations(sorted(one.sights), 2):
            if len(one.sights) <= _FEW or any(_fit(one.sights[a], b) for a, b in (pair, pair[::-1])):
                rows.setdefault(pair, []).extend(sight.rows for end in pair for sight in one.sights[end])
                whole.setdefault(pair, []).append(one.rows)
    for pair, parts in rows.items():
        yield _names(found, parts, whole[pair], pair, is_exchange=True)


def _fit(sights: list[_Sight], point: int) -> bool:
    return any(point in sight.fits for sight in sights)


def _names(
    found: Estimate, parts: list[Rows], set_ups: list[Rows], pair: tuple[int, int], *, is_exchange: bool
) -> _Names:
    rows, whole = np.concatenate(parts), np.unique(np.concatenate([np.zeros(0, np.intp), *set_ups]))
    written = pair if is_exchange else pair[:1]
    backsights = whole[np.isin(found.book.observations.backsights[whole], written)]
    suspects = int(np.count_nonzero(found.ratios[np.union1d(rows, backsights)] > found.limit))
    return _Names(rows, backsights, pair, is_exchange, suspects)


def _tried(trials: Trials, names: _Names) -> _Tried | None:
    """The network with other names, where that puts these sights right."""
    least = _GAIN * float(trials.found.contradictions(GROSS)[names.rows].sum())
    corrected = trials.put_right(_with(trials.found.book, names), names.rows, least)
    return None if corrected is None else _Tried(names, corrected.disagreement(GROSS), corrected)


def _with(book: FieldBook, names: _Names) -> FieldBook:
    """The observations with other targets, and these as backsights."""
    observations, right = book.observations, np.arange(len(book.point_names), dtype=np.int32)
    right[names.pair[0]] = names.pair[1]
    if names.is_exchange:
        right[names.pair[1]] = names.pair[0]
    targets, backsights = observations.to_points.copy(), observations.backsights.copy()
    targets[names.rows] = right[targets[names.rows]]
    backsights[names.backsights] = right[backsights[names.backsights]]
    return replace(book, observations=replace(observations, to_points=targets, backsights=backsights))


def _described(found: Estimate, names: _Names) -> GrossError:
    book, rows = found.book, names.rows
    origin = book.point_names[book.observations.from_points[rows[0]]]
    first, second = (found.points.names[row] for row in names.pair)
    listed = ", ".join(book.label(row) for row in rows.tolist())
    if len(rows) > _LISTED:
        to = f"{first} and {second}" if names.is_exchange else first
        listed = f"the {len(rows)} observations from {origin} to {to} (the first: {book.label(int(rows[0]))})"
    size = float(found.ratios[rows].max())
    if names.is_exchange:
        text = f"the names {first} and {second} of these targets are exchanged"
        return GrossError(listed, Cause.SWAPPED_NAMES, text, size, tuple(rows.tolist()), (first, second))
    fit = "it fits" if len(rows) == 1 else "they fit"
    text = f"{fit} {second}, not {first}: the name of the target is wrong"
    return GrossError(listed, Cause.WRONG_POINT, text, size, tuple(rows.tolist()), (first, second))
