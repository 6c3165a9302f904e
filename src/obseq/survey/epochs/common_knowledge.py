"""What two epochs know alike beside their observations: coordinates given with the same sigma in both.

Component by component, in the system of the points: where a known height stands in plan does not count.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.dataclass import dataclass
from obseq.survey.equations.point_system import PointSystem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.adjusted import Adjustment

SAME = 1e-6
"""Coordinates (m) that differ by less are the same: files give them to 1e-5, systems round them to 1e-8."""


@dataclass(frozen=True, eq=False)
class Given:
    """The coordinates that an epoch was given with a sigma; those with a covariance come last.

    Attributes:
        components: (k) name of the point and component of each.
        values: (k,) m.
        sigmas: (k,) m.
        correlated: (c, c) covariance of the last ones, m^2.
        gains: (3 n, k) what their errors do to the coordinates of points in the frame.
    """

    components: list[tuple[str, int]]
    values: FloatArray
    sigmas: FloatArray
    correlated: FloatArray
    gains: FloatArray

    @property
    def independent(self) -> int:
        """How many have no covariance."""
        return len(self.components) - len(self.correlated)


def given(epoch: Adjustment, names: Sequence[str]) -> Given:
    """What an epoch was given, and what its errors do to points of these names: `Q A' P`."""
    known, points = epoch.known, epoch.points
    rows, place = np.unique(known.points, return_inverse=True)
    system = PointSystem(crs.parse(epoch.frame), crs.parse(epoch.points_crs))
    axes, metres = system.axes(points.coordinates[rows])
    equations = np.zeros((len(known), len(rows), 3))
    equations[np.arange(len(known)), place] = axes[place, known.components]
    of_rows = cofactors(epoch, names, [points.names[row] for row in rows.tolist()])
    gains = of_rows @ equations.reshape(len(known), 3 * len(rows)).T
    covariance = points.points.covariance
    correlated = np.zeros((0, 0)) if covariance is None else covariance.matrix
    first = len(known) - len(correlated)
    gains[:, :first] /= np.square(known.sigmas[:first])
    if len(correlated):
        gains[:, first:] = np.linalg.solve(correlated, gains[:, first:].T).T
    components = [
        (points.names[row], component)
        for row, component in zip(known.points.tolist(), known.components.tolist(), strict=True)
    ]
    return Given(components, known.values * metres[place, known.components], known.sigmas, correlated, gains)


def common(first: Given, second: Given) -> FloatArray:
    """(3 n, 3 n) covariance of points between the epochs, by the errors of what both were given alike."""
    where = {component: row for row, component in enumerate(second.components)}
    pairs = np.array(
        [(row, where[one]) for row, one in enumerate(first.components) if one in where], np.int64
    ).reshape(-1, 2)
    ones, others = pairs[np.abs(first.values[pairs[:, 0]] - second.values[pairs[:, 1]]) < SAME].T
    alone = (ones < first.independent) & (others < second.independent)
    alone &= np.isclose(first.sigmas[ones], second.sigmas[others], rtol=1e-9, atol=0.0)
    one, other = ones[alone], others[alone]
    found = (first.gains[:, one] * np.square(first.sigmas[one])) @ second.gains[:, other].T
    together = (ones >= first.independent) & (others >= second.independent)
    one, other = ones[together], others[together]
    matrix, its = _part(first, one), _part(second, other)
    if np.allclose(matrix, its, rtol=1e-9, atol=0.0):
        found += first.gains[:, one] @ matrix @ second.gains[:, other].T
    return np.asarray(found)


def _part(of: Given, rows: IntArray) -> FloatArray:
    """Covariance of some of the correlated ones."""
    return of.correlated[np.ix_(rows - of.independent, rows - of.independent)]


def cofactors(epoch: Adjustment, names: Sequence[str], others: Sequence[str]) -> FloatArray:
    """(3 n, 3 m) cofactors between points of an epoch, zero where they are held."""
    if not others:
        return np.zeros((3 * len(names), 0))
    found = epoch.solution.cofactors
    rows, columns = (
        found.table.scalars(found.table.find(which, "Point3"), "compare").ravel() for which in (names, others)
    )
    return found.between(rows, columns)
