"""A block of images as the engine of the diagnosis sees it: equations at places, adjustments with changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.diagnosis.columns import Columns
from obseq.diagnosis.hypotheses import Hypotheses
from obseq.diagnosis.linear import Linear, linearised, with_priors
from obseq.diagnosis.policy import LOSSES, NO_WEIGHT, POLICY
from obseq.diagnosis.protocol import Change, Slip
from obseq.errors import ObseqError
from obseq.images.adjustment.approach import approach
from obseq.images.adjustment.equations import MeasureBatch
from obseq.images.adjustment.start import Start, contradicted
from obseq.images.causes.cameras import HELD_PARAMETER
from obseq.images.causes.evidence import Evidence
from obseq.images.causes.numbering import Numbering
from obseq.images.diagnosing.catalogue import Catalogue
from obseq.images.initial.rough import ROUGH
from obseq.leastsquares import LeastSquares, LeastSquaresResult
from obseq.leastsquares.problem.losses import GemanMcClure, Huber
from obseq.leastsquares.problem.unknowns import State

STAGES, ROUNDS = (25, 8, 8), 5
"""The most iterations with each loss of the robust start; where it begins at a solution, with each."""
NEAR, ITERATIONS, TOLERANCE = 0.05, 20, 1e-4
"""Standard deviations by which unknowns may still move: after a stage, and after an adjustment."""
DAMPED, UNDAMPED = "levenberg-marquardt", "gauss-newton"


class Place(NamedTuple):
    """Where the unknowns of a block are."""

    state: State


class BlockModel:
    """One block: its equations are borrowed, and are given back as they were.

    Attributes:
        numbering: of the equations.
        catalogue: what may be wrong.
    """

    def __init__(
        self,
        numbering: Numbering,
        result: LeastSquaresResult | None,
        before: Callable[[LeastSquares, int], None] | None = None,
        other_starts: Sequence[Callable[[], Start | None]] = (),
    ) -> None:
        """Takes a block.

        Args:
            numbering: its equations.
            result: of their adjustment; None where there is none.
            before: is called before each iteration.
            other_starts: find other poses in turn, where those given are no start; asked for once.
        """
        self.numbering, self._result = numbering, result
        self._before, self._other_starts = before, [cache(found) for found in other_starts]
        self.catalogue = Catalogue(numbering)
        self._system = numbering.equations.system
        self._table = self._system.unknowns
        self._actives = [batch.active.copy() for batch in numbering.batches]
        self._sigmas = [prior.sigmas.copy() for prior in numbering.priors]
        self._losses = [batch.loss for batch in numbering.batches]
        self._weights = [batch.weights.copy() for batch in numbering.batches]
        self._state, self._frozen = self._table.state(), self._table.frozen.copy()
        self._given: Place | None = None
        self._evidence: tuple[Place, Evidence] | None = None

    @contextmanager
    def borrowed(self) -> Iterator[None]:
        """Without losses as long as it lasts; all is as it was afterwards."""
        given = self._actives, self._frozen
        self._lose(None)
        try:
            yield
        finally:
            for batch, loss in zip(self.numbering.batches, self._losses, strict=True):
                batch.loss = loss
            self._actives, self._frozen = given
            self._put_back()
            self._table.restore(self._state)
            for batch, weights in zip(self.numbering.batches, self._weights, strict=True):
                batch.weights[:] = weights

    @property
    def hypotheses(self) -> Hypotheses:
        """What may be wrong."""
        return self.catalogue.hypotheses

    @property
    def _is_plain(self) -> bool:
        """Whether the adjustment as given had no losses."""
        return all(loss is None for loss in self._losses)

    @property
    def _ended(self) -> Place | None:
        return Place(self._result.state) if self._result and self._result.converged else None

    @cached_property
    def _solution(self) -> Place | None:
        self._given = self._ended if self._is_plain else None
        return self._given

    def solution(self) -> Place | None:
        """Where the adjustment as given ended; None where it did not converge."""
        return self._solution

    def robust(self, without: Sequence[Change] = ()) -> Place:
        """Where iterations with redescending losses lead: from the start, or from poses of the measures.

        In a large block a few errors do not carry least squares away: there they begin where these ended.
        Where the adjustment had robust weights, that is where it ended. More contradictions than errors that
        are told one by one may come from the start.
        """
        if not self._is_plain and not without and self._ended:
            return self._ended
        ended, most = self._solution, POLICY.half * np.count_nonzero(self.numbering.kept)
        if self.numbering.n > POLICY.large and ended and self._off(ended) < most:
            return self._robustly(ended, without)
        found = self._robustly(self.numbering.equations.start, without)
        for other_start in self._other_starts:
            if self._off(found) <= POLICY.most:
                break
            start = other_start()
            other = found if start is None else self._robustly(start, without)
            found = other if self._off(other) < self._off(found) else found
        return found

    def _robustly(self, start: Start | Place, without: Sequence[Change]) -> Place:
        if isinstance(start, Place):
            self._table.restore(start.state)
        else:
            self._begin(start)
        with self._changed(without):
            try:
                if not isinstance(start, Place) and start.misfit > ROUGH:
                    approach(self.numbering.equations, DAMPED, {"max_iterations": ITERATIONS})
                for loss, count in zip(LOSSES, STAGES, strict=True):
                    self._lose(loss)
                    rounds, strategy = (ROUNDS, UNDAMPED) if isinstance(start, Place) else (count, DAMPED)
                    self._solve(max_iterations=rounds, tolerance=NEAR, strategy=strategy)
                    self._put_where_rays_meet()
            except ObseqError:
                pass  # what has been found so far is what there is
            finally:
                self._lose(None)
        return Place(self._table.state())

    def _begin(self, start: Start) -> None:
        """Puts the unknowns where a start has them."""
        equations, system = self.numbering.equations, self._system
        system.set_values(equations.centres, start.poses.centres)
        system.set_values(equations.rotations, start.poses.rotations)
        cameras = {camera.name: camera for camera in start.cameras}
        for name, block in zip(equations.cameras, equations.calibrations.tolist(), strict=True):
            system.set_values([block], cameras[name].parameters[None])
        known = {name: k for k, name in enumerate(start.points)}
        rows = [row for row, name in enumerate(equations.start.points) if name in known]
        places = start.places[[known[equations.start.points[row]] for row in rows]]
        good = np.isfinite(places).all(axis=1)
        system.set_values(equations.points[np.array(rows, np.int64)[good]], places[good])

    def _put_where_rays_meet(self) -> None:
        """Puts control points where their rays meet, if these contradict them: no step leads so far."""
        here = Evidence.of(self.numbering)
        start = replace(self.numbering.equations.start, poses=here.poses, cameras=here.cameras)
        rows, places = contradicted(start)
        self._system.set_values(self.numbering.equations.points[rows], places)

    def off(self, place: Place) -> FloatArray:
        """(m,) how far image points are from where they should be, in sigmas."""
        self._table.restore(place.state)
        found = [
            np.linalg.norm(self._system.residuals(item.batch) / self._sigmas_of(item), axis=1)
            for item in self.numbering.equations.measures
        ]
        return np.asarray(np.nan_to_num(np.concatenate(found), nan=np.inf))

    def _sigmas_of(self, item: MeasureBatch) -> FloatArray:
        return self.numbering.equations.start.sets[item.part].given.measures.sigmas[item.rows]

    def _off(self, place: Place) -> int:
        """How many image points a place contradicts."""
        return int(np.count_nonzero(self.off(place)[self.numbering.kept] > POLICY.suspect))

    def leave_out(self, images: IntArray, place: Place) -> None:
        """Goes on without some images, from a place, for as long as the block is borrowed."""
        numbering, first = self.numbering, 0
        self._table.restore(place.state)
        for item in numbering.equations.measures:
            own = np.isin(numbering.image[first : first + len(item.rows)], images)
            item.batch.active = item.batch.active & ~own
            first += len(item.rows)
        self._hold_lonely()
        self._actives = [batch.active.copy() for batch in numbering.batches]
        self._frozen = self._table.frozen.copy()
        result = self._solve(max_iterations=ITERATIONS)
        self._solution = Place(self._table.state()) if result.converged else None

    def linearised(self, place: Place, applied: Sequence[Change]) -> tuple[Linear, Columns]:
        """All equations as they are given, at a place; applied parameters have their other values.

        Coordinates that were freed stay where they are: their values are put back along the tangent.
        """
        result, is_there = self._result, place is self._given
        self._table.restore(place.state)
        if result is None or applied or not is_there or not result.has_covariances:
            self._hold(applied)
            result = self._solve(max_iterations=0, covariance=True)
        linear = linearised(self._system, result, self.numbering.batches)
        linear = with_priors(linear, self._system, result, self.numbering.priors)
        columns = self.catalogue.columns(linear)
        off = self._given_coordinates() - self._held_coordinates()
        if off.any():
            first = self.numbering.n + len(self.numbering.parameters)
            linear.residuals[:] += columns.effect(first + np.arange(len(off)), off)
        return linear, columns

    def adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool, int]:
        """Where least squares without some errors lead from a place."""
        self._table.restore(place.state)
        self._hold(changes)
        self._hold_coordinates(changes)
        with self._changed(changes):
            result = self._solve(max_iterations=ITERATIONS, tolerance=TOLERANCE)
        return Place(self._table.state()), result.converged, len(result.iterations)

    def slips(self, change: Change, place: Place) -> tuple[Slip, ...]:
        """The slips that may be behind an error, the likeliest first."""
        if self._evidence is None or self._evidence[0] is not place:
            self._table.restore(place.state)
            self._evidence = place, Evidence.of(self.numbering)
        named = self.catalogue.named(change.index)
        return tuple(named.cause.slips(self._evidence[1], named.label, change))

    def _solve(
        self,
        max_iterations: int,
        tolerance: float = TOLERANCE,
        covariance: bool = False,
        strategy: str = DAMPED,
    ) -> LeastSquaresResult:
        return self._system.solve(
            strategy=strategy,
            max_iterations=max_iterations,
            tolerance=tolerance,
            covariance=covariance,
            before_iteration=self._before,
        )

    def _lose(self, loss: Huber | GemanMcClure | None) -> None:
        for batch in self.numbering.batches:
            batch.loss = loss

    def _hold(self, changes: Sequence[Change]) -> None:
        """Held parameters at the values that were given, those of changes put right."""
        numbering = self.numbering
        for k, parameter in enumerate(numbering.parameters):
            given = self._table.read([parameter.block], self._state)[0]
            at = self._table.components(parameter.block).index(parameter.name)
            off = [change.size[0] for change in changes if self._parameter(change) == k]
            values = self._system.values([parameter.block])
            values[0, at] = given[at] - sum(off)
            self._system.set_values([parameter.block], values)

    def _held_coordinates(self) -> FloatArray:
        """(h,) where held coordinates of control points are."""
        points, axes = self.numbering.held.T
        return np.asarray(self._system.values(self.numbering.equations.points)[points, axes])

    def _given_coordinates(self) -> FloatArray:
        """(h,) where they were given."""
        points, axes = self.numbering.held.T
        return np.asarray(self._table.read(self.numbering.equations.points, self._state)[points, axes])

    def _hold_coordinates(self, changes: Sequence[Change]) -> None:
        """Held coordinates at the values that were given, but those that changes free."""
        points, axes = self.numbering.held.T
        if not len(points):
            return
        kept = np.ones(len(points), np.bool_)
        for change in changes:
            kept[self._freed(change)] = False
        blocks = self.numbering.equations.points
        values = self._system.values(blocks)
        values[points[kept], axes[kept]] = self._given_coordinates()[kept]
        self._system.set_values(blocks[points], values[points])

    def _freed(self, change: Change) -> IntArray:
        """Numbers of the held coordinates that a change is of."""
        columns = self.catalogue.named(change.index).columns - self.numbering.n
        columns = columns - len(self.numbering.parameters)
        return np.asarray(columns[columns >= 0])

    def _parameter(self, change: Change) -> int:
        """Number of the held parameter that a change is of; -1 for none."""
        named = self.catalogue.named(change.index)
        return named.label[0] if named.cause is HELD_PARAMETER else -1

    @contextmanager
    def _changed(self, changes: Sequence[Change]) -> Iterator[None]:
        """The block without errors: rows out, what they alone determine held, what is held freed."""
        try:
            out = np.zeros(self.numbering.n, np.bool_)
            for change in changes:
                columns = self.catalogue.named(change.index).columns
                out[columns[columns < self.numbering.n]] = True
                if (k := self._parameter(change)) >= 0:
                    parameter = self.numbering.parameters[k]
                    self._system.unfreeze([parameter.block], (parameter.name,))
                for point, axis in self.numbering.held[self._freed(change)].tolist():
                    self._system.unfreeze([self.numbering.equations.points[point]], (axis,))
            self._take_out(out)
            yield
        finally:
            self._put_back()

    def _take_out(self, out: BoolArray) -> None:
        """Switches equations (n,) off."""
        first = 0
        for batch, active in zip(self.numbering.batches, self._actives, strict=True):
            width = batch.shape.n_residuals
            own = out[first : first + width * batch.n].reshape(batch.n, width).any(axis=1)
            if own.any():
                batch.active = active & ~own
            first += width * batch.n
        for prior, sigmas in zip(self.numbering.priors, self._sigmas, strict=True):
            own = out[first : first + len(sigmas)]
            if own.any():
                prior.sigmas = np.where(own[:, None], NO_WEIGHT * sigmas, sigmas)
            first += len(sigmas)
        if out[: self.numbering.first_control].any():
            self._hold_lonely()

    def _hold_lonely(self) -> None:
        """Points that keep one ray keep their place, as do images and cameras that keep none."""
        numbering, equations = self.numbering, self.numbering.equations
        active = np.concatenate([item.batch.active for item in equations.measures])
        rays = np.bincount(numbering.point[active], minlength=len(equations.points))
        lonely = (rays < 2) & equations.start.is_free.all(axis=1) & ~self._joined
        image_rays = np.bincount(numbering.image[active], minlength=len(equations.centres))
        if lonely.any():
            first = 0
            for item in equations.measures:
                own = lonely[numbering.point[first : first + len(item.rows)]]
                item.batch.active = item.batch.active & ~own
                first += len(item.rows)
            self._system.freeze(equations.points[lonely])
        lost = np.flatnonzero(image_rays == 0)
        if lost.size and not numbering.priors:
            self._system.freeze(equations.centres[lost])
            self._system.freeze(equations.rotations[lost])
        camera_rays = np.bincount(numbering.camera[numbering.image[active]], minlength=len(equations.cameras))
        for row in np.flatnonzero(camera_rays == 0).tolist():
            name = numbering.cameras[row]
            self._system.freeze([int(equations.calibrations[equations.cameras.index(name)])])

    @cached_property
    def _joined(self) -> BoolArray:
        """(p,) points that other observations join."""
        from obseq.images.names import are_among

        start = self.numbering.equations.start
        return np.asarray(are_among(start.points, self.numbering.equations.block.joined_points))

    def _put_back(self) -> None:
        """Equations that count, and unknowns that are held, as they were given."""
        for batch, active in zip(self.numbering.batches, self._actives, strict=True):
            if not np.array_equal(batch.active, active):
                batch.active = active
        for prior, sigmas in zip(self.numbering.priors, self._sigmas, strict=True):
            if not np.array_equal(prior.sigmas, sigmas):
                prior.sigmas = sigmas
        self._table.frozen[:] = self._frozen
