"""Offsets that several observations share, where an adjustment is rejected: tested as more unknowns.

A robust estimate lets heights and places take up part of an offset that many sights share, and what is left
looks like many errors, or like noise larger than the sigmas. In the adjustment it is one unknown more, and
the one with which the adjustment is accepted is the cause. A known point that is elsewhere is tested
likewise: without its coordinates. Where no cause is enough by itself, two are tested together; they are
told where the adjustment is accepted with them, where neither can be spared, and where no other two explain
nearly as much.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.statistics.joint_levels import POWER, joint_critical, joint_p_value
from obseq.survey.screening.added_unknowns import AddedUnknowns
from obseq.survey.screening.contradictions import contradiction, independent, vectors_of
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.offset_effects import Sights, What
from obseq.survey.screening.offsets import LARGEST, Offset, described, is_possible, sharing
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.screening.contradictions import Contradiction
    from obseq.survey.screening.robust import Estimate, Model

    Rows = np.ndarray[tuple[int], np.dtype[np.intp]]

_LARGEST = 6_000
"""Observations up to which this is tried."""
_LEVEL = 0.001
"""Probability that anything is found where nothing is wrong, and where the sigmas are too small."""
_LEAST = 3
"""Observations from which an offset that they share is told from errors of their own."""
_BETTER = 9.0
"""Weighted squares by which it must be better than one gross error."""
_EQUAL = 4.0
"""Weighted squares by which causes may differ that explain a network equally well."""
_MOST = 3
"""Causes that are told."""
_FEW = 2
"""Gross errors of observations that two causes explain no better."""
_FIRST = 30
"""Causes, the best by themselves, of which one must be among two."""
_TOGETHER = ", where what else is named here is corrected"
_STEP = 1e-4
"""By what the effect of an offset is found (m, rad)."""


@dataclass(frozen=True, eq=False)
class _Cause:
    """What may be wrong.

    Attributes:
        columns: of the unknowns that it adds.
        what: what is shared; None for a known point.
        rows: the sights, or the known coordinates.
        is_alone: whether it is tried by itself, too: one known coordinate and all distances are elsewhere.
        point: the known point; -1 for an offset.
    """

    columns: tuple[int, ...]
    what: What | None
    rows: Rows | IntArray
    is_alone: bool = True
    point: int = -1

    def is_same(self, other: _Cause) -> bool:
        """Whether both are of one known point, or one offset."""
        return self.columns == other.columns or self.point == other.point >= 0


@dataclass(frozen=True, eq=False)
class _Tests:
    """A rejected adjustment with what may be wrong in it.

    Attributes:
        found: the adjustment.
        estimate: the network that it came from, where it was adjusted.
        causes: all of them.
        unknowns: their tests.
    """

    found: Contradiction
    estimate: Estimate
    causes: tuple[_Cause, ...]
    unknowns: AddedUnknowns

    @classmethod
    def of(cls, found: Contradiction, estimate: Estimate) -> _Tests:
        """Every offset that sights may share, and every known point."""
        sights, known = Sights.of(estimate), independent(found)
        groups = list(_groups(estimate, sights))
        columns = np.zeros((len(estimate.book.observations), len(groups)))
        for k, (what, rows, _) in enumerate(groups):
            columns[rows, k] = sights.change(what, rows)(_STEP) / _STEP
        offsets = [_Cause((k,), what, rows, is_alone) for k, (what, rows, is_alone) in enumerate(groups)]
        points = _points(found.adjustment.known.points[known], known, len(groups))
        return cls(found, estimate, (*offsets, *points), AddedUnknowns.of(found, columns, known))

    def test(self, causes: Sequence[_Cause]) -> tuple[float, tuple[FloatArray, ...]] | None:
        """T of causes together, and the sizes of each; None where nothing tells them apart."""
        tested = self.unknowns.test([column for one in causes for column in one.columns])
        if tested is None:
            return None
        ends = np.cumsum([len(one.columns) for one in causes])[:-1]
        return tested[0], tuple(np.split(tested[1], ends))

    def error(self, one: _Cause, sizes: FloatArray, statistic: float, beside: str = "") -> GrossError | None:
        """What is wrong, if it can be: no height below the ground, no constant of kilometres."""
        if one.what is None:
            return _moved(self, one, sizes, statistic, beside)
        (column,) = one.columns
        sigma = float(self.unknowns.weights[column, column]) ** -0.5
        offset = Offset(one.what, one.rows.astype(np.intp), float(sizes[0]), sigma, one.rows.astype(np.intp))
        if abs(offset.size) > LARGEST.get(one.what, np.inf) or not is_possible(self.estimate, offset):
            return None
        return replace(described(self.estimate, offset), size=statistic**0.5)


def shared_offset_cause(
    model: Model,
    given: Determined,
    equations: Equations,
    adjustment: Adjustment,
    errors: tuple[GrossError, ...],
) -> tuple[GrossError, ...]:
    """The shared offset, or known point, without which an adjustment is accepted; or two; none else.

    Args:
        model: how the network is estimated.
        given: the network.
        equations: its equations, as they were solved.
        adjustment: what came out.
        errors: the gross errors that were found: one cause is not told anew, and one or two observations
            explain a contradiction no worse than two causes.
    """
    if len(given.book.observations) > _LARGEST or len(adjustment.left_out) > len(given.left_out):
        return ()
    found = contradiction(equations, adjustment)
    if found is None or adjustment.quality.rejected.any() or vectors_of(adjustment):
        return ()
    start = replace(
        given.initial,
        coordinates=adjustment.points.coordinates,
        rotations=equations.instruments.rotations(adjustment.solution),
    )
    estimate = estimated(model, given.points, given.book, (), replace(given, initial=start))
    if estimate is None:
        return ()
    tests = _Tests.of(found, estimate)
    one = _one(tests)
    if one:
        return () if len(errors) == 1 and errors[0].is_shared else one
    are_single = all(len(error.rows) == 1 and not error.points for error in errors)
    return () if 0 < len(errors) <= _FEW and are_single else _two(tests)


def _one(tests: _Tests) -> tuple[GrossError, ...]:
    """The one cause, or what nothing tells from it."""
    tested = [(one, found) for one in tests.causes if one.is_alone and (found := tests.test((one,)))]
    possible = [
        (found[0], error, len(one.columns))
        for one, found in tested
        if (error := tests.error(one, found[1][0], found[0]))
    ]
    level = _LEVEL / max(len(possible), 1)
    explaining = [
        (statistic, error)
        for statistic, error, degrees in possible
        if statistic > joint_critical(level, POWER, degrees)
        and _explains(tests.found, statistic, degrees, level, _BETTER)
    ]
    if not explaining:
        return ()
    best = max(statistic for statistic, _ in explaining)
    equal = sorted((one for one in explaining if one[0] > best - _EQUAL), key=lambda one: -one[0])
    return (any_of([error for _, error in equal[:_MOST]]),)


def _explains(found: Contradiction, statistic: float, degrees: int, level: float, better: float) -> bool:
    """Whether the adjustment is accepted without causes, which no chance, sigmas or single error explain."""
    solution = found.adjustment.solution
    left, redundancy = solution.cost - statistic, solution.redundancy - degrees
    if redundancy <= 0 or statistic < found.suspected + better:
        return False
    if not found.is_explained(statistic, degrees):
        return False
    factor = solution.cost / solution.redundancy
    return left <= 0.0 or joint_p_value(statistic / factor, degrees, solution.redundancy) < level


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two causes that explain a contradiction together.

    Attributes:
        causes: the two.
        statistic: T of both.
        shares: by how much T is smaller without each.
        sizes: of the unknowns of each.
    """

    causes: tuple[_Cause, _Cause]
    statistic: float
    shares: tuple[float, float]
    sizes: tuple[FloatArray, ...]

    @property
    def score(self) -> float:
        """T, less what unknowns take without a cause."""
        return self.statistic - _EQUAL * sum(len(one.columns) for one in self.causes)

    def is_same(self, other: _Pair) -> bool:
        """Whether the causes are the same ones."""
        return all(any(one.is_same(two) for two in other.causes) for one in self.causes)


def _two(tests: _Tests) -> tuple[GrossError, ...]:
    """The two causes that are enough together; none where other two explain nearly as much."""
    pairs = sorted(_pairs(tests), key=lambda pair: -pair.score)
    possible = (pair for pair in pairs if None not in _errors(tests, pair))
    best = next(possible, None)
    if best is None or _is_of_observations(tests, best):
        return ()
    rivals = [pair for pair in possible if pair.score > best.score - _BETTER and not pair.is_same(best)]
    for k in (0, 1):
        if all(any(best.causes[k].is_same(one) for one in pair.causes) for pair in rivals):
            return _told(tests, best, k, rivals)
    return ()


def _told(tests: _Tests, best: _Pair, common: int, rivals: Sequence[_Pair]) -> tuple[GrossError, ...]:
    """Two causes, the second with what nothing tells from it, the worse one first."""
    first = best.causes[common]
    told, others = list[GrossError](), list[tuple[_Cause, GrossError]]()
    for pair in (best, *rivals):
        for one, error in zip(pair.causes, _errors(tests, pair), strict=True):
            if error is not None and first.is_same(one):
                told.append(error)
            elif error is not None and not any(one.is_same(other) for other, _ in others):
                others.append((one, error))
    found = (told[0], any_of([error for _, error in others[:_MOST]]))
    return tuple(sorted(found, key=lambda error: -error.size))


def _pairs(tests: _Tests) -> Iterator[_Pair]:
    """Every two causes, one of them among the best, that explain the contradiction, and neither alone."""
    alone = [(found[0], one) for one in tests.causes if (found := tests.test((one,)))]
    alone.sort(key=lambda pair: -pair[0])
    level = _LEVEL / max(len(alone) * (len(alone) - 1) // 2, 1)
    least = max(tests.found.needed, tests.found.suspected)
    for k, (of_one, one) in enumerate(alone[:_FIRST]):
        reached = tests.unknowns.with_each(one.columns)
        for of_other, other in alone[k + 1 :]:
            if len(other.columns) == 1 and not reached[other.columns[0]] >= least:
                continue
            tested = None if one.is_same(other) else tests.test((one, other))
            if tested is None:
                continue
            shares = (tested[0] - of_other, tested[0] - of_one)
            limits = [joint_critical(level, POWER, len(cause.columns)) for cause in (one, other)]
            degrees = len(one.columns) + len(other.columns)
            is_needed = shares[0] > limits[0] and shares[1] > limits[1]
            if is_needed and _explains(tests.found, tested[0], degrees, level, _BETTER + limits[1]):
                yield _Pair((one, other), tested[0], shares, tested[1])


def _errors(tests: _Tests, pair: _Pair) -> tuple[GrossError | None, ...]:
    return tuple(
        tests.error(one, sizes, share, _TOGETHER)
        for one, sizes, share in zip(pair.causes, pair.sizes, pair.shares, strict=True)
    )


def _is_of_observations(tests: _Tests, pair: _Pair) -> bool:
    """Whether one of two causes, and a gross error in one observation, explain nearly as much."""
    numbers = tests.found.adjustment.quality.observations
    if numbers is None:
        return True
    return any(
        tests.unknowns.with_one_observation(one.columns, numbers.redundancy) > pair.statistic - _BETTER
        for one in pair.causes
    )


def _groups(estimate: Estimate, sights: Sights) -> Iterator[tuple[What, Rows, bool]]:
    """Sights that may share an offset, each set once, and whether it is tried alone."""
    observations, seen = estimate.book.observations, set[tuple[str, bytes]]()
    every = np.flatnonzero(observations.active & np.isfinite(estimate.misfits)).astype(np.intp)
    ends = (np.unique(end[every]).tolist() for end in (observations.from_points, observations.to_points))
    of_points = (pair for pair in sharing(estimate, *ends) if pair[0] is not What.SCALE)
    of_distances = ((What.CONSTANT, every), (What.SCALE, every))
    for what, rows in ((What.INDEX, every), *of_points, *of_distances):
        shown = sights.seeing(what, rows)
        key = what.value, shown.tobytes()
        if len(shown) >= _LEAST and key not in seen:
            seen.add(key)
            yield what, shown, rows is not every or what is What.INDEX


def _points(points: IntArray, known: IntArray, first: int) -> Iterator[_Cause]:
    """Known points (k,) whose coordinates are wrong, or that have moved; and each of their coordinates.

    Args:
        points: whose known coordinates these are.
        known: their rows among all known coordinates.
        first: number of the unknown of the first.
    """
    for point in np.unique(points).tolist():
        own = np.flatnonzero(points == point)
        columns = tuple((first + own).tolist())
        yield _Cause(columns, None, known[own], point=point)
        if len(own) > 1:
            yield from (
                _Cause((columns[k],), None, known[own[k : k + 1]], False, point) for k in range(len(own))
            )


def _moved(tests: _Tests, one: _Cause, sizes: FloatArray, statistic: float, beside: str) -> GrossError:
    """A known point that the observations place elsewhere, by sizes in sigmas of its known coordinates."""
    known, points = tests.found.adjustment.known, tests.estimate.points
    axis, off = ("x", "y", "height"), known.sigmas[one.rows] * sizes
    told = ", ".join(
        f"{axis[component]} {tests.estimate.units.length.text(value)}"
        for component, value in zip(known.components[one.rows].tolist(), off.tolist(), strict=True)
    )
    name = points.names[one.point]
    its = "its coordinates" if one.is_alone else f"its {axis[int(known.components[one.rows[0]])]}"
    text = (
        f"without {its} the adjustment is accepted{beside}; off by {told}: likely the point has moved, is "
        "another one, or its coordinates are wrong"
    )
    what = f"known point {name} ({points.place(one.point)})"
    return GrossError(what, Cause.MISTYPED, text, statistic**0.5, (), (name,))
