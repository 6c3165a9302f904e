"""Whether known points have stayed: both epochs formed by their observations alone, and fitted together.

Known coordinates that hold in both epochs a point that has moved bend all the others. What the observations
alone say of the known points does not depend on that. What both epochs know alike, coordinates given with
the same sigma, is known component by component in the system of the points: where a known height stands in
plan does not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq import crs
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import ObseqError
from obseq.stopwatch import Stopwatch
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.computation import Computation
from obseq.survey.adjustment.datum import Datum, DatumKind, freed, without_azimuths
from obseq.survey.adjustment.inner import require_whole
from obseq.survey.adjustment.quality import Quality
from obseq.survey.epochs.grounds import fits
from obseq.survey.equations.frame import Frame
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.initial_values import values_by
from obseq.survey.initial.left_out import Determined
from obseq.survey.model import Points, join
from obseq.survey.sights.graph_building import Graphs

ITERATIONS = 25
TOLERANCE = 1e-6


def known_points(epochs: Sequence[Adjustment], names: Sequence[str]) -> tuple[str, ...]:
    """Those of the names of which both epochs hold, or tie, a coordinate, and the same ones alike."""
    one, two = map(_given, epochs)
    return tuple(name for name in names if name in one and name in two and _is_one(one[name], two[name]))


def by_observations(epoch: Adjustment, names: Sequence[str]) -> Adjustment | None:
    """An epoch on inner constraints of known points, which are free; None where that determines no network.

    Args:
        epoch: As adjusted with its known coordinates.
        names: The known points.
    """
    computation = _computation(epoch)
    points, book = epoch.points.points, without_azimuths(epoch.book)[0]
    places = np.where(_known(points)[:, None], points.coordinates, epoch.points.places)
    free, book = join(freed(_released(points), places, Datum(DatumKind.INNER, tuple(names))), book)
    try:
        frame = computation.frame
        start = Determined(free, book, values_by(Graphs(frame.bend), free, book, frame.plumb))
        start.initial.require_complete()
        found = computation.determined(start, strict=True)
        require_whole(found.undetermined)
    except ObseqError:
        return None
    # observations that agree with one another hold no gross error: they contradicted the known coordinates
    diagnosis = None if fits(found) else epoch.diagnosis
    return replace(found, diagnosis=diagnosis, left_out=epoch.left_out, shown=epoch.shown)


def _computation(epoch: Adjustment) -> Computation:
    system, given = crs.parse(epoch.frame), crs.parse(epoch.points_crs)
    frame = Frame(system) if epoch.refraction is None else Frame(system, epoch.refraction)
    return Computation(frame, given, None, ITERATIONS, TOLERANCE, Stopwatch(), Quality())


def _given(epoch: Adjustment) -> dict[str, FloatArray]:
    """(3,) coordinates of the known points by name, m in their system; NaN for those that are free."""
    points = epoch.points.points
    rows = np.flatnonzero(_known(points))
    system = PointSystem(crs.parse(epoch.frame), crs.parse(epoch.points_crs))
    there, _, metres = system.coordinates_and_axes(points.coordinates[rows])
    is_given = ~points.is_free[rows] & ~points.is_held.all(axis=0)
    found = np.where(is_given, there * metres, np.nan)
    return {points.names[row]: found[k] for k, row in enumerate(rows.tolist())}


def _is_one(first: FloatArray, second: FloatArray) -> bool:
    """Whether some component is given in both, and all of these are the same."""
    apart = np.abs(first - second)
    return bool(np.isfinite(apart).any() and (np.isnan(apart) | (apart < SAME)).all())


def _known(points: Points) -> BoolArray:
    """(n,) true for points that rest on coordinates of their own, and not on what is held of all."""
    sought = ~points.is_held.all(axis=0)
    return np.asarray((~points.is_free & sought).any(axis=1))


def _released(points: Points) -> Points:
    """The points with nothing held but what is held of all of them (the plan of a levelling)."""
    sigmas = np.where(points.is_held.all(axis=0), points.sigmas, np.nan)
    return replace(points, sigmas=sigmas, covariance=None)


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
