"""Observations that repeat earlier ones to the last digit: runs and single ones are told."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.survey.kinds.registry import IS_ANGLE
from obseq.survey.model import FieldBook, GroupKind

SHORTEST_RUN = 3
"""Equal observations in a row of which something is said."""
LEAST_CHANCE, LEAST_SINGLE_CHANCE = 1e-3, 0.02
"""Chance that as many honest repetitions come out equal, from which they are such: in a row, single ones."""
SHOWN = 3
"""Single ones that are named."""
_UNITS = {True: (math.pi / 200.0, math.pi / 180.0, math.pi / 648000.0), False: (1.0,)}
"""In which values are written, by whether they are angles (rad, m)."""
_DECIMALS = 7


def repetitions(book: FieldBook) -> tuple[str, ...]:
    """Sentences about observations that repeat earlier ones to the last digit: in a row, and single ones.

    Honest repeated readings may be equal, in particular where values are rounded coarsely: nothing is said
    of runs that such readings would show with a chance of more than `LEAST_CHANCE`, nor of as many single
    ones as they would show with a chance of more than `LEAST_SINGLE_CHANCE`.
    """
    rows = np.flatnonzero(book.observations.active & ~book.in_groups(GroupKind.UNKNOWNS))
    back = _back(_labels(book, rows))
    if not back.any():
        return ()
    chances = _log_chances(book, rows)
    runs = [run for run in _runs(back) if chances[run[0]].sum() < math.log(LEAST_CHANCE)]
    for again, _ in runs:
        back[again] = 0
    _keep_whole_sights(book, rows, back)
    return (*_of_runs(book, rows, runs), *_of_single_ones(book, rows, back, np.exp(chances)))


def _keep_whole_sights(book: FieldBook, rows: IntArray, back: IntArray) -> None:
    """Leaves of single repetitions those that say something.

    Instruments repeat a distance to its last digit, and circles are set to zero: where a sight has angles, it
    is repeated when an angle of it is, which nobody has set, as far back as the distance. A line that is
    doubled at once is told.
    """
    found, again = book.observations, back > 0
    is_angle = IS_ANGLE[found.types[rows]]
    again &= ~(is_angle & (found.values[rows] == 0.0))
    ends = found.from_points[rows].astype(np.int64) << 32 | found.to_points[rows]
    angles = set(zip(ends[is_angle & again].tolist(), back[is_angle & again].tolist(), strict=True))
    alone = [pair not in angles for pair in zip(ends.tolist(), back.tolist(), strict=True)]
    silent = np.isin(ends, ends[is_angle]) & np.array(alone, np.bool_) & (back > 1)
    back[~again | silent] = 0


def _of_runs(book: FieldBook, rows: IntArray, runs: list[tuple[IntArray, IntArray]]) -> Iterator[str]:
    """What is said of runs, at most one sentence."""
    if not runs:
        return
    count = sum(len(again) for again, _ in runs)
    again, before = (rows[places] for places in max(runs, key=lambda run: len(run[0])))
    yield (
        f"{count} observations repeat earlier ones in the same order and to the last digit, and count twice: "
        f"{book.place(int(again[0]))} to {book.place(int(again[-1]))} those from "
        f"{book.place(int(before[0]))} to {book.place(int(before[-1]))}. If they are the same readings, take "
        "them out: the precisions are too good by a factor of up to 1.4"
    )


def _of_single_ones(book: FieldBook, rows: IntArray, back: IntArray, chances: FloatArray) -> Iterator[str]:
    """What is said of single observations that repeat earlier ones, at most one sentence."""
    again = np.flatnonzero(back)
    if not again.size or _chance_of(again.size, _expected(book, rows, chances)) > LEAST_SINGLE_CHANCE:
        return
    pairs = zip(rows[again[:SHOWN]].tolist(), rows[(again - back[again])[:SHOWN]].tolist(), strict=True)
    told = ", ".join(f"{book.place(row)} as {book.place(before)}" for row, before in pairs)
    more = f" and {again.size - SHOWN} more" if again.size > SHOWN else ""
    yield (
        f"observations that repeat an earlier one to the last digit: {again.size} ({told}{more}). Two "
        "measurements seldom agree so well: one that was typed or copied again counts twice; take it out"
    )


def _expected(book: FieldBook, rows: IntArray, chances: FloatArray) -> float:
    """How many observations honest repetitions would make equal to an earlier one."""
    found = book.observations
    between = np.column_stack(
        [part[rows] for part in (found.types, found.from_points, found.to_points, found.backsights)]
    )
    _, group = np.unique(between, axis=0, return_inverse=True)
    order = np.argsort(group, kind="stable")
    starts = np.flatnonzero(np.diff(group[order], prepend=-1))
    earlier = np.arange(len(rows)) - np.repeat(starts, np.diff(np.append(starts, len(rows))))
    return float(np.minimum(earlier * chances[order], 1.0).sum())


def _chance_of(count: int, expected: float) -> float:
    """The chance of as many or more where so many are expected (Poisson), or a bound above it."""
    if count > expected > 0.0 and count > SHOWN:
        return math.exp(min(count - expected + count * math.log(expected / count), 0.0))
    fewer = sum(expected**k / math.factorial(k) for k in range(min(count, SHOWN)))
    return 1.0 - math.exp(-expected) * fewer


def _labels(book: FieldBook, rows: IntArray) -> IntArray:
    """(n,) numbers that are equal for observations that are equal in everything but their place."""
    found = book.observations
    parts = (
        found.types,
        found.from_points,
        found.to_points,
        found.backsights,
        found.values,
        found.sigmas,
        found.relative_sigmas,
        found.from_heights,
        found.to_heights,
    )
    table = np.column_stack([part[rows] for part in parts]).astype(np.float64) + 0.0  # no zero is negative
    seen: dict[bytes, int] = {}
    return np.array([seen.setdefault(row.tobytes(), len(seen)) for row in table], np.int64)


def _back(labels: IntArray) -> IntArray:
    """(n,) how many places before each the last equal one is; 0 for none."""
    order = np.argsort(labels, kind="stable")
    same = labels[order[1:]] == labels[order[:-1]]
    back = np.zeros(len(labels), np.int64)
    back[order[1:][same]] = (order[1:] - order[:-1])[same]
    return back


def _runs(back: IntArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Places in a row that repeat earlier places in a row; and these."""
    again = np.flatnonzero(back)
    breaks = np.flatnonzero((np.diff(again) != 1) | (np.diff(back[again]) != 0)) + 1
    for run in np.split(again, breaks):
        if len(run) >= SHORTEST_RUN:
            yield run, run - back[run]


def _log_chances(book: FieldBook, rows: IntArray) -> FloatArray:
    """(n,) logarithms of the chance that an honest repetition of each observation is equal to it.

    Two values with normal errors of `sigma`, rounded to steps of r, are equal with a chance of about
    r / (2 sqrt(pi) sigma); a value of 0 is one that somebody set.
    """
    values, sigmas = book.observations.values[rows], book.observations.sigmas[rows]
    is_angle = IS_ANGLE[book.observations.types[rows]]
    chances = np.ones(len(rows))
    for kind, units in _UNITS.items():
        these = np.flatnonzero((is_angle == kind) & (values != 0.0))
        step = max((_step(values[these] / unit) * unit for unit in units), default=0.0)
        chances[these] = step / (2.0 * math.sqrt(math.pi) * sigmas[these])
    return np.asarray(np.log(np.clip(chances, 1e-12, 1.0)))


def _step(values: FloatArray) -> float:
    """What all values are written to multiples of, among powers of ten."""
    for decimals in range(_DECIMALS):
        scaled = values * 10.0**decimals
        if (np.abs(scaled - np.round(scaled)) <= 1e-12 * np.maximum(np.abs(scaled), 1.0) + 1e-9).all():
            return 10.0**-decimals
    return 10.0**-_DECIMALS
