"""The least-squares system of a survey network: unknowns of points and stations, one batch per type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
from obseq.leastsquares.assembly.evaluation import raw_residuals
from obseq.leastsquares.problem.linear import linear_batch
from obseq.leastsquares.problem.shapes import formula_shape
from obseq.survey.equations.carried import moves_of
from obseq.survey.equations.families import Family, family_of, present, rows_by_family
from obseq.survey.equations.frame import Frame
from obseq.survey.equations.instruments import Instruments
from obseq.survey.equations.joint_rows import GROUP, JointRows
from obseq.survey.equations.known_coordinates import SAME_PLACE, KnownCoordinates
from obseq.survey.equations.loose_motions import loose_motions
from obseq.survey.equations.plumb import Plumb
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.equations.shared_unknowns import SharedUnknowns
from obseq.survey.equations.site import NetworkSite
from obseq.survey.initial.initial_values import InitialValues
from obseq.survey.kinds.kind import ObservationKind
from obseq.survey.kinds.registry import BY_CODE, IS_ANGLE, among, codes_where
from obseq.survey.model import Cluster, FieldBook, Orientation, Points

WITH_OFFSETS = "Off"
"""What ends the name of a formula that takes offsets of instrument and target."""
SHORTEST_SIGHT = 1e-6
"""Distance (m) that stands for shorter ones where a sigma is divided by it."""


class Equations:
    """A network as a least-squares system.

    Attributes:
        system: The least-squares system.
        points: Block of every point.
        instruments: The rotation of every station.
        batches: Rows of the field book and batch of every family of kinds present, those of observations
            that are correlated with others apart.
        known: The equations of known coordinates.
        shared: The unknowns that groups of observations share.
    """

    def __init__(
        self,
        frame: Frame,
        point_system: PointSystem,
        points: Points,
        book: FieldBook,
        initial: InitialValues,
        system: LeastSquares | None = None,
        shared: Mapping[str, int] | None = None,
    ) -> None:
        """Puts the unknowns and equations of a network in a system.

        Args:
            frame: The computation frame.
            point_system: Coordinate system of the points.
            points: Points of the network.
            book: Observations.
            initial: Where points and stations start.
            system: One that holds other equations too; a new one when None.
            shared: Block of the points that are in that system already, by name.
        """
        self._frame = frame
        self._plumb = Plumb(frame, points)
        self._book = book
        self._followed = self._carried_at = initial.coordinates
        self._has_grid = bool((book.stations.orientations == Orientation.GRID.value).any())
        self.system = LeastSquares() if system is None else system
        self.points = self._blocks_of_points(points, initial.coordinates, shared or {})
        self.instruments = Instruments(self.system, self._plumb, book, initial)
        self.known = KnownCoordinates(self.system, self.points, points, point_system)
        self.shared = SharedUnknowns(self.system, book)
        self._site = NetworkSite(
            frame,
            self._plumb,
            book,
            self.points,
            self.instruments,
            self.shared,
        )
        self.shared.add(self._site, initial.coordinates)
        self._carried_with = self.shared.corrections()
        self._families: list[tuple[Family, Batch]] = []
        self._joint: JointRows | None = None
        self.batches = self._add_observations(initial.coordinates)
        self._set_datum(points, point_system)
        self.system.unknowns.followed_by(self._renew)

    def restart(self, points: Points, book: FieldBook, initial: InitialValues) -> None:
        """Takes the numbers of another network, which has the same equations otherwise (`kept_equations`).

        Args:
            points: The same points.
            book: The same observations; those that are inactive get no weight.
            initial: Where points and stations start.
        """
        self._book, self._plumb = book, Plumb(self._frame, points)
        self._followed = self._carried_at = initial.coordinates
        self._site = replace(self._site, plumb=self._plumb, book=book)
        self.system.set_values(self.points, initial.coordinates)
        self.instruments.restart(self.system, self._plumb, initial)
        self.known.restart(points, initial.coordinates)
        for family, batch in self._families:
            batch.active[:] = book.observations.active[family.rows]
            batch.observations = self._measured(family, initial.coordinates)
            batch.sigmas = self.sigmas(family.rows, initial.coordinates)
            self._carry(family, batch, initial.coordinates)
            batch.loss = None

    def _blocks_of_points(
        self, points: Points, coordinates: FloatArray, shared: Mapping[str, int]
    ) -> IntArray:
        new = [row for row, name in enumerate(points.names) if name not in shared]
        ids = np.array([shared.get(name, -1) for name in points.names], dtype=np.int64)
        ids[new] = self.system.add_points([points.names[row] for row in new], coordinates[new])
        return ids

    def _set_datum(self, points: Points, point_system: PointSystem) -> None:
        """Puts a free network on the components that are to carry its datum."""
        chosen = np.zeros((len(points), 3), np.bool_)
        carrying = points.in_datum.any(axis=1, keepdims=True)
        sought = points.in_datum & points.is_unknown
        chosen[:, point_system.components] = sought | (carrying & points.is_held)  # held across the frame
        rows = np.flatnonzero(chosen.any(axis=1))
        if rows.size:
            loose = loose_motions(self.system, self.points)
            self.system.set_datum(self.points[rows], chosen[rows], loose.of(rows), loose.count)

    def _add_observations(self, coordinates: FloatArray) -> dict[tuple[str, bool], tuple[IntArray, Batch]]:
        observations, batches = self._book.observations, {}
        alone = observations.active.copy()
        for name, clusters in self._clusters().items():
            rows = np.concatenate([cluster.rows for cluster in clusters])
            covariance = [cluster.covariance for cluster in clusters]
            add = self._joined if name == GROUP else self._added
            batches[name, True] = rows, add(rows, coordinates, covariance)
            alone[rows] = False
        for name, rows in rows_by_family(observations, np.flatnonzero(alone)).items():
            batches[name, False] = rows, self._added(rows, coordinates)
        return batches

    def _clusters(self) -> dict[str, list[Cluster]]:
        """What is active of the clusters, by the family of their kinds."""
        observations = self._book.observations
        found: dict[str, list[Cluster]] = {}
        for cluster in self._book.clusters:
            rest = cluster.among(observations.active)
            if rest.rows.size:
                families = {BY_CODE[code].group for code in set(observations.types[rest.rows].tolist())}
                found.setdefault(GROUP if len(families) > 1 else families.pop(), []).append(rest)
        return found

    def _joined(self, rows: IntArray, coordinates: FloatArray, covariances: list[FloatArray]) -> Batch:
        """Observations of several families that are correlated, in the system; their batches beside it."""
        batches, places = [], np.arange(len(rows))
        for _, own in sorted(rows_by_family(self._book.observations, rows).items()):
            batch = self._added(own, coordinates)
            batch.active = np.zeros(len(own), np.bool_)
            batches.append((places[np.isin(rows, own)], batch))
        self._joint = JointRows(self.system, batches, covariances, partial(_label, self._book, rows))
        return self._joint.batch

    def _added(
        self, rows: IntArray, coordinates: FloatArray, covariance: list[FloatArray] | None = None
    ) -> Batch:
        """Observations of one family, in the system."""
        family = family_of(self._book.observations, rows)
        kind, _ = family.kinds[0]
        measured, blocks = self._measured(family, coordinates), self._blocks(family)
        sigmas = 1.0 if covariance else self.sigmas(rows, coordinates)
        labels = partial(_label, self._book, rows)
        if kind.is_linear(self._site):
            columns = self._columns(blocks, measured)
            batch = self.system.add_linear(*columns, sigmas, labels=labels, group=kind.group)
        else:
            formula = kind.equation(WITH_OFFSETS if family.has_offsets else "")
            batch = self.system.add(formula, blocks, measured, sigmas, labels=labels, group=kind.group)
        if covariance:
            batch.correlate_all(covariance)
        self._carry(family, batch, coordinates)
        self._families.append((family, batch))
        return batch

    def _columns(
        self, blocks: dict[str, IntArray], measured: FloatArray
    ) -> tuple[list[IntArray], list[FloatArray], FloatArray]:
        """Unknowns, coefficients and values of linear rows."""
        ids = list(blocks.values())
        sizes = [int(self.system.unknowns.size[block[0]]) for block in ids]
        return ids, np.split(measured[:, :-1], np.cumsum(sizes)[:-1], axis=1), measured[:, -1]

    def unused(self, solution: LeastSquaresResult) -> tuple[IntArray, FloatArray, FloatArray]:
        """Rows of inactive observations that a solution says something of, (k,) residuals and sigmas.

        Both points have a place there, and the instrument an orientation. Not those of groups, whose
        unknowns others share.
        """
        observations, coordinates = self._book.observations, solution.values(self.points)
        has_place = np.append(np.isfinite(coordinates).all(axis=1), False)
        ends = np.stack([observations.from_points, observations.to_points])
        is_there = has_place[np.minimum(ends, len(coordinates))].all(axis=0)
        on_stations = among(observations.types, codes_where(lambda kind: kind.needs_station))
        is_there &= (observations.stations >= 0) | ~on_stations
        rows = np.flatnonzero(~observations.active & is_there & (observations.groups < 0))
        unknowns, sigmas = self.system.unknowns, np.zeros(len(self._book.observations))
        residuals, now = np.full(len(sigmas), np.nan), unknowns.state()
        if rows.size:
            unknowns.restore(solution.state)
        for own in rows_by_family(observations, rows).values():
            scales = self._grid_scales(own, coordinates)
            sigmas[own] = self.sigmas(own, coordinates) / scales
            residuals[own] = raw_residuals(unknowns, self._apart(own, coordinates))[:, 0] / scales
        if rows.size:
            unknowns.restore(now)
        return rows, residuals[rows], sigmas[rows]

    def _apart(self, rows: IntArray, coordinates: FloatArray) -> Batch:
        """Observations of one family, in no system."""
        family = family_of(self._book.observations, rows)
        kind, _ = family.kinds[0]
        measured, blocks = self._measured(family, coordinates), self._blocks(family)
        if kind.is_linear(self._site):
            return linear_batch(self.system.unknowns, *self._columns(blocks, measured), 1.0, None, None)
        shape = formula_shape(kind.equation(WITH_OFFSETS if family.has_offsets else ""))
        return Batch(shape, self.system.unknowns, blocks, measured, 1.0, None, None, None)

    def _blocks(self, family: Family) -> dict[str, IntArray]:
        """The unknowns of the equations of one family, by the names of the formula."""
        parts = [kind.blocks(self._site, family.rows[at]) for kind, at in family.kinds]
        return {name: family.gathered([part[name] for part in parts]) for name in parts[0]}

    def _measured(self, family: Family, coordinates: FloatArray) -> FloatArray:
        """(n, m) what the equation takes besides blocks: offsets if any, its context, the value last."""
        rows = family.rows
        measured = family.gathered([self._taken(kind, rows[at], coordinates) for kind, at in family.kinds])
        if self._has_grid and measured.shape[1]:
            measured[:, -1] *= self._grid_scales(rows, coordinates)
        if family.has_offsets:
            offsets = self._plumb.offsets(self._book, rows, coordinates)
            measured = np.concatenate([offsets, measured], axis=1)
        return measured

    def _taken(self, kind: ObservationKind, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n, m) context and value of observations of one kind."""
        values = kind.values(self._site, rows, coordinates).reshape(len(rows), -1)
        return np.concatenate([kind.context(self._site, rows, coordinates), values], axis=1)

    def _carry(self, family: Family, batch: Batch, coordinates: FloatArray) -> None:
        """Completes the derivatives by points by what these carry along, at coordinates of all."""
        names = list(family.kinds[0][0].blocks(self._site, family.rows[:1]))
        if not batch.shape.is_linear:
            names = [role.name for role in batch.shape.roles]
        places = {name: place for place, name in enumerate(names)}
        batch.carry(moves_of(self._site, family, places, coordinates))

    def _grid_scales(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) what values of stations along the grid are multiplied by; 1 for others."""
        return self._site.grid_scales(rows, coordinates) if self._has_grid else np.ones(len(rows))

    def sigmas(self, rows: IntArray, coordinates: FloatArray) -> FloatArray:
        """(n,) sigmas of observations, with their relative parts at the distances between points there."""
        observations = self._book.observations
        relative = observations.relative_sigmas[rows]
        if not relative.any() and not self._has_grid:
            return observations.sigmas[rows]
        sights = coordinates[observations.to_points[rows]] - coordinates[observations.from_points[rows]]
        sights = sights + self._plumb.offsets(self._book, rows, coordinates)
        distances = np.linalg.norm(sights, axis=1)
        is_angle = IS_ANGLE[observations.types[rows]]
        share = np.where(is_angle, 1.0 / np.maximum(distances, SHORTEST_SIGHT), distances)
        return np.asarray(
            self._grid_scales(rows, coordinates) * (observations.sigmas[rows] + relative * share)
        )

    def follow(self, system: LeastSquares, _number: int) -> None:
        """Before an evaluation: renews what depends on positions, sigmas too."""
        self._renew()
        coordinates = system.values(self.points)
        for (_, is_correlated), (rows, batch) in self.batches.items():
            if not is_correlated and (self._has_grid or self._book.observations.relative_sigmas[rows].any()):
                batch.sigmas = self.sigmas(rows, coordinates)

    def _renew(self) -> None:
        """Wherever the unknowns have moved: turns instruments with their verticals, renews what is given."""
        coordinates, corrections = self.system.values(self.points), self.shared.corrections()
        self.known.follow(coordinates)
        if not np.array_equal(coordinates, self._followed) or corrections != self._carried_with:
            self._followed = coordinates
            self.instruments.follow(self.system, coordinates)
            has_moved = bool((np.abs(coordinates - self._carried_at) > SAME_PLACE).any())
            has_moved |= corrections != self._carried_with
            if has_moved:
                self._carried_at, self._carried_with = coordinates, corrections
            for family, batch in self._families:
                if has_moved:
                    self._carry(family, batch, coordinates)
                if self._has_grid or family.depends_on_place or self._plumb.is_deflected:
                    batch.observations = self._measured(family, coordinates)
        self.linearise()

    def linearise(self) -> None:
        """Makes the rows of equations that are correlated with others anew, at the current values."""
        if self._joint is not None:
            self._joint.follow()

    def fitted(self, solution: LeastSquaresResult | LeastSquares) -> tuple[FloatArray, FloatArray]:
        """(n,) residuals of all observations, NaN for inactive ones, and the sigmas of the adjustment."""
        residuals = np.full(len(self._book.observations), np.nan)
        sigmas = self._book.observations.sigmas.copy()
        coordinates = solution.values(self.points)
        for rows, batch in self.batches.values():
            found = solution.residuals(batch)
            scales = self._grid_scales(rows, coordinates)
            sigmas[rows] = sigmas_of(batch) / scales
            residuals[rows] = found[:, 0] / scales
        return residuals, sigmas

    def scales(self, coordinates: FloatArray) -> FloatArray:
        """(n,) what a unit of computed minus observed is in the residual of its equation; 0 for inactive."""
        found = np.zeros(len(self._book.observations))
        for rows, _ in self.batches.values():
            found[rows] = self._grid_scales(rows, coordinates)
        return found

    def horizons(self, points: IntArray, coordinates: FloatArray) -> FloatArray:
        """(k, 3, 3) east, north and up at points, by rows; axes of the frame in one that has no vertical."""
        if not self._frame.has_vertical:
            return np.tile(np.eye(3), (len(points), 1, 1))
        return np.asarray(self._plumb.axes(points, coordinates))

    def local_axes(self, coordinates: FloatArray) -> FloatArray:
        """(n, 3) what a metre east, north and up adds to components of vectors and positions.

        NaN of others. At the first point of each, where the frame has a vertical.
        """
        observations = self._book.observations
        found = np.full((len(observations), 3), np.nan)
        for rows, _ in self.batches.values() if self._frame.has_vertical else ():
            if not any(BY_CODE[code].is_component for code in present(observations.types[rows])):
                continue
            origins = observations.from_points[rows].astype(np.int64)
            local = self._plumb.axes(origins, coordinates)
            for kind, chosen in family_of(observations, rows).kinds:
                if kind.is_component:
                    axis = kind.context(self._site, rows[chosen], coordinates)[:, -3:]
                    found[rows[chosen]] = np.einsum("ikj,ij->ik", local[chosen], axis)
        return found

    def shares(self, solution: LeastSquaresResult) -> FloatArray:
        """(n,) what correlated observations add to the weighted sum of squares, v (P v); NaN for others."""
        shares = np.full(len(self._book.observations), np.nan)
        for rows, batch in self.batches.values():
            if batch.clusters is not None:
                residuals, root = np.nan_to_num(solution.residuals(batch)[:, 0]), batch.whitening_matrix()
                shares[rows] = residuals * (root.T @ (root @ residuals))
        return shares

    def instrument_rotations(self, solution: LeastSquaresResult) -> FloatArray:
        """(m, 3, 3) rotations from the vertical to the instrument, in the solution."""
        return self.instruments.oriented(solution, solution.values(self.points))


def sigmas_of(batch: Batch) -> FloatArray:
    """(n,) standard deviations of observations with one residual each, correlated or not."""
    if batch.clusters is not None:
        return np.sqrt(batch.clusters.variances())
    return np.asarray(batch.sigmas[:, 0])


def _label(book: FieldBook, rows: IntArray, k: int) -> str:
    """What the observations of some rows are called in messages."""
    return book.label(int(rows[k]))
