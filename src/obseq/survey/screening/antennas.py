"""One error of an antenna that several GNSS vectors share: a station that was occupied wrongly.

All vectors of one occupation are off by one amount: along the vertical of its station where the height of
the antenna is wrong, in any direction where it stood on another mark or the station has a wrong name. Which
vectors these are no file says, so that those next to each other in the files are tested for it, or any where
they are few: with the columns C of the shift in the equations, u = C' P v has the covariance
M = C' P Qv P C, and T = u' M^-1 u. The one that explains most is the cause, where the adjustment is accepted
without it, and no single vector explains nearly as much.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.joint_levels import POWER, joint_critical
from obseq.printable import listed
from obseq.survey.screening.contradictions import is_rejected, parts_of, vectors_of, weighted
from obseq.survey.screening.findings import Cause, GrossError, any_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.report.units import Units
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.model import FieldBook
    from obseq.survey.screening.contradictions import Contradiction

_LARGEST = 6_000
"""Observations up to which this is tried."""
_FEW = 6
"""Vectors at a station up to which any of them may share a shift."""
_LEVEL = 0.001
"""Probability that any shift is found where nothing is wrong."""
_CHANCE = 0.01
"""Probability with which a height, or one component, leaves more, to be taken for the cause."""
_BETTER = 9.0
"""Weighted squares by which a shift of several vectors must be better than any other gross error."""
_EQUAL = 4.0
"""Weighted squares by which shifts may differ that explain a network equally well."""
_MOST, _NAMED = 3, 6
"""Shifts that are told, and vectors of each that are listed."""
_UNSEEN = 1e-6
"""Share of the weight of a shift below which nothing shows it."""


@dataclass(frozen=True, eq=False)
class _Occupation:
    """Vectors at a station that may share a shift.

    Attributes:
        station: the point.
        rows: (k,) first rows of these vectors in the field book.
        count: how many vectors there are at the station.
        off: (3,) by how much too far east, north and up they put it (m); up only of an antenna's height.
        statistic: T of that shift.
        degrees: of freedom, 1 for a height and 3 for a shift.
    """

    station: int
    rows: IntArray
    count: int
    off: FloatArray
    statistic: float
    degrees: int


def antenna_cause(found: Contradiction, units: Units) -> tuple[GrossError, ...]:
    """The shift of an antenna that several vectors share, without which an adjustment is accepted; or none.

    Args:
        found: what contradicts.
        units: in which values are told.
    """
    adjustment = found.adjustment
    if len(adjustment.book.observations) > _LARGEST:
        return ()
    tested = list(_occupations(found))
    level = _LEVEL / max(len(tested), 1)
    beyond = [one for one in tested if one.statistic > joint_critical(level, POWER, one.degrees)]
    if not beyond:
        return ()
    best = max(beyond, key=lambda one: one.statistic)
    own = [one for one in beyond if one.station == best.station and np.array_equal(one.rows, best.rows)]
    upright = min(own, key=lambda one: one.degrees)
    if best.statistic - upright.statistic <= chi_square_limit(2, above=_CHANCE):
        best = upright
    other = max(test.statistic for test in adjustment.quality.joint if np.isfinite(test.rise))
    if best.statistic < max(other, found.suspected) + _BETTER:
        return ()
    if not found.is_explained(best.statistic, best.degrees):
        return ()
    least = best.statistic - _EQUAL
    equal = [one for one in beyond if one.degrees == best.degrees and one.statistic > least]
    equal.sort(key=lambda one: -one.statistic)
    return (any_of([_described(one, adjustment, units) for one in equal[:_MOST]]),)


def concern_vectors(errors: Sequence[GrossError], adjustment: Adjustment) -> bool:
    """Whether gross errors are of components of vectors, which were looked at one by one.

    One known point alone explains its vectors together; with others it may be a station of several.
    """
    rows = [row for error in errors for row in error.rows]
    vectors = vectors_of(adjustment)
    places = np.concatenate(vectors) if vectors else np.zeros(0)
    is_one_point = len(errors) == 1 and bool(errors[0].points)
    return bool(rows) and not is_one_point and bool(np.isin(rows, places).all())


def is_one_vector(adjustment: Adjustment) -> bool:
    """Whether the vector that is suspected explains all, and none of its components alone does."""
    suspicion, solution = adjustment.suspicion, adjustment.solution
    if suspicion is None or not suspicion.blunders or adjustment.quality.observations is None:
        return False
    worst = max(adjustment.quality.joint, key=lambda test: np.nan_to_num(test.statistic))
    tests = adjustment.quality.observations.standardised
    own = max((float(tests[row]) ** 2 for row in worst.rows if row < len(tests)), default=0.0)
    is_whole = worst.statistic - own > chi_square_limit(2, above=_CHANCE)
    return is_whole and not is_rejected(solution.cost - worst.statistic, solution.redundancy - worst.degrees)


def _occupations(found: Contradiction) -> Iterator[_Occupation]:
    """What may share a shift at each station, with the tests of its height and of its whole shift."""
    book, vectors = found.adjustment.book, vectors_of(found.adjustment)
    parts = list(parts_of(found.equations, found.state, np.concatenate(vectors)))
    axes = found.equations.local_axes(found.adjustment.points.coordinates)
    ends = book.observations.from_points, book.observations.to_points
    for station in np.unique([[end[rows[0]] for end in ends] for rows in vectors]).tolist():
        mine = [rows for rows in vectors if station in (ends[0][rows[0]], ends[1][rows[0]])]
        if len(mine) < 2:
            continue
        columns = np.zeros((len(book.observations), len(mine), 3))
        for k, rows in enumerate(mine):
            columns[rows, k] = axes[rows] if ends[1][rows[0]] == station else -axes[rows]
        blocks = (len(mine), 3, len(mine), 3)
        seen, *both = weighted(found.state, parts, columns.reshape(len(columns), -1))
        shown, (weight, whole) = seen.reshape(-1, 3), (one.reshape(blocks) for one in both)
        firsts = np.array([rows[0] for rows in mine])
        for chosen in _choices(firsts, book):
            seen, kept, given = shown[chosen].sum(axis=0), _sum(weight, chosen), _sum(whole, chosen)
            for off, statistic, degrees in _tested(seen, kept, given):
                yield _Occupation(station, firsts[chosen], len(mine), off, statistic, degrees)


def _sum(blocks: FloatArray, chosen: list[int]) -> FloatArray:
    """(3, 3) sum of the blocks (k, 3, k, 3) of some vectors."""
    return np.asarray(blocks[chosen][:, :, chosen].sum(axis=(0, 2)))


def _tested(
    seen: FloatArray, weight: FloatArray, whole: FloatArray
) -> Iterator[tuple[FloatArray, float, int]]:
    """Estimate (3,), T and degrees of freedom of a height, and of a shift, where the others show them.

    Args:
        seen: (3,) C' P v.
        weight: (3, 3) its covariance M.
        whole: (3, 3) C' P C.
    """
    if weight[2, 2] > _UNSEEN * whole[2, 2]:
        size = -float(seen[2] / weight[2, 2])
        yield np.array([0.0, 0.0, size]), size**2 * float(weight[2, 2]), 1
    if np.linalg.eigvalsh(weight)[0] > _UNSEEN * np.linalg.eigvalsh(whole)[-1]:
        off = np.asarray(-np.linalg.solve(weight, seen), np.float64)
        yield off, float(off @ weight @ off), 3


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


def _described(one: _Occupation, adjustment: Adjustment, units: Units) -> GrossError:
    book, points = adjustment.book, adjustment.points.points
    name, count = book.point_names[one.station], len(one.rows)
    labels = listed([book.label(int(row)).partition(" ")[2] for row in one.rows], _NAMED)
    which = f"the {count} vectors" if count == one.count else f"{count} of the {one.count} vectors"
    rows = tuple(one.rows.tolist())
    if one.degrees == 1:
        side, above = ("high", "higher above") if one.off[2] > 0.0 else ("low", "lower above")
        text = (
            f"they put {name} {units.length.text(abs(float(one.off[2])))} too {side} "
            f"({labels}): likely its antenna stood that much {above} the mark than was taken in one session"
        )
        what, cause = f"height of the antenna at {name}, in {which} there", Cause.HEIGHT
    else:
        text = (
            f"they put {name} {_shift(one.off, units)} beside where the others do ({labels}): likely its "
            "antenna was centred on another mark, or a wrong one was named, in one session"
        )
        what, cause = f"position of the antenna at {name}, in {which} there", Cause.ECCENTRIC
        if count == one.count and not points.is_free[one.station].all():
            what, cause = f"known point {name} ({points.place(one.station)})", Cause.MISTYPED
            text = (
                f"all {count} vectors there put it {_shift(one.off, units)} of where it is given ({labels}): "
                "its coordinates are wrong, or its antenna was on another mark in one session of all of them"
            )
    return GrossError(what, cause, text, one.statistic**0.5, rows, (name,), is_one=True)


def _shift(off: FloatArray, units: Units) -> str:
    """A shift in words, such as `0.100 m east, 0.020 m south and 0.003 m up`."""
    ways = (("east", "west"), ("north", "south"), ("up", "down"))
    east, north, up = (
        f"{units.length.text(abs(size))} {way[size < 0.0]}"
        for size, way in zip(off.tolist(), ways, strict=True)
    )
    return f"{east}, {north} and {up}"
