"""One height of an antenna that several GNSS vectors share: a station that was occupied with a wrong height.

All vectors of one occupation are off by one amount along the vertical of its station. Which vectors these
are no file says, so that those next to each other in the files are tested for it, or any where they are few:
with the column c of a height in the equations, u = c' P v has the variance c' P Qv P c. The one that explains
most is the cause, where the adjustment is accepted without it, and no single vector explains nearly as much.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.final_state import final_state
from obseq.leastsquares.statistics.hypothesis_tests import normal_critical
from obseq.survey.screening.findings import Cause, GrossError, any_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.statistics.final_state import FinalState
    from obseq.report.units import Units
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.model import FieldBook

_Part: TypeAlias = "tuple[IntArray, Any, FloatArray, Any]"

_LARGEST = 6_000
"""Observations up to which this is tried."""
_FEW = 6
"""Vectors at a station up to which any of them may share a height."""
_LEVEL = 0.001
"""Probability that any height is found where nothing is wrong."""
_ACCEPTED = 0.01
"""Level of the test of what remains."""
_BETTER = 9.0
"""Weighted squares by which a height of several vectors must be better than any other gross error."""
_EQUAL = 4.0
"""Weighted squares by which heights may differ that explain a network equally well."""
_MOST, _NAMED = 3, 6
"""Heights that are told, and vectors of each that are listed."""
_UNSEEN = 1e-6
"""Share of the weight of a height below which nothing shows it."""


@dataclass(frozen=True, eq=False)
class _Occupation:
    """Vectors at a station that may share the height of an antenna.

    Attributes:
        station: the point.
        rows: (k,) first rows of these vectors in the field book.
        count: how many vectors there are at the station.
        size: by how much too high they put it (m).
        test: w of that height.
    """

    station: int
    rows: IntArray
    count: int
    size: float
    test: float


def antenna_cause(equations: Equations, adjustment: Adjustment, units: Units) -> tuple[GrossError, ...]:
    """The height of an antenna that several vectors share, without which an adjustment is accepted; or none.

    Args:
        equations: of the network, as they were solved.
        adjustment: what came out.
        units: in which values are told.
    """
    solution, book = adjustment.solution, adjustment.book
    vectors = [test.rows for test in adjustment.quality.joint if np.isfinite(test.rise)]
    is_small = len(book.observations) <= _LARGEST
    if not vectors or not is_small or not is_rejected(solution.cost, solution.redundancy):
        return ()
    tested = list(_occupations(equations, adjustment, vectors))
    best = max((one.test**2 for one in tested), default=0.0)
    other = max(test.statistic for test in adjustment.quality.joint if np.isfinite(test.rise))
    other = max(other, adjustment.suspicion.statistic**2 if adjustment.suspicion else 0.0)
    if best < max(normal_critical(_LEVEL / max(len(tested), 1)) ** 2, other + _BETTER):
        return ()
    if is_rejected(solution.cost - best, solution.redundancy - 1):
        return ()
    equal = sorted((one for one in tested if one.test**2 > best - _EQUAL), key=lambda one: -abs(one.test))
    return (any_of([_described(one, book, units) for one in equal[:_MOST]]),)


def concern_vectors(errors: Sequence[GrossError], adjustment: Adjustment) -> bool:
    """Whether gross errors are of components of vectors only, which were looked at one by one."""
    rows = [row for error in errors for row in error.rows]
    vectors = [test.rows for test in adjustment.quality.joint if np.isfinite(test.rise)]
    places = np.concatenate(vectors) if vectors else np.zeros(0)
    return bool(rows) and not any(error.points for error in errors) and bool(np.isin(rows, places).all())


def is_one_vector(adjustment: Adjustment) -> bool:
    """Whether the vector that is suspected explains all, and none of its components alone does."""
    suspicion, solution = adjustment.suspicion, adjustment.solution
    if suspicion is None or not suspicion.blunders or adjustment.quality.observations is None:
        return False
    worst = max(adjustment.quality.joint, key=lambda test: np.nan_to_num(test.statistic))
    tests = adjustment.quality.observations.standardised
    own = max((float(tests[row]) ** 2 for row in worst.rows if row < len(tests)), default=0.0)
    is_whole = worst.statistic - own > chi_square_limit(2, above=_ACCEPTED)
    return is_whole and not is_rejected(solution.cost - worst.statistic, solution.redundancy - worst.degrees)


def is_rejected(squares: float, redundancy: int) -> bool:
    """Whether residuals are larger than the sigmas announce: their weighted squares, and the redundancy."""
    return redundancy > 0 and squares > chi_square_limit(redundancy, above=_ACCEPTED)


def _occupations(
    equations: Equations, adjustment: Adjustment, vectors: list[IntArray]
) -> Iterator[_Occupation]:
    """What may share a height at each station, with its test."""
    try:
        state = final_state(equations.system, adjustment.solution)
    except InputError:
        return  # parts of the network were left out, or its sigmas changed
    book, parts = adjustment.book, _parts(state, equations)
    rises = equations.rises(adjustment.points.coordinates)
    ends = book.observations.from_points, book.observations.to_points
    for station in np.unique([[end[rows[0]] for end in ends] for rows in vectors]).tolist():
        mine = [rows for rows in vectors if station in (ends[0][rows[0]], ends[1][rows[0]])]
        if len(mine) < 2:
            continue
        signs = [1.0 if ends[1][rows[0]] == station else -1.0 for rows in mine]
        columns = np.zeros((len(book.observations), len(mine)))
        for k, (rows, sign) in enumerate(zip(mine, signs, strict=True)):
            columns[rows, k] = sign * rises[rows]
        shown, weight, whole = _weighted(state, parts, columns)
        firsts = np.array([rows[0] for rows in mine])
        for chosen in _choices(firsts, book):
            part = weight[np.ix_(chosen, chosen)].sum()
            if part > _UNSEEN * whole[np.ix_(chosen, chosen)].sum():
                size = -float(shown[chosen].sum()) / part
                yield _Occupation(station, firsts[chosen], len(mine), size, size * float(part) ** 0.5)


def _parts(state: FinalState, equations: Equations) -> list[_Part]:
    """Correlated observations: rows of the field book, root of their weights, its residuals and Jacobian."""
    found: list[_Part] = []
    for rows, batch in equations.batches.values():
        if batch.clusters is not None:
            root, residuals = batch.whitening_matrix(), np.nan_to_num(state.result.residuals(batch)[:, 0])
            found.append((rows, root.tocsc(), root @ residuals, state.cluster_rows(batch).T.tocsr()))
    return found


def _weighted(
    state: FinalState, parts: list[_Part], columns: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """C' P v (k,), its covariance C' P Qv P C (k, k), and C' P C, of columns C (n, k) of the field book."""
    count = columns.shape[1]
    shown, whole = np.zeros(count), np.zeros((count, count))
    through = np.zeros((state.equations.n_unknowns, count))
    for rows, root, residuals, jacobian in parts:
        used = np.flatnonzero(columns[rows].any(axis=1))
        if used.size:
            white = root[:, used] @ columns[rows[used]]
            shown += white.T @ residuals
            whole += white.T @ white
            through += jacobian @ white
    return shown, whole - through.T @ state.solve(through), whole


def _choices(firsts: IntArray, book: FieldBook) -> Iterator[list[int]]:
    """Two vectors or more of those at a station: any where they are few, else those next to each other."""
    order = np.lexsort((book.observations.lines[firsts], book.observations.file_indices[firsts])).tolist()
    n = len(order)
    if n <= _FEW:
        for size in range(2, n + 1):
            yield from map(list, combinations(order, size))
        return
    for first in range(n - 1):
        for last in range(first + 2, n + 1):
            yield order[first:last]


def _described(one: _Occupation, book: FieldBook, units: Units) -> GrossError:
    name, count = book.point_names[one.station], len(one.rows)
    labels = [book.label(int(row)).partition(" ")[2] for row in one.rows]
    listed = ", ".join(labels[:_NAMED]) + (f" and {count - _NAMED} more" if count > _NAMED else "")
    which = f"the {count} vectors" if count == one.count else f"{count} of the {one.count} vectors"
    above = "higher above" if one.size > 0.0 else "lower above"
    text = (
        f"they put {name} {units.length.text(abs(one.size))} too {'high' if one.size > 0.0 else 'low'} "
        f"({listed}): likely its antenna stood that much {above} the mark than was taken in one session"
    )
    what = f"height of the antenna at {name}, in {which} there"
    return GrossError(what, Cause.HEIGHT, text, abs(one.test), tuple(one.rows.tolist()), (name,), is_one=True)
