"""Tests of several equations as one observation: the components of a vector, of a position.

With P the inverse of the covariance of correlated observations, Qv that of their residuals v, and g the rows
of a group: u = (P v)_g has the covariance M = (P Qv P)_gg, and T = u' M^+ u is chi-square with the rank of M
as its degrees of freedom. Leaving the group out lowers the weighted sum of squares by T; -M^+ u is the
estimate of its errors. Whatever axes the components are counted along, T is the same.
Source: P. Teunissen, Testing theory, Delft 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.statistics.observation_statistics import UNCONTROLLED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from obseq.arrays import FloatArray, IntArray


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
    for index, numbers, root, residual, leverage in zip(
        members, groups, roots, residuals, leverages, strict=True
    ):
        weighted = root.T @ (root @ residual)
        for places in _groups(numbers):
            mine = root[:, places]
            yield _tested(index[places], mine.T @ mine, mine.T @ leverage @ mine, weighted[places])


def _groups(numbers: IntArray) -> Iterator[IntArray]:
    """Places (m,) of the members of each group."""
    order = np.argsort(numbers, kind="stable")
    order = order[numbers[order] >= 0]
    ends = np.flatnonzero(np.diff(numbers[order])) + 1
    yield from np.split(order, ends) if order.size else ()


def _tested(rows: IntArray, whole: FloatArray, lost: FloatArray, weighted: FloatArray) -> JointTest:
    """One test, from P, P - P Qv P and P v of its rows: along axes in which P is the identity."""
    inverse, weight = np.linalg.inv(np.linalg.cholesky(whole)), whole - lost
    shares, axes = np.linalg.eigh(np.eye(len(rows)) - inverse @ lost @ inverse.T)
    kept = shares > UNCONTROLLED
    if not kept.any():
        return JointTest(rows, np.nan, 0, np.zeros(len(rows)), weight)
    axes = axes[:, kept]
    along = axes.T @ (inverse @ weighted)
    blunder = -inverse.T @ (axes @ (along / shares[kept]))
    return JointTest(rows, float(np.sum(along**2 / shares[kept])), int(kept.sum()), blunder, weight)


def numbered(groups: Sequence[IntArray], n: int) -> IntArray:
    """(n,) number of the group that each row is in; -1 for those in none."""
    numbers = np.full(n, -1, np.int64)
    for number, rows in enumerate(groups):
        numbers[rows] = number
    return numbers
