"""Tests of several equations as one observation: the components of a vector, of a position.

With P the inverse of the covariance of correlated observations, Qv that of their residuals v, and g the rows
of a group: u = (P v)_g has the covariance M = (P Qv P)_gg, and T = u' M^+ u is chi-square with the rank of M
as its degrees of freedom. Leaving the group out lowers the weighted sum of squares by T; -M^+ u is the
estimate of its errors. Whatever axes the components are counted along, T is the same.
Source: P. Teunissen, Testing theory, Delft 2000.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.statistics.final_state import FinalState
from obseq.leastsquares.statistics.observation_statistics import UNCONTROLLED


@dataclass(frozen=True, eq=False)
class JointTest:
    """The test of some equations of one batch as one.

    Attributes:
        rows: (m,) of the batch.
        statistic: T; NaN where nothing controls any of them.
        degrees: its degrees of freedom, the number of combinations of the equations that others control.
        blunder: (m,) estimates of the errors of the observed values; 0 along what nothing controls.
        weight: (m, m) M; what errors along one direction d show is d' M d.
    """

    rows: IntArray
    statistic: float
    degrees: int
    blunder: FloatArray
    weight: FloatArray

    def along(self, direction: FloatArray) -> tuple[float, float]:
        """Estimate of an error that is along one direction (m,) only, and its test w: NaN where unseen."""
        seen = float(direction @ self.weight @ direction)
        if not self.degrees or seen <= UNCONTROLLED * float(np.trace(self.weight)):
            return np.nan, np.nan
        size = float(direction @ self.weight @ self.blunder) / seen
        return size, size * seen**0.5


def joint_tests(
    members: IntArray, groups: IntArray, roots: FloatArray, residuals: FloatArray, leverages: FloatArray
) -> Iterator[JointTest]:
    """The tests of the groups of some clusters of one size.

    Args:
        members: (k, m) residuals of each cluster.
        groups: (k, m) number of the group of each; negative for those that stand alone.
        roots: (k, m, m) U, with U' U the inverse of the covariance.
        residuals: (k, m) v.
        leverages: (k, m, m) G = U A Q A' U'.
    """
    whole = np.swapaxes(roots, 1, 2) @ roots
    lost = np.swapaxes(roots, 1, 2) @ leverages @ roots
    weighted = (whole @ residuals[:, :, None])[:, :, 0]
    found: dict[int, JointTest] = {}
    for numbers, which, places in _groups(groups):
        blocks = which[:, None, None], places[:, :, None], places[:, None, :]
        each = which[:, None], places
        tests = _tested(members[each], whole[blocks], lost[blocks], weighted[each])
        found |= zip(numbers, tests, strict=True)
    yield from (found[number] for number in sorted(found))


def tests_of_groups(
    state: FinalState, batch: Batch, residuals: FloatArray, groups: Sequence[IntArray]
) -> Iterator[JointTest]:
    """The tests of groups of observations that are not correlated, of one residual each.

    Args:
        state: the solved system.
        batch: the observations.
        residuals: (n, 1) theirs.
        groups: rows of each group; those that are not active do not count.

    Raises:
        InputError: the observations of a group are not of the same unknowns, or have several residuals.
    """
    present = [rows[batch.active[rows]] for rows in groups]
    matrix, weights = state.cluster_rows(batch), batch.weights[0, : batch.n]
    for size in sorted({len(rows) for rows in present} - {0}):
        members = np.array([rows for rows in present if len(rows) == size])
        blocks = batch.blocks[:, members]
        if batch.shape.n_residuals > 1 or (blocks != blocks[:, :, :1]).any():
            raise InputError(
                f"{batch.name}: without a covariance of the whole batch, only groups are tested whose "
                "observations have one residual each, of the same unknowns"
            )
        roots = weights[members][:, :, None] * np.eye(size)
        leverages = state.cluster_cofactors(matrix, members)
        yield from joint_tests(members, np.zeros_like(members), roots, residuals[members, 0], leverages)


def _groups(groups: IntArray) -> Iterator[tuple[list[int], IntArray, IntArray]]:
    """The groups (g,) of each size m: their order, their clusters (g,), and places (g, m) in these."""
    clusters, places = np.nonzero(groups >= 0)
    numbers = groups[clusters, places]
    order = np.lexsort((numbers, clusters))
    clusters, places, numbers = clusters[order], places[order], numbers[order]
    is_first = np.append(True, (np.diff(clusters) != 0) | (np.diff(numbers) != 0))[: len(order)]
    starts = np.flatnonzero(is_first)
    sizes = np.diff(starts, append=len(order))
    for size in np.unique(sizes).tolist():
        alike = np.flatnonzero(sizes == size)
        yield alike.tolist(), clusters[starts[alike]], places[starts[alike, None] + np.arange(size)]


def _tested(rows: IntArray, whole: FloatArray, lost: FloatArray, weighted: FloatArray) -> Iterator[JointTest]:
    """Tests (g,) from P, P - P Qv P and P v of their rows (g, m): along axes in which P is the identity."""
    inverse, weight = np.linalg.inv(np.linalg.cholesky(whole)), whole - lost
    transposed = np.swapaxes(inverse, 1, 2)
    shares, axes = np.linalg.eigh(np.eye(rows.shape[1]) - inverse @ lost @ transposed)
    kept = shares > UNCONTROLLED
    along = (np.swapaxes(axes, 1, 2) @ inverse @ weighted[:, :, None])[:, :, 0]
    parts = np.divide(along, shares, where=kept, out=np.zeros_like(along))
    blunders = -(transposed @ axes @ parts[:, :, None])[:, :, 0]
    degrees = kept.sum(axis=1)
    statistics = np.where(degrees > 0, (along * parts).sum(axis=1), np.nan)
    columns = statistics.tolist(), degrees.tolist()
    yield from map(JointTest, rows, *columns, blunders, weight)


def numbered(groups: Sequence[IntArray], n: int) -> IntArray:
    """(n,) number of the group that each row is in; -1 for those in none."""
    numbers = np.full(n, -1, np.int64)
    for number, rows in enumerate(groups):
        numbers[rows] = number
    return numbers
