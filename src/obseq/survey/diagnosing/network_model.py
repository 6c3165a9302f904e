"""A survey network as the engine of the diagnosis sees it: equations at places, adjustments with changes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from obseq.cached import cached_property
from obseq.diagnosis.linear import linearised
from obseq.diagnosis.policy import LOSSES, NO_WEIGHT, POLICY
from obseq.errors import ObseqError, SingularSystemError
from obseq.leastsquares.assembly.clusters import whitening_of
from obseq.leastsquares.iterations.arrival import Options
from obseq.leastsquares.iterations.strategies import GaussNewton
from obseq.survey.causes.catalogue import KNOWN, KNOWN_PLAN, Catalogue
from obseq.survey.causes.effects import Effects
from obseq.survey.causes.notes import Notes
from obseq.survey.causes.set_ups import INSTRUMENT_HEIGHT, TARGET_HEIGHT
from obseq.survey.equations.kept_equations import KeptEquations
from obseq.survey.kinds.registry import IS_ANGLE, codes_where

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import BoolArray, FloatArray
    from obseq.diagnosis.columns import Columns
    from obseq.diagnosis.hypotheses import Hypotheses
    from obseq.diagnosis.linear import Linear
    from obseq.diagnosis.protocol import Change, Slip
    from obseq.leastsquares import Batch, LeastSquaresResult
    from obseq.leastsquares.problem.losses import GemanMcClure, Huber
    from obseq.leastsquares.problem.unknowns import State
    from obseq.report.tables.units import Units
    from obseq.survey.causes.cause import KnownCause
    from obseq.survey.causes.slips import Evidence
    from obseq.survey.equations.equations import Equations
    from obseq.survey.equations.point_system import PointSystem
    from obseq.survey.initial.left_out import Determined
    from obseq.survey.model import FieldBook, Points

    Stage = tuple[Huber | GemanMcClure, int, float]

_STAGES = tuple(zip(LOSSES, (14, 6, 6), (0.3, 0.1, 0.1), strict=True))
"""Losses of the robust start, the most iterations with each, and how near they come (standard deviations)."""
_AT_FIRST = ((LOSSES[0], 2, 0.3),)
"""Of a glance: two iterations bring right values from initial ones to their noise, and wrong ones nowhere."""
_FOLLOW = 3
"""Verticals and refraction are computed anew after so many iterations of the robust start."""
_ENDLESS = 1e9
"""Misfit beyond which a contradiction is a whole one."""
_ITERATIONS, _TOLERANCE = 20, 1e-4
_HELD = 0.1
"""Of the smallest sigma of a length: the sigma with which held coordinates are doubted."""


class Place(NamedTuple):
    """Where the unknowns of a network are.

    Rotations are those to the frame, and stand in the state too: given to initial values alone, they would be
    turned by deflections of the vertical a second time.
    """

    coordinates: FloatArray
    rotations: FloatArray
    state: State


def place_of(equations: Equations) -> Place:
    """Where the unknowns of some equations are now."""
    system = equations.system
    return Place(
        system.values(equations.points), equations.instruments.rotations(system), system.unknowns.state()
    )


class NetworkModel:
    """One network: what may be wrong with it is made once, its equations change numbers only.

    Attributes:
        given: The network, held coordinates with a sigma.
        as_given: The network as it is.
        solved: Its equations and their solution with covariances; None where there is none.
        catalogue: What may be wrong.
    """

    def __init__(
        self,
        make: Callable[[Determined], Equations],
        given: Determined,
        written: tuple[Units, PointSystem],
    ) -> None:
        """Takes a network.

        Args:
            make: A network with its initial values -> its equations.
            given: The network, where its iterations start.
            written: Units of values, and the system of coordinates, in which they were written.
        """
        self._make, self._equations = make, KeptEquations(make)
        self.solved: tuple[Equations, LeastSquaresResult] | None = None
        self._written = written
        self._evidence: tuple[Place, Evidence] | None = None
        points = doubted(given.points, given.book)
        self._is_as_given, self.as_given = points is given.points, given
        self.given = replace(given, points=points)
        self.notes = Notes(self.given.points, self.given.book)

    @cached_property
    def catalogue(self) -> Catalogue:
        """What may be wrong."""
        equations = self.solved[0] if self.solved and self._is_as_given else self._equations(self.given)
        return Catalogue(self.notes, equations)

    @property
    def hypotheses(self) -> Hypotheses:
        """The same, as the engine sees it."""
        return self.catalogue.hypotheses

    @cached_property
    def _solution(self) -> Place | None:
        """Where the adjustment as given ended."""
        if self.solved is None or not self.solved[1].converged:
            return None
        equations, result = self.solved
        rotations = equations.instruments.rotations(result)
        place = Place(result.values(equations.points), rotations, result.state)
        return place if self._is_as_given else self.adjusted(place, ())[0]

    def solution(self) -> Place | None:
        """Where the adjustment as given ended; None where it did not converge."""
        return self._solution

    def robust(self, without: Sequence[Change] = ()) -> Place:
        """Where iterations with redescending losses lead from the initial values."""
        return self._robustly(without) if without else self._robust

    @cached_property
    def _robust(self) -> Place:
        return self._robustly(())

    def soon(self) -> Place:
        """Where the first iterations of that lead: far from there only what is wrong contradicts still."""
        return self._robustly((), _AT_FIRST)

    def like(self, given: Determined) -> NetworkModel:
        """The model of a network like this one, such as that without a mistake: it shares the equations."""
        other = NetworkModel(self._make, given, self._written)
        other._equations = self._equations
        return other

    def _robustly(self, without: Sequence[Change], stages: Sequence[Stage] = _STAGES) -> Place:
        equations = self._equations(self._corrected(without))
        system, batches = equations.system, _batches(equations)

        def before(iteration: int) -> None:
            if iteration % _FOLLOW == 0:
                equations.follow(system, iteration)
            else:
                equations.linearise()

        try:
            for loss, count, near in stages:
                for batch in batches:
                    batch.loss = loss
                analysis = system.analysis(reduced=True)
                analysis.iterate(
                    GaussNewton(), Options(count, near), analysis.redundancy, before, lambda _: None
                )
        except ObseqError:
            pass  # what has been found so far is what there is
        finally:
            for batch in batches:
                batch.loss = None
        return place_of(equations)

    def linearised(self, place: Place, applied: Sequence[Change]) -> tuple[Linear, Columns]:
        """All equations as they are given, at a place; heights that are applied, in the geometry."""
        if not applied and place is self._solution and self._is_as_given and self.solved is not None:
            equations, result = self.solved
            book = self.given.book
        else:
            heights = self._corrected([one for one in applied if self._is_height(one)])
            equations, book = self._at(heights, place), heights.book
            equations.follow(equations.system, 0)
            result = _solved(equations, max_iterations=0, covariance=True)
        is_few = self.catalogue.is_small and not self.given.book.clusters
        linear = linearised(
            equations.system, result, _batches(equations), dense=is_few and _is_plain(equations)
        )
        notes = self.notes if book is self.given.book else Notes(self.given.points, book)
        effects = Effects.of(notes, equations, place.coordinates)
        return linear, self.catalogue.columns(linear, equations, effects)

    def adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool, int]:
        """Where least squares without some errors lead from a place."""
        equations = self._at(self._corrected(changes, place), place)
        result = _solved(
            equations,
            max_iterations=_ITERATIONS,
            tolerance=_TOLERANCE,
            before_iteration=equations.follow,
            covariance=False,
        )
        return place_of(equations), result.converged, len(result.iterations)

    def slips(self, change: Change, place: Place) -> tuple[Slip, ...]:
        """The slips that may be behind an error."""
        if self._evidence is None or self._evidence[0] is not place:
            self._evidence = place, self._evidence_at(place)
        from obseq.survey.causes.slips import slips_of

        return slips_of(self.catalogue.named(change.index), change, self._evidence[1])

    def _evidence_at(self, place: Place) -> Evidence:
        """What observations should have been at a place."""
        from obseq.survey.causes.slips import Evidence

        equations = self._at(self.given, place)
        equations.follow(equations.system, 0)
        residuals, _ = equations.fitted(equations.system)
        effects = Effects.of(self.notes, equations, place.coordinates)
        return Evidence(effects, self.given.book.observations.values + residuals, *self._written)

    @property
    def units(self) -> Units:
        """In which values were written."""
        return self._written[0]

    @property
    def point_system(self) -> PointSystem:
        """Of the coordinates of points."""
        return self._written[1]

    def contradictions(self, place: Place) -> tuple[float, BoolArray, BoolArray]:
        """What contradicts a place, counted softly; which observations and known coordinates do."""
        equations = self._at(self.given, place)
        equations.follow(equations.system, 0)
        residuals, sigmas = equations.fitted(equations.system)
        known = [
            whitening_of(batch) @ equations.system.residuals(batch).ravel()
            for batch in equations.known.places()
        ]
        own, off = (
            np.abs(one) / POLICY.suspect
            for one in (np.nan_to_num(residuals) / sigmas, np.concatenate([np.zeros(0), *known]))
        )
        squares = np.square(np.minimum(np.append(own, off), _ENDLESS))
        return float(np.sum(squares / (1.0 + squares))), own > 1.0, off > 1.0

    def is_contradicted(self) -> bool:
        """Whether the robust place contradicts most observations: then no right ones hold it anywhere."""
        return bool(self.contradictions(self.robust())[1].mean() > POLICY.half)

    def _at(self, given: Determined, place: Place) -> Equations:
        """The equations of a network, its unknowns at a place."""
        initial = replace(given.initial, coordinates=place.coordinates, rotations=place.rotations)
        equations = self._equations(replace(given, initial=initial))
        equations.system.unknowns.restore(place.state)
        return equations

    def _is_height(self, change: Change) -> bool:
        return self.hypotheses.code(change.index) in (INSTRUMENT_HEIGHT.code, TARGET_HEIGHT.code)

    def _corrected(self, changes: Sequence[Change], place: Place | None = None) -> Determined:
        """The network without errors: rows out, constants and heights put right, known coordinates freed.

        Args:
            changes: The errors.
            place: Where the unknowns are, for errors of which the effect depends on that.
        """
        if not changes:
            return self.given
        points, observations = self.given.points, self.given.book.observations
        sigmas, values = points.sigmas.copy(), observations.values.copy()
        weights = observations.sigmas.copy()
        instruments, targets = observations.from_heights.copy(), observations.to_heights.copy()
        for change in changes:
            named = self.catalogue.named(change.index)
            if named.code in (KNOWN, KNOWN_PLAN):
                for point, component in named.known:
                    sigmas[point, component] *= NO_WEIGHT
            elif named.code == INSTRUMENT_HEIGHT.code:
                instruments[named.rows] -= change.size[0]
            elif named.code == TARGET_HEIGHT.code:
                targets[named.rows] -= change.size[0]
            elif len(change.size) == len(named.rows) and (named.cause is None or named.cause.effect is None):
                weights[named.rows] *= NO_WEIGHT
                if self.given.book.clusters:  # those have weights of their own
                    values[named.rows] -= change.size
            elif named.of_known is not None:
                points = self._with_known(points, named.of_known, change.size)
            else:
                assert named.cause is not None and named.cause.effect is not None and place is not None
                effect = named.cause.effect(self._effects(place))[named.rows]
                values[named.rows] += effect.reshape(len(named.rows), -1) @ change.size
        changed = replace(
            observations, values=values, sigmas=weights, from_heights=instruments, to_heights=targets
        )
        book = replace(self.given.book, observations=changed)
        return replace(self.given, book=book, points=replace(points, sigmas=sigmas))

    def _effects(self, place: Place) -> Effects:
        """The sights of the network as it is given, at a place."""
        return Effects.of(self.notes, self._equations(self.given), place.coordinates)

    def _with_known(self, points: Points, cause: KnownCause, sizes: FloatArray) -> Points:
        """The points, a mistake that their known coordinates share being taken off."""
        (chosen,) = (chosen for other, chosen in self.catalogue.of_known if other is cause)
        rows, components = self.catalogue.known[chosen].T
        known = self._equations(self.given).known
        off, coordinates = self.catalogue.too_large(cause, chosen, known) @ sizes, points.coordinates.copy()
        for row in set(rows[np.isfinite(coordinates[rows]).all(axis=1)].tolist()):
            given, _, metres = self.point_system.coordinates_and_axes(coordinates[[row]])
            own = rows == row
            given[0, components[own]] -= off[own] / metres[0, components[own]]
            coordinates[row] = self.point_system.placed(given, [points.names[row]])[0]
        return replace(points, coordinates=coordinates)


def started(model: NetworkModel) -> Determined:
    """A network where a robust estimate leads from its initial values; what is held stays where it is."""
    place, given = model.robust(), model.as_given
    coordinates = np.where(given.points.is_held, given.initial.coordinates, place.coordinates)
    return replace(given, initial=replace(given.initial, coordinates=coordinates, rotations=place.rotations))


def doubted(points: Points, book: FieldBook) -> Points:
    """Points whose held coordinates have a small sigma: an error in them is seen like any other."""
    held = points.is_held
    if not held.any() or points.in_datum.any():
        return points
    observations = book.observations
    named = np.zeros(len(points), np.bool_)
    level = np.isin(observations.types, codes_where(lambda kind: kind.is_levelled))
    for ends in (observations.from_points, observations.to_points):
        found = ends[observations.active & ~level]
        named[found[found < len(points)]] = True
    wanted = held & np.column_stack([named, named, np.ones(len(points), np.bool_)])
    wanted &= points.has_coordinates[:, None]
    lengths = observations.sigmas[observations.active & ~IS_ANGLE[observations.types]]
    sigma = _HELD * (float(lengths.min()) if lengths.size else 1e-3)
    return replace(points, sigmas=np.where(wanted, sigma, points.sigmas))


def _batches(equations: Equations) -> list[Batch]:
    """All batches: those of observations, then those of known coordinates."""
    return [*(batch for _, batch in equations.batches.values()), *equations.known.places()]


def _is_plain(equations: Equations) -> bool:
    """Whether none of its observations are correlated."""
    return not any(batch.is_correlated or batch.clusters is not None for batch in _batches(equations))


def _solved(equations: Equations, **options: Any) -> LeastSquaresResult:
    """The solution; of a network that rows out have left free to move, the one that moves points least."""
    system = equations.system
    try:
        return system.solve(**options)
    except SingularSystemError:
        if system.datum.scalars.size:
            raise
        system.set_datum(equations.points)
        try:
            return system.solve(**options)
        finally:
            system.set_datum([])
