"""Which reference points have moved: the smallest set without which the others agree, if one alone does that.

With weights ``W = Q^+`` of the displacements d of the reference points, a set S that may be anywhere takes
``(W d)_S' (W_SS)^- (W d)_S`` from ``d' W d``, and its rank from the degrees of freedom; what is left is the
congruence test of the others. Small sets are tried exhaustively, so that two points that moved do not hide
each other. Three points in a plane have three distances: the one that moved is told by the distance of the
other two, unless it moved across the distance to one of these. Then either may have moved, and if anything
tells, it is the other points, which would all have moved with the wrong one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from math import comb

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.records.comparison import TestRecord
from obseq.survey.epochs.congruence import RANK, Tester, determine, relative_to
from obseq.survey.epochs.displacements import Displacements

Rows = tuple[int, ...]

LEAST_SHARE = 0.5
"""Of the reference points must stay: otherwise nothing says which ones have moved."""
LEAST_STAYING = 2
"""Reference points that must stay, whatever their share."""
MOST_SETS = 2_000
"""Sets of one size that are tried; of more, those that hold the best of the size before."""
EQUAL = 9.0
"""Weighted squares by which sets may differ that explain a movement equally well: three sigmas."""
LEAST_OTHERS = 2
"""Points that must have moved beside a reference point, for it to be the less likely one."""


@dataclass(frozen=True)
class Moved:
    """The reference points that have moved.

    Attributes:
        sets: rows of the smallest sets without which the others agree, the best first; none where all agree.
        rejected: sets without which they agree too, but most other points would have moved.
        witnesses: how many these are at least, of how many.
    """

    sets: tuple[Rows, ...] = ()
    rejected: tuple[Rows, ...] = ()
    witnesses: tuple[int, int] = (0, 0)

    @property
    def certain(self) -> Rows:
        """Rows that all sets have, in the order of the best."""
        return tuple(row for row in self.sets[0] if all(row in one for one in self.sets)) if self.sets else ()

    @property
    def undecided(self) -> Rows:
        """Rows that some of the sets have."""
        return tuple(sorted({row for one in self.sets for row in one} - set(self.certain)))


@dataclass(frozen=True, eq=False)
class _Pulls:
    """Reference points that do not agree.

    Attributes:
        rows: of the points.
        weights: (3 r, 3 r) W.
        pulls: (3 r,) W d.
        squares: d' W d, for sigma0 of the epochs.
        freedom: its degrees of freedom.
        factor: the variance factor.
    """

    rows: Rows
    weights: FloatArray
    pulls: FloatArray
    squares: float
    freedom: int
    factor: float

    @classmethod
    def of(cls, moved: Displacements, rows: Rows, factor: float) -> _Pulls:
        """Those of displacements relative to the points themselves."""
        own = np.concatenate([np.arange(3 * row, 3 * row + 3) for row in rows])
        weights, rank = _inverse(moved.cofactors[np.ix_(own, own)])
        vector = moved.vectors.ravel()[own]
        pulls = weights @ vector
        return cls(rows, weights, pulls, float(vector @ pulls) / factor, rank, factor)

    def without(self, chosen: Iterable[int]) -> tuple[float, int]:
        """The weighted squares left without some of the points (places in `rows`), and their freedom."""
        own = np.concatenate([np.arange(3 * k, 3 * k + 3) for k in chosen])
        inverse, rank = _inverse(self.weights[np.ix_(own, own)])
        taken = float(self.pulls[own] @ inverse @ self.pulls[own]) / self.factor
        return max(self.squares - taken, 0.0), self.freedom - rank


def _inverse(matrix: FloatArray) -> tuple[FloatArray, int]:
    """The pseudo-inverse of a symmetric matrix, and its rank."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > RANK * max(float(values[-1]), 0.0)
    return np.asarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T), int(np.count_nonzero(kept))


def moved_references(
    moved: Displacements, reference: BoolArray, tester: Tester, motions: FloatArray
) -> Moved:
    """The sets of reference points (a mask) one of which has moved, as far as anything tells.

    Args:
        moved: the displacements.
        reference: the points.
        tester: of the level.
        motions: (3 n, q) by which the epochs are fitted together.

    Raises:
        InputError: so many have moved that nothing says which ones.
    """
    found = _between_themselves(moved, reference, tester, motions)
    return _by_others(found, moved, reference, tester, motions)


def _between_themselves(
    moved: Displacements, reference: BoolArray, tester: Tester, motions: FloatArray
) -> Moved:
    """The sets of reference points without any of which the others agree."""
    rows = tuple(np.flatnonzero(reference).tolist())
    now = _Pulls.of(relative_to(moved, reference, motions), rows, tester.variance_factor)
    if now.freedom < 1 or tester.judged(now.squares / now.freedom, now.freedom).passed:
        return Moved()
    most = len(rows) - max(LEAST_STAYING, int(np.ceil(LEAST_SHARE * len(rows))))
    best: Rows = ()
    for size in range(1, most + 1):
        left = {one: now.without(one) for one in _sets(len(rows), size, best)}
        left = {one: found for one, found in left.items() if _determined(motions, rows, one, found[1])}
        if not left:
            break
        found = _equal(left, tester)
        if found:
            return Moved(tuple(_worst_first(now, one) for one in found))
        best = min(left, key=lambda one: left[one][0])
    names = ", ".join(moved.names[rows[k]] for k in best)
    raise _none_agree(names)


def _none_agree(names: str) -> InputError:
    without = f" even without {names}: more than half have moved" if names else ": some have moved"
    return InputError(
        f"compare: the reference points do not agree{without}, or the sigmas are too small; name "
        "reference points that have stayed, or more of them (--reference)"
    )


def _sets(count: int, size: int, best: Rows) -> Iterable[Rows]:
    """The sets of a size (places among the points), or those that hold the best of the size before."""
    if comb(count, size) <= MOST_SETS:
        return combinations(range(count), size)
    return ((*best, k) for k in range(count) if k not in best)


def _determined(motions: FloatArray, rows: Rows, one: Rows, freedom: int) -> bool:
    """Whether the points beside a set control one another, and determine how the epochs are fitted."""
    if freedom < 1:
        return False
    staying = np.zeros(len(motions) // 3, np.bool_)
    staying[[row for k, row in enumerate(rows) if k not in one]] = True
    return determine(motions, staying)


def _equal(left: dict[Rows, tuple[float, int]], tester: Tester) -> list[Rows]:
    """The sets without which the others agree, or nearly as well as without the best, which is first."""
    tests: dict[Rows, TestRecord] = {
        one: tester.judged(squares / freedom, freedom) for one, (squares, freedom) in left.items()
    }
    if not any(test.passed for test in tests.values()):
        return []
    least = min(left[one][0] for one, test in tests.items() if test.passed)
    equal = [one for one, (squares, _) in left.items() if squares <= least + EQUAL]
    return sorted(equal, key=lambda one: (not tests[one].passed, left[one][0]))


def _worst_first(now: _Pulls, one: Rows) -> Rows:
    """Rows of the points of a set, first the one that explains most."""
    return tuple(now.rows[k] for k in sorted(one, key=lambda k: now.without((k,))[0]))


def _by_others(
    found: Moved,
    moved: Displacements,
    reference: BoolArray,
    tester: Tester,
    motions: FloatArray,
) -> Moved:
    """What the other points say where the reference points do not tell which of them have moved.

    Of two sets, the one is wrong by which most of the other points would have moved as well, where most of
    them have stayed by the other. One reference point that moved by so little, or so, that they agree between
    themselves may do that, too.
    """
    if len(found.sets) == 1:
        return found
    sets = found.sets or ((),)
    counts = [_moving(moved, reference, one, tester, motions) for one in sets]
    if not found.sets and 2 * counts[0][0] > counts[0][1]:
        sets = ((), *_singles(reference, motions))
        counts += [_moving(moved, reference, one, tester, motions) for one in sets[1:]]
    moving, others = (np.array(column) for column in zip(*counts, strict=True))
    is_likely = 2 * moving < others
    if is_likely.all() or not is_likely.any() or (found.sets and is_likely.sum() > 1):
        return found
    most = int(moving[~is_likely].min())
    likely = np.flatnonzero(is_likely & (moving + LEAST_OTHERS <= most))
    if not likely.size:
        return found
    rejected = tuple(sets[k] for k in np.flatnonzero(~is_likely).tolist())
    return Moved(tuple(sets[k] for k in likely.tolist()), rejected, (most, int(others[likely[0]])))


def _singles(reference: BoolArray, motions: FloatArray) -> Iterable[Rows]:
    """The reference points without which others still determine how the epochs are fitted together."""
    rows = tuple(np.flatnonzero(reference).tolist())
    if len(rows) <= LEAST_STAYING:
        return ()
    return ((row,) for k, row in enumerate(rows) if _determined(motions, rows, (k,), 1))


def _moving(
    moved: Displacements, reference: BoolArray, one: Sequence[int], tester: Tester, motions: FloatArray
) -> tuple[int, int]:
    """How many of the points that are no reference points have moved if a set has, and how many there are."""
    staying = reference.copy()
    staying[list(one)] = False
    now = relative_to(moved, staying, motions)
    tests = [tester.of(now.vectors[row], now.block(row)) for row in np.flatnonzero(~reference).tolist()]
    judged = [test for test in tests if test is not None]
    return sum(not test.passed for test in judged), len(judged)
