"""Known coordinates as equations: held or with a sigma, in the system in which the points are given."""

from __future__ import annotations

from functools import partial

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.equations.surroundings import Recent
from obseq.survey.model import Points

GROUP = "points"
"""The group of the constraints on coordinates, which MMVII's sigma0 leaves out."""
COMPONENTS = ("x", "y", "z")
_EARTH = 6.371e6
"""Radius of the Earth (m), to some thousandths."""
_AT_POLE = 1e-3
"""Distance (m) from a pole within which a point is on it."""
SAME_PLACE = 1e-3
"""After moves (m) below it the equations still hold to 1e-13 m, and what points carry along to 1e-3 / D."""


@dataclass(frozen=True, eq=False)
class CoordinateResiduals:
    """How the known coordinates fit, one row for each that was given with a sigma.

    Attributes:
        points: (k,) rows of the points.
        components: (k,) 0 for x, 1 for y, 2 for z of the system of the points.
        values: (k,) as given, in the units of that system.
        sigmas: (k,) m.
        residuals: (k,) adjusted minus given, m.
    """

    points: IntArray
    components: IntArray
    values: FloatArray
    sigmas: FloatArray
    residuals: FloatArray

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Tangents:
    """Coordinates of some points in their system, and how these change there.

    Attributes:
        here: (k, 3) coordinates in the frame.
        computed: (k, 3) in the system of the points, in its units.
        axes: (k, 3, 3) derivatives, metres in that system by metres in the frame.
        stretching: (k, 3, 3) derivatives of these metres, for one of them.
        metres: (k, 3) metres in one unit of each coordinate.
    """

    here: FloatArray
    computed: FloatArray
    axes: FloatArray
    metres: FloatArray
    stretching: FloatArray


class KnownCoordinates:
    """The equations of known coordinates, linearised anew at each position of the points."""

    def __init__(
        self, system: LeastSquares, ids: IntArray, points: Points, point_system: PointSystem
    ) -> None:
        self._points = points
        self._system = point_system
        self._ids = ids
        self._values = _given(points, point_system)
        self._sigmas = points.sigmas
        self._linearised_at = system.values(ids)
        self._correlated = _correlated(points)
        independent = ~(points.is_free | points.is_held)
        independent[self._correlated] = False
        self._rows, self._components = np.nonzero(independent)
        self._held_rows, self._held_components = self._freeze(system)
        is_known = np.zeros(len(ids), bool)
        for rows in (self._rows, self._correlated[0], self._held_rows):
            is_known[rows] = True
        self._known = np.flatnonzero(is_known)
        self._tangents = Recent(partial(_tangents, point_system))
        self._soft = self._add_soft(system)
        self._hard = self._add_hard(system)
        self._together = self._add_together(system)

    def _freeze(self, system: LeastSquares) -> tuple[IntArray, IntArray]:
        """Freezes what is held along axes of the frame; (rows, components) of what is held otherwise.

        What is invented where the points start is held along the frame.
        """
        invented = self._points.is_free & self._points.is_invented
        held = self._points.is_held | invented
        whole = np.asarray(held.all(axis=1))
        along = np.tile(whole[:, None], 3) | self._system.is_along_frame
        along = along | invented
        for component in range(3):
            frozen = self._ids[held[:, component] & along[:, component]]
            if frozen.size:
                system.freeze(frozen, (int(self._system.components[component]),))
        rows, components = np.nonzero(held & ~along)
        return rows, components

    def _add_soft(self, system: LeastSquares) -> Batch | None:
        rows, components = self._rows, self._components
        return self._added(system, rows, components, self._sigmas[rows, components])

    def _add_together(self, system: LeastSquares) -> Batch | None:
        """Coordinates that are correlated with one another."""
        batch = self._added(system, *self._correlated, np.ones(len(self._correlated[0])))
        if batch is not None and self._points.covariance is not None:
            batch.correlate_all([self._points.covariance.matrix])
        return batch

    def _added(
        self, system: LeastSquares, rows: IntArray, components: IntArray, sigmas: FloatArray
    ) -> Batch | None:
        if not rows.size:
            return None
        equations = self._linearised(rows, components)
        return system.add_linear(
            [self._ids[rows]],
            [equations[:, :3]],
            equations[:, 3],
            sigmas,
            labels=partial(_label, self._points, rows, components),
            group=GROUP,
            is_constraint=True,
        )

    def _add_hard(self, system: LeastSquares) -> Batch | None:
        rows, components = self._held_rows, self._held_components
        if not rows.size:
            return None
        equations = self._linearised(rows, components)
        labels = partial(_label, self._points, rows, components)
        return system.constrain_linear([self._ids[rows]], [equations[:, :3]], equations[:, 3], labels=labels)

    def together(self) -> dict[Batch, IntArray]:
        """The equations of coordinates that are correlated with one another: row of the point of each."""
        return {} if self._together is None else {self._together: self._correlated[0]}

    def coordinates(self) -> IntArray:
        """(k, 2) point and component of each equation, in the order of `residuals`."""
        rows = np.concatenate([self._rows, self._correlated[0]])
        components = np.concatenate([self._components, self._correlated[1]])
        return np.column_stack([rows, components]).astype(np.int64)

    @property
    def curvature(self) -> float:
        """Of the Earth (1/m) where coordinates are those of a map; 0 where they are those of the frame."""
        return 0.0 if self._system.is_along_frame else 1.0 / _EARTH

    def about_centre(self) -> FloatArray:
        """(k, 3) coordinates in their system (m), about their centre, of the point of each equation."""
        rows = np.concatenate([self._rows, self._correlated[0]])
        tangents = self._tangents.of(self._linearised_at[self._known])
        found = tangents.computed[np.searchsorted(self._known, rows)]
        if not len(found):
            return found
        arms = self._system.system.differences(found, found[:1])
        return np.asarray((arms - arms.mean(axis=0)) * tangents.metres[:1])

    def places(self) -> dict[Batch, IntArray]:
        """Where the equations stand in `residuals`."""
        own, start = {}, 0
        for batch in (self._soft, self._together):
            if batch is not None:
                own[batch] = start + np.arange(batch.n)
                start += batch.n
        return own

    def _linearised(self, rows: IntArray, components: IntArray) -> FloatArray:
        """(k, 4) coefficients of points of the frame, and values: axis (p - here) = given - computed."""
        tangents = self._tangents.of(self._linearised_at[self._known])
        position = np.searchsorted(self._known, rows)
        gaps = self._system.system.differences(self._values[self._known], tangents.computed) * tangents.metres
        gaps, here = gaps[position, components], tangents.here[position]
        coefficients = tangents.axes[position, components]
        coefficients = coefficients - gaps[:, None] * tangents.stretching[position, components]
        values = gaps + np.einsum("kj,kj->k", coefficients, here)
        return np.concatenate([coefficients, values[:, None]], axis=1)

    def follow(self, coordinates: FloatArray) -> None:
        """Linearises at coordinates of all points; along axes of the frame nothing changes."""
        moved = np.abs(coordinates - self._linearised_at).max(initial=0.0)
        if not self._system.is_along_frame and not moved < SAME_PLACE:
            self._linearise(coordinates)

    def restart(self, points: Points, coordinates: FloatArray) -> None:
        """Takes the coordinates and sigmas of other points, of which the same components are known.

        Args:
            points: These points.
            coordinates: (n, 3) where all points start.
        """
        if not np.array_equal(points.coordinates, self._points.coordinates, equal_nan=True):
            self._values = _given(points, self._system)
        self._points, self._sigmas = points, points.sigmas
        if self._soft is not None:
            self._soft.sigmas = self._sigmas[self._rows, self._components]
        self._linearise(coordinates)

    def _linearise(self, coordinates: FloatArray) -> None:
        self._linearised_at = coordinates
        if self._soft is not None:
            self._soft.observations = self._linearised(self._rows, self._components)
        if self._together is not None:
            self._together.observations = self._linearised(*self._correlated)
        if self._hard is not None:
            self._hard.observations = self._linearised(self._held_rows, self._held_components)

    def residuals(self, solution: LeastSquaresResult) -> CoordinateResiduals:
        """How the coordinates given with a sigma fit a solution."""
        rows = np.concatenate([self._rows, self._correlated[0]])
        components = np.concatenate([self._components, self._correlated[1]])
        if not rows.size:
            return CoordinateResiduals(rows, components, *(np.zeros(0) for _ in range(3)))
        found, position = np.unique(rows, return_inverse=True)
        here = solution.values(self._ids[found])
        computed, _, metres = self._system.coordinates_and_axes(here)
        gaps = self._system.system.differences(computed, self._values[found]) * metres
        sigmas = self._sigmas[rows, components]
        if self._points.covariance is not None:
            sigmas[len(self._rows) :] = np.sqrt(np.diag(self._points.covariance.matrix))
        values = self._values[rows, components]
        return CoordinateResiduals(rows, components, values, sigmas, gaps[position, components])


def _given(points: Points, point_system: PointSystem) -> FloatArray:
    """(n, 3) coordinates in the system of the points, NaN for those that are unknown."""
    values = np.full((len(points), 3), np.nan)
    some = np.flatnonzero(~points.is_free.all(axis=1))
    names = [points.names[row] for row in some]
    values[some] = point_system.coordinates(points.coordinates[some], names)
    unit = point_system.system.plan_unit
    if unit.is_angle:
        for row in some[_EARTH * np.cos(values[some, 1] * unit.factor) < _AT_POLE]:
            raise InputError(
                f"point {points.names[row]} ({points.place(row)}) is known at a pole, where it has no "
                "longitude: give the points in a system without (GeoC, or a polar projection as EPSG:32661)"
            )
    return values


def _tangents(system: PointSystem, here: FloatArray) -> Tangents:
    """Those of points at `here` (k, 3) in the frame."""
    computed, axes, metres = system.coordinates_and_axes(here)
    return Tangents(here, computed, axes, metres, system.stretching(computed, axes, metres))


def _correlated(points: Points) -> tuple[IntArray, IntArray]:
    """(rows, components) of the coordinates that a covariance is given for, in its order."""
    given = points.covariance.coordinates if points.covariance else ()
    rows = [points.index[name] for name, _ in given]
    return np.array(rows, np.int64), np.array([component for _, component in given], np.int64)


def _label(points: Points, rows: IntArray, components: IntArray, k: int) -> str:
    """What the known coordinates of some rows are called in messages."""
    row = int(rows[k])
    return f"{COMPONENTS[components[k]]} of {points.names[row]} ({points.place(row)})"
