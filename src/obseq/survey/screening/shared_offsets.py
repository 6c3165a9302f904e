"""One offset that several observations share, where an adjustment is rejected: tested as one more unknown.

A robust estimate lets heights and places take up part of an offset that many sights share, and what is left
looks like many errors, or like noise larger than the sigmas. In the adjustment it is one unknown more: with
the column c of its effect on the residuals v, T = (c' P v)^2 / (c' P Qv P c) is what it takes from their
weighted squares, and -c' P v / (c' P Qv P c) its size. The one with which the adjustment is accepted is the
cause. A known point that is elsewhere is tested likewise: without its coordinates.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.statistics.joint_levels import POWER, joint_critical, joint_p_value
from obseq.survey.screening.contradictions import contradiction, parts_of, vectors_of, weighted
from obseq.survey.screening.findings import Cause, GrossError, any_of
from obseq.survey.screening.offset_effects import Sights, What
from obseq.survey.screening.offsets import LARGEST, Offset, described, is_possible
from obseq.survey.screening.trials import estimated

if TYPE_CHECKING:
    from collections.abc import Iterator

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
_UNSEEN = 1e-6
"""Share of the weight of an offset below which nothing shows it."""
_STEP = 1e-4
"""By what the effect of an offset is found (m, rad)."""


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A cause with its test.

    Attributes:
        error: what it is.
        statistic: T.
        degrees: of freedom.
    """

    error: GrossError
    statistic: float
    degrees: int


def shared_offset_cause(
    model: Model, given: Determined, equations: Equations, adjustment: Adjustment
) -> tuple[GrossError, ...]:
    """The shared offset, or known point, without which an adjustment is accepted; none else.

    Args:
        model: how the network is estimated.
        given: the network.
        equations: its equations, as they were solved.
        adjustment: what came out.
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
    tested = [*_offsets(found, estimate), *_known_points(found, estimate)]
    level = _LEVEL / max(len(tested), 1)
    explaining = [one for one in tested if _explains(found, one, level)]
    if not explaining:
        return ()
    best = max(one.statistic for one in explaining)
    equal = sorted(
        (one for one in explaining if one.statistic > best - _EQUAL), key=lambda one: -one.statistic
    )
    return (any_of([one.error for one in equal[:_MOST]]),)


def _explains(found: Contradiction, one: _Candidate, level: float) -> bool:
    """Whether the adjustment is accepted without it, which no chance, sigmas or single error explain."""
    solution = found.adjustment.solution
    left, redundancy = solution.cost - one.statistic, solution.redundancy - one.degrees
    if redundancy <= 0 or one.statistic <= joint_critical(level, POWER, one.degrees):
        return False
    if one.statistic < found.suspected + _BETTER or not found.is_explained(one.statistic, one.degrees):
        return False
    factor = solution.cost / solution.redundancy
    return left <= 0.0 or joint_p_value(one.statistic / factor, one.degrees, solution.redundancy) < level


def _offsets(found: Contradiction, estimate: Estimate) -> Iterator[_Candidate]:
    """The offsets that sights from a point, to a point, or all of them may share."""
    sights = Sights.of(estimate)
    groups = list(_groups(estimate, sights))
    if not groups:
        return
    columns = np.zeros((len(estimate.book.observations), len(groups)))
    for k, (what, rows) in enumerate(groups):
        columns[rows, k] = sights.change(what, rows)(_STEP) / _STEP
    state = found.state
    parts = list(parts_of(found.equations, state, np.arange(len(columns))))
    shown, weight, whole = weighted(state, parts, columns)
    for k, (what, rows) in enumerate(groups):
        own = float(weight[k, k])
        if own <= _UNSEEN * whole[k, k]:
            continue
        one = Offset(what, rows, -float(shown[k]) / own, own**-0.5, rows)
        if abs(one.size) <= LARGEST.get(what, np.inf) and is_possible(estimate, one):
            error = replace(described(estimate, one), size=float(shown[k] ** 2 / own) ** 0.5)
            yield _Candidate(error, float(shown[k] ** 2) / own, 1)


def _groups(estimate: Estimate, sights: Sights) -> Iterator[tuple[What, Rows]]:
    """Sights that may share an offset, each set once: some that are all of them are told as all."""
    observations, seen = estimate.book.observations, set[tuple[str, bytes]]()
    is_used = observations.active & np.isfinite(estimate.misfits)
    every = np.flatnonzero(is_used).astype(np.intp)
    choices: list[tuple[What, Rows]] = [(What.INDEX, every)]
    for origin in np.unique(observations.from_points[every]).tolist():
        mine = is_used & (observations.from_points == origin)
        heights = np.unique(observations.from_heights[mine]).tolist()
        choices += [
            (What.INSTRUMENT, _rows(mine & (observations.from_heights == height))) for height in heights
        ]
        choices += [(What.CONSTANT, _rows(mine)), (What.INDEX, _rows(mine))]
    for target in np.unique(observations.to_points[every]).tolist():
        mine = is_used & (observations.to_points == target)
        choices += [(what, _rows(mine)) for what in (What.TARGET, What.CONSTANT, What.INDEX)]
    for what, rows in choices:
        shown = sights.seeing(what, rows)
        key = what.value, shown.tobytes()
        if len(shown) >= _LEAST and key not in seen:
            seen.add(key)
            yield what, shown


def _rows(mask: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Rows:
    return np.flatnonzero(mask).astype(np.intp)


def _known_points(found: Contradiction, estimate: Estimate) -> Iterator[_Candidate]:
    """Known points whose coordinates are wrong, or that have moved."""
    adjustment, state = found.adjustment, found.state
    known, places = adjustment.known, found.equations.known.places()
    batch = next((one for one in places if one.clusters is None), None)
    if batch is None:
        return
    own = places[batch]
    for point in np.unique(known.points[own]).tolist():
        mine = own[known.points[own] == point]
        rows = state.rows(batch, np.searchsorted(own, mine))[:, 0]
        normalised = known.residuals[mine] / known.sigmas[mine]
        weight = np.eye(len(mine)) - rows @ state.solve(np.ascontiguousarray(rows.T))
        shares, axes = np.linalg.eigh(weight)
        kept = shares > _UNSEEN
        if not kept.all():
            continue
        along = axes.T @ normalised
        off = -known.sigmas[mine] * (axes @ (along / shares))
        statistic = float(np.sum(along**2 / shares))
        yield _Candidate(_moved(found, estimate, mine, off, statistic), statistic, len(mine))


def _moved(
    found: Contradiction,
    estimate: Estimate,
    mine: IntArray,
    off: FloatArray,
    statistic: float,
) -> GrossError:
    """A known point that the observations place elsewhere, by `off` (m) in its known components."""
    known, points = found.adjustment.known, estimate.points
    point = int(known.points[mine[0]])
    axis = ("x", "y", "height")
    told = ", ".join(
        f"{axis[component]} {estimate.units.length.text(value)}"
        for component, value in zip(known.components[mine].tolist(), off.tolist(), strict=True)
    )
    name = points.names[point]
    text = (
        f"without its coordinates the adjustment is accepted; they are off by {told}: likely the point has "
        "moved, is another one, or its coordinates are wrong"
    )
    what = f"known point {name} ({points.place(point)})"
    return GrossError(what, Cause.MISTYPED, text, statistic**0.5, (), (name,))
