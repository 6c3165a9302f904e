"""Which observation one gross error is suspected in, when it explains what the sigmas do not."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from obseq.leastsquares.statistics.hypothesis_tests import overall_level
from obseq.leastsquares.statistics.joint_levels import (
    POWER,
    joint_critical,
    joint_limit_by_others,
    joint_p_value,
    shared_level,
)
from obseq.records.quality import KNOWN, SuspicionRecord
from obseq.survey.adjustment.joint_groups import (
    joint_record,
    turned_cause,
    upright_cause,
    vector_numbers,
)
from obseq.survey.adjustment.known_coordinates import COMPONENTS
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.survey.adjustment.adjusted_quality import AdjustedQuality
    from obseq.survey.adjustment.joint_groups import TestedJointly
    from obseq.survey.adjustment.known_coordinates import CoordinateResiduals
    from obseq.survey.model import FieldBook, Points

_LEVEL = 0.001
"""Probability that an observation is suspected where nothing is wrong."""
_EXCLUDED = 0.05
"""Probability of such an observation where all sigmas are too small, below which that is excluded."""
_SAME = 1e-6
"""Relative difference below which two standardised residuals cannot be told apart."""
_AS_GOOD = 0.25
"""Weighted squares by which one explanation must be better than another to be told from it at all."""


def suspected(
    standardised: FloatArray, squares: float, redundancy: int, degrees: IntArray | None = None
) -> list[int]:
    """The observations one of which has a gross error: those farthest beyond their limit, if that is so.

    All tests share the level, and have the same power for one error (`shared_level`); what remains without an
    observation raises its limit where the sigmas do not explain it (`joint_limit_by_others`).

    Args:
        standardised: (n,) residuals over their own a priori standard deviations, roots of the statistic T of
            what is tested as one; NaN where not tested.
        squares: Weighted sum of squares of all residuals.
        redundancy: Its degrees of freedom.
        degrees: (n,) of T; 1 for all when None.

    Returns:
        Rows; several where they are as far beyond, none where nothing is suspected.
    """
    freedom = np.ones(len(standardised), np.int64) if degrees is None else degrees
    seen = np.flatnonzero(np.isfinite(standardised) & (freedom < redundancy))
    if not len(seen):
        return []
    level = shared_level(_LEVEL, Counter(freedom[seen].tolist()), POWER)
    limits = np.array([joint_critical(level, POWER, one) for one in freedom[seen].tolist()])
    shares = np.square(standardised[seen]) / limits
    at = int(np.argmax(shares))
    worst, own = float(standardised[seen[at]] ** 2), int(freedom[seen[at]])
    if worst <= joint_limit_by_others(worst, own, squares, redundancy, level, POWER):
        return []
    same = shares >= shares[at] * (1.0 - _SAME) ** 2
    same |= (freedom[seen] == own) & (np.square(standardised[seen]) > worst - _AS_GOOD)
    return sorted(seen[same].tolist(), key=lambda row: row != seen[at])


def suspicion(
    solution: LeastSquaresResult,
    quality: AdjustedQuality,
    book: FieldBook,
    points: Points,
    known: CoordinateResiduals,
) -> SuspicionRecord | None:
    """What one gross error is suspected in; None for nothing, or where reliability was not asked for."""
    judged = [part for part in (quality.observations, quality.known) if part is not None]
    if not judged or not solution.variance_factor:
        return None
    alone = np.concatenate([part.standardised for part in judged])
    for test in quality.joint:
        alone[test.rows] = np.nan
    tests = quality.joint
    standardised = np.r_[alone, [test.statistic**0.5 for test in tests], [test.rise_test for test in tests]]
    degrees = np.r_[np.ones(len(alone)), [test.degrees for test in tests], np.ones(len(tests))]
    squares = solution.variance_factor * solution.redundancy
    rows = suspected(standardised, squares, solution.redundancy, degrees.astype(np.int64))
    if not rows:
        return None
    joint = [tests[(row - len(alone)) % len(tests)] if row >= len(alone) else None for row in rows]
    named = (
        _name(row, book, points, known)
        if test is None
        else joint_record(test, (_LEVEL, POWER), book, points, known).name
        for row, test in zip(rows, joint, strict=True)
    )
    names, first, vector = tuple(dict.fromkeys(named)), rows[0], joint[0]
    statistic, own = float(standardised[first]), int(degrees[first])
    chance = joint_p_value(statistic**2 / solution.variance_factor, own, solution.redundancy)
    tested = int(np.count_nonzero(np.isfinite(standardised)))
    may_be_sigmas = bool(overall_level(chance, tested) > _EXCLUDED)
    others = (_instead(test, row, book, points, known) for row, test in zip(rows, joint, strict=True))
    instead = next(filter(None, others), "")
    if vector is not None:
        found = _of_vector(vector, names, statistic, own, book, instead)
    else:
        blunder = float(np.concatenate([part.blunder for part in judged])[first])
        found = SuspicionRecord(names, statistic, blunder, _unit(first, book), cause=instead)
    return structs.replace(found, may_be_sigmas=may_be_sigmas)


def _instead(
    test: TestedJointly | None, row: int, book: FieldBook, points: Points, known: CoordinateResiduals
) -> str:
    """What explains as much as a vector at a free point, or a known coordinate: all others there together.

    Where nothing else is observed there, a point moves with them. So does a known point of one vector.
    """
    n, own, whole = len(book.observations), -1, list[int]()
    ends = [int(known.points[row - n])] if test is None and row >= n else []
    if test is not None and int(test.rows[0]) < n:
        own = int(test.rows[0])
        both = [int(end[own]) for end in (book.observations.from_points, book.observations.to_points)]
        ends = [end for end in dict.fromkeys(both) if points.is_free[end].all()]
        whole = [end for end in both if not points.is_free[end].any() and _is_alone(book, end, own)]
    told = [
        f"all the {count} {'other ' if own >= 0 else ''}vectors at {book.point_names[end]} together"
        for end in ends
        if (count := _of_one_occupation(book, end, own))
    ]
    if whole:
        names = " or ".join(f"known point {points.names[end]} ({points.place(end)})" for end in whole)
        return f"(or {names}, of which nothing else is observed: nothing tells these apart)"
    return f"(or, as much the other way, {' or '.join(told)}: nothing tells these apart)" if told else ""


def _is_alone(book: FieldBook, point: int, own: int) -> bool:
    """Whether the vector of a row is all that is observed of a point."""
    named, numbers = np.arange(len(book.point_names)) == point, vector_numbers(book)
    seen = book.naming(named) & book.observations.active
    return bool((numbers[seen] == numbers[own]).all())


def _of_one_occupation(book: FieldBook, point: int, own: int) -> int:
    """How many vectors but that of a row are at a point; 0 where they are apart in the files, or alone."""
    observations, named = book.observations, np.zeros(len(book.point_names), np.bool_)
    named[point] = True
    rows = np.flatnonzero(book.naming(named) & observations.active)
    numbers = vector_numbers(book)
    is_vector = (numbers[rows] >= 0) & (observations.from_points[rows] != observations.to_points[rows])
    found = np.unique(numbers[rows])
    found = found[found != numbers[own]] if own >= 0 else found
    is_one = bool(is_vector.all()) and len(found) > 1 and int(np.ptp(found)) == len(found) - 1
    return len(found) if is_one else 0


def _of_vector(
    test: TestedJointly, names: tuple[str, ...], statistic: float, degrees: int, book: FieldBook, instead: str
) -> SuspicionRecord:
    """A vector, or a position, that is suspected as a whole or for its height."""
    turned, upright = turned_cause(test, book), upright_cause(test, book)
    size = test.rise if upright else float(np.linalg.norm(test.blunder))
    cause = turned or " ".join(filter(None, (upright, instead)))
    return SuspicionRecord(names, statistic, size, "m", degrees, tuple(test.blunder.tolist()), cause)


def _name(row: int, book: FieldBook, points: Points, known: CoordinateResiduals) -> str:
    count = len(book.observations)
    if row < count:
        return book.label(row)
    k = row - count
    point, component = int(known.points[k]), COMPONENTS[int(known.components[k])]
    file = points.file_indices[point]
    place = f" ({points.files[file]}:{points.lines[point]})" if file >= 0 else ""
    return f"{KNOWN}{component} of {points.names[point]}{place}"


def _unit(row: int, book: FieldBook) -> str:
    return BY_CODE[int(book.observations.types[row])].unit if row < len(book.observations) else "m"
