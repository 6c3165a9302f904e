"""Names that look mistyped: known points that nothing observes, and points nearly of the name of another.

A name alone says little where points are called P1, P2 and so on: what is said rests on where the points are,
or on what the observations would have been, and on names only where these say nothing.
"""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.printable import listed
from obseq.survey.kinds.kind import Start
from obseq.survey.kinds.registry import among, codes_for

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.records.adjustment import LeftOutRecord
    from obseq.report.tables.units import Scale, Units
    from obseq.survey.adjustment.adjusted_records import AdjustedPoints
    from obseq.survey.model import FieldBook, Points

_LOOK_ALIKE = str.maketrans("OQILZSB", "0011258")
_FARTHEST = 0.5
"""Distance (m) beyond which two points are never one."""
_LEAST_PRECISION = 0.001
"""Precision (m) that a place has at best when points are compared."""
_SAME = 5.0
"""Standard deviations within which two points of nearly one name are taken for one."""
_GROSS = 10.0
"""Standard deviations within which a point lies at a place that it was adjusted to."""
_LONG = 4
"""Letters from which one wrong letter makes names alike where nothing but names is compared."""
_MOST = 20
"""Left out points of which it is asked what they may be, unused points that are named."""


def are_alike(a: str, b: str) -> bool:
    """Whether one name is another with one slip: capitals, look-alike letters, marks, or one letter.

    >>> are_alike("P1Z", "p12"), are_alike("P.01", "P1"), are_alike("P12", "P21"), are_alike("P1", "P23")
    (True, True, True, False)
    """
    return look_alike(a, b) or _differ_by_one(a, b)


def look_alike(a: str, b: str) -> bool:
    """Whether two names are the same to somebody who reads them quickly."""
    return _folded(a) == _folded(b)


def _folded(name: str) -> str:
    plain = re.sub(r"[\s._\-/]", "", name.upper()).translate(_LOOK_ALIKE)
    return re.sub(r"(?<!\d)0+(?=\d)", "", plain)


def _differ_by_one(a: str, b: str) -> bool:
    """Whether one letter was changed, added or dropped, or two neighbours exchanged."""
    start = next((k for k, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
    rest_a, rest_b = a[start:], b[start:]
    one = rest_a[1:] == rest_b[1:] or rest_a[1:] == rest_b or rest_a == rest_b[1:]
    return one or (rest_a[:2] == rest_b[1::-1] and rest_a[2:] == rest_b[2:])


def unused_known(points: Points, book: FieldBook) -> list[int]:
    """Rows of the known points that no active observation names."""
    n = len(points)
    named = book.counts(book.observations.active, n) > 0
    backsights = book.observations.backsights[book.observations.active]
    named[backsights[(backsights >= 0) & (backsights < n)]] = True
    is_known = ~points.is_free.all(axis=1)
    return np.flatnonzero(is_known & ~named).tolist()


def advice(points: Points, book: FieldBook) -> str:
    """What names alone say where a network cannot be computed; empty where nothing looks mistyped."""
    told = [
        f"known point {points.names[row]} ({points.place(row)}) is in no observation; did these mean "
        f"{' or '.join(alike)}?"
        for row in unused_known(points, book)[:_MOST]
        if (alike := _named_only_by_observations(points, points.names[row]))
    ]
    return "\n".join(told)


def _named_only_by_observations(points: Points, name: str) -> list[str]:
    """Points that no file gives, with names that may be this one."""
    return [
        other
        for other, file in zip(points.names, points.file_indices.tolist(), strict=True)
        if file < 0 and (look_alike(name, other) or (len(name) >= _LONG and are_alike(name, other)))
    ]


def mistyped_names(
    units: Units,
    points: Points,
    book: FieldBook,
    adjusted: AdjustedPoints,
    left_out: tuple[LeftOutRecord, ...],
) -> tuple[list[str], list[str]]:
    """Warnings of names that look mistyped, and notes of what stands in no observation.

    Args:
        units: of what is told.
        points: of the network.
        book: its observations, all of them.
        adjusted: the points as they were adjusted.
        left_out: what was left out of the adjustment.
    """
    unused, small = unused_known(points, book), units.small_length
    tell = partial(_of_unused, points, adjusted=adjusted, left_out=left_out, small=small)
    explained = {row: text for row in unused[:_MOST] if (text := tell(row))}
    unused_names = {points.names[row] for row in unused}
    rest = [points.names[row] for row in unused if row not in explained]
    warnings = [
        *explained.values(),
        *_of_left_out(points, book, adjusted, left_out),
        *_doubles(adjusted, unused_names, small),
    ]
    return warnings, [_nothing_sees(rest)] if rest else []


def _nothing_sees(names: list[str]) -> str:
    one = len(names) == 1
    subject, verb = ("known point is", "controls") if one else ("known points are", "control")
    return f"{len(names)} {subject} in no observation, and {verb} nothing: {listed(names, _MOST)}"


def _of_unused(
    points: Points, row: int, adjusted: AdjustedPoints, left_out: tuple[LeftOutRecord, ...], small: Scale
) -> str | None:
    """What observations may call a known point that is in none of them."""
    name = points.names[row]
    start = f"known point {name} ({points.place(row)}) is in no observation"
    near = _at(points, row, adjusted)
    if near is not None:
        other, distance = near
        return (
            f"{start}; {other}, which is adjusted as an unknown point, lies {small.text(distance)} from it: "
            f"likely the name is mistyped in one of the files"
        )
    gone = {item.name for item in left_out}
    alike = [other for other in _named_only_by_observations(points, name) if other in gone]
    return f"{start}; did these mean {' or '.join(alike)}?" if alike else None


def _at(points: Points, row: int, adjusted: AdjustedPoints) -> tuple[str, float] | None:
    """The unknown point that was adjusted to the place of a known one, and its distance (m)."""
    there = points.coordinates[row]
    free = adjusted.points.is_free.all(axis=1)
    names = np.array([other != points.names[row] for other in adjusted.names])
    gaps = np.where(np.isfinite(there), adjusted.places - there, 0.0)
    if not np.isfinite(there).all():
        return None
    distances = np.linalg.norm(gaps, axis=1)
    own = float(np.nan_to_num(np.nanmax(points.sigmas[row])))
    limits = np.minimum(_GROSS * np.hypot(_precisions(adjusted), own), _FARTHEST)
    found = np.flatnonzero(free & names & (distances <= limits))
    return (adjusted.names[int(found[0])], float(distances[found[0]])) if len(found) == 1 else None


def _precisions(adjusted: AdjustedPoints) -> FloatArray:
    """(n,) the largest standard deviation of each point."""
    return np.asarray(np.maximum(np.nan_to_num(adjusted.precisions).max(axis=1), _LEAST_PRECISION))


def _pairs_within(places: FloatArray, radius: float) -> IntArray:
    """(k, 2) pairs of points no farther apart, in order: neighbours along the longest axis, step by step."""
    axis = int(np.ptp(places, axis=0).argmax()) if len(places) else 0
    order = places[:, axis].argsort(kind="stable")
    along, first, step = places[order], np.arange(len(places) - 1), 1
    found = [np.zeros((2, 0), dtype=np.int64)]
    while len(first):
        apart = along[first + step] - along[first]
        near = apart[:, axis] <= radius
        first, apart = first[near], apart[near]
        close = first[np.square(apart).sum(axis=1) <= radius**2]
        found.append(order[np.array([close, close + step])])
        step += 1
        first = first[: np.searchsorted(first, len(places) - step)]
    pairs = np.sort(np.concatenate(found, axis=1), axis=0)
    return np.asarray(pairs[:, np.lexsort(pairs[::-1])].T)


def _doubles(adjusted: AdjustedPoints, unused: set[str], small: Scale) -> Iterator[str]:
    """Points of nearly one name at one place, at least one of them unknown."""
    precisions = _precisions(adjusted)
    free = np.asarray(adjusted.points.is_free.all(axis=1), np.bool_)
    radius = min(_SAME * 2.0 * float(precisions.max(initial=0.0)), _FARTHEST)
    places = np.where(np.isfinite(adjusted.places), adjusted.places, 0.0)
    one, other = _pairs_within(places, radius).T
    distances = np.linalg.norm(places[one] - places[other], axis=1)
    is_one = distances <= _SAME * np.hypot(precisions[one], precisions[other])
    all_names = adjusted.names
    for pair in np.flatnonzero(is_one & (free[one] | free[other])).tolist():
        names, distance = (all_names[one[pair]], all_names[other[pair]]), float(distances[pair])
        if not unused & {*names} and are_alike(*names):
            first, second = names if free[one[pair]] else names[::-1]
            yield (
                f"{first} and {second} are adjusted as two points {small.text(distance)} apart: likely "
                "one point under two names"
            )


def _of_left_out(
    points: Points, book: FieldBook, adjusted: AdjustedPoints, left_out: tuple[LeftOutRecord, ...]
) -> Iterator[str]:
    """Points that observations to left out ones fit, where their names are alike."""
    names = [item.name for item in left_out if item.what.startswith("point ")][:_MOST]
    yield from _of_unnamed(points, book, names)
    for name in names:
        meant = [
            other for other in adjusted.names if are_alike(name, other) and _fits(book, adjusted, name, other)
        ]
        if len(meant) == 1:
            yield f"{name}: did you mean {meant[0]}? The observations to {name} fit it"


def _fits(book: FieldBook, adjusted: AdjustedPoints, name: str, other: str) -> bool:
    """Whether all distances to a point, and there are some, are those to another one."""
    rows, place = book.observations, dict(zip(adjusted.names, adjusted.places, strict=True))
    chosen = rows.active & (rows.to_points == book.point_names.index(name))
    chosen &= among(rows.types, codes_for(Start.DISTANCE))
    if not chosen.any():
        return False
    for row in np.flatnonzero(chosen).tolist():
        origin = place.get(book.point_names[rows.from_points[row]])
        if origin is None:
            return False
        sight = place[other] - origin + [0.0, 0.0, rows.to_heights[row] - rows.from_heights[row]]
        if abs(float(np.linalg.norm(sight)) - rows.values[row]) > _GROSS * max(
            rows.sigmas[row], _LEAST_PRECISION
        ):
            return False
    return True


def _of_unnamed(points: Points, book: FieldBook, names: list[str]) -> Iterator[str]:
    """Approximate coordinates that no observation uses, where it names a point that looks like theirs."""
    counts = book.counts(book.observations.active, len(points))
    for name in names:
        row = points.index[name]
        alike = [
            other
            for other in _named_only_by_observations(points, name)
            if look_alike(name, other) and counts[points.index[other]]
        ]
        if alike and not counts[row]:
            yield f"{name} ({points.place(row)}) is in no observation; did these mean {' or '.join(alike)}?"
