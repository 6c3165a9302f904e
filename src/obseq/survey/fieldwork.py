"""From points and observations to an adjustment: first values, gross errors, what nothing determines."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from obseq import crs
from obseq.boundary import Boundary
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.diagnosis.judgement import noise
from obseq.diagnosis.policy import POLICY
from obseq.errors import InputError, ObseqError, SingularSystemError
from obseq.records.diagnosis import DiagnosisRecord
from obseq.records.shown_units import METRIC, ShownUnits
from obseq.survey.adjustment.computation import equations_of, replaced_coordinates
from obseq.survey.adjustment.datum import DatumKind, freed, held, is_free_standing, without_azimuths
from obseq.survey.adjustment.first_places import on_axes, with_first_places, with_later_places
from obseq.survey.adjustment.singular import (
    check_counts,
    check_datum,
    check_scales,
    check_sights,
    free_motions_in_words,
)
from obseq.survey.diagnosing.diagnosis import record_of
from obseq.survey.diagnosing.network_model import NetworkModel, started
from obseq.survey.diagnosing.snooping import Snooped, snooped, snooping_record
from obseq.survey.equations.plumb import Plumb
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.initial_values import InitialValues, values_by
from obseq.survey.initial.left_out import Determined, in_plan, leave_out
from obseq.survey.initial.rivals import Choice
from obseq.survey.model import join
from obseq.survey.sights.graph_building import Graphs

if TYPE_CHECKING:
    from obseq.diagnosis.policy import Policy
    from obseq.leastsquares import Blocks
    from obseq.report.tables.units import Units
    from obseq.stopwatch import Progress
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.computation import Computation, Computed
    from obseq.survey.adjustment.datum import Datum
    from obseq.survey.equations.equations import Equations
    from obseq.survey.equations.frame import Frame
    from obseq.survey.model import FieldBook, Points

_DIAGNOSIS = "the diagnosis"
_MOST_NAMED = 5
"""Errors that a refusal lists."""


@dataclass(frozen=True, eq=False)
class Fieldwork:
    """Points and observations in one frame.

    Attributes:
        points: All points; coordinates in the frame.
        book: The observations, numbered like the points.
        frame: The computation frame.
        points_crs: The coordinate system of the point files.
        shown: Units in which values are told; None for metres and gon.
        written: Units in which they were written; None for metres and gon.
    """

    points: Points
    book: FieldBook
    frame: Frame
    points_crs: crs.CoordinateSystem
    shown: ShownUnits | None = None
    written: ShownUnits | None = None

    @cached_property
    def point_system(self) -> PointSystem:
        """The coordinates of points in the system of their files."""
        return PointSystem(self.frame.system, self.points_crs)

    @property
    def has_heights(self) -> bool:
        """Whether heights are apart from plans, in the frame and in the system of the points."""
        return self.frame.has_vertical and self.points_crs.kind is not crs.Kind.GEOCENTRIC

    @cached_property
    def _graphs(self) -> Graphs:
        """What the networks of trials, which differ in little, have in common."""
        return Graphs(self.frame.bend)

    def initial_values(self) -> InitialValues:
        """Initial values as far as they go."""
        return self._own_values

    @cached_property
    def _own_values(self) -> InitialValues:
        """Those of these points and observations: an adjustment and a search for gross errors begin there."""
        choice, first = self._choice, self._first_values
        return self._computed(self.points, self.book, choice) if first.rivals else first

    @cached_property
    def _first_values(self) -> InitialValues:
        """The same, where points that have several places start at the first of them."""
        return self._computed(self.points, self.book, Choice())

    def _started(self, points: Points, book: FieldBook) -> InitialValues:
        """Initial values of points and observations in the frame."""
        is_own = points is self.points and book is self.book
        return self._own_values if is_own else self._computed(points, book, self._choice)

    def _computed(self, points: Points, book: FieldBook, choice: Choice) -> InitialValues:
        """The same, computed from where points start that have several places."""
        points = with_first_places(self.frame, points, book)
        while True:
            found = values_by(self._graphs, points, book, self.frame.plumb, choice=choice)
            more = with_later_places(points, book, found.coordinates)
            if more is None:
                return replace(found, coordinates=on_axes(points, book, found.coordinates))
            points = more

    @cached_property
    def _choice(self) -> Choice:
        """Where points start that have several places, as least squares decides."""
        found = self._first_values
        if not found.rivals:
            return Choice()
        from obseq.survey.adjustment.contest import decided

        compute = partial(self._computed, self.points, self.book)
        return decided(self.points, self.book, found, compute, self._equations)

    @property
    def units(self) -> Units:
        """Units in which values are told, and were written."""
        from obseq.report.tables.units import Units

        return Units(self.shown or METRIC, self.written or METRIC)

    def adjusted(
        self, datum: Datum, computation: Computation, *, strict: bool, start: InitialValues | None
    ) -> Adjustment:
        """The adjustment on a datum.

        Args:
            datum: What it rests on.
            computation: How it is computed.
            strict: Refuse what would have to be left out, and gross errors.
            start: Where the iterations start; initial values of its own when None. Not for inner constraints.

        Raises:
            InputError: Something in the input makes the adjustment impossible.
            SingularSystemError: The observations do not determine some unknowns, which the message names.
        """
        if datum.kind is DatumKind.INNER:
            return self._adjusted_freely(datum, computation, strict=strict)
        given = self if datum.kind is DatumKind.GIVEN else replace(self, points=held(self.points))
        try:
            return given._with_names(given._adjusted_as_given(computation, strict=strict, start=start))
        except ObseqError as error:
            self._blame_names(error)

    def _with_names(self, adjustment: Adjustment) -> Adjustment:
        """The adjustment with what its names make one think of."""
        from obseq.survey.causes.names import mistyped_names

        boundary, found = Boundary(), (adjustment.points, adjustment.left_out)
        told, notes = boundary.attempt(
            "the search for mistyped names",
            lambda: mistyped_names(self.units, self.points, self.book, *found),
            ((), ()),
        )
        named = replace(adjustment, warnings=(*told, *adjustment.warnings), notes=(*adjustment.notes, *notes))
        return named.failing(boundary.failures)

    def _blame_names(self, error: ObseqError) -> NoReturn:
        """Raises an error of the adjustment again, with names that may be the reason."""
        from obseq.survey.causes.names import advice

        told = advice(self.points, self.book)
        if told:
            raise InputError(f"{error}\n{told}") from error
        raise error

    def _adjusted_freely(self, datum: Datum, computation: Computation, *, strict: bool) -> Adjustment:
        """Adjusts by inner constraints, from where known coordinates, if there are any, put the points."""
        points, before = self.points, None
        if not is_free_standing(points):
            before = self._adjusted_as_given(computation.plain(), strict=strict)
            points = before.points.points
        place = points.coordinates if before is None else before.points.places
        book, told = without_azimuths(self.book)
        free, book = join(freed(points, place, datum), book)
        released = replace(self, points=free, book=book)
        start = None if before is None else released._oriented(before)
        adjustment = released._adjusted_as_given(computation, strict=strict, start=start)
        if before is None:
            return replace(adjustment, warnings=(*told, *adjustment.warnings))
        told_before = {item.what for item in before.left_out}
        more = tuple(item for item in adjustment.left_out if item.what not in told_before)
        return replace(
            adjustment,
            warnings=(*told, *(item.sentence for item in more), *before.warnings),
            left_out=(*before.left_out, *more),
            replaced=before.replaced,
            diagnosis=before.diagnosis if before.gross_errors else adjustment.diagnosis,
        )

    def _oriented(self, before: Adjustment) -> InitialValues:
        """Initial values, with instruments as an adjustment left them."""
        initial, turned = self.initial_values(), before.stations.rotations
        origins, placed = self.book.stations.origins.astype(np.int64), np.isfinite(initial.coordinates)
        known = np.isfinite(turned).all(axis=(1, 2)) & placed[origins].all(axis=1)
        if not known.any():
            return initial
        coordinates = np.where(placed, initial.coordinates, initial.coordinates[origins[known][0]])
        rotations, verticals = (
            initial.rotations.copy(),
            Plumb(self.frame, self.points).axes(origins, coordinates),
        )
        rotations[known] = (turned @ verticals).transpose(0, 2, 1)[known]
        return replace(initial, rotations=rotations)

    def _adjusted_as_given(
        self, computation: Computation, *, strict: bool, start: InitialValues | None = None
    ) -> Adjustment:
        """Adjusts with the known coordinates, or the datum, that the points have."""
        from obseq.survey.diagnosing.mirrored import mirror_warning
        from obseq.survey.diagnosing.odd_sigmas import odd_sigmas

        with computation.watch.phase("initial values"), computation.watch.counted("initial values"):
            self._check_datum()
            given = Determined(self.points, self.book, start or self.initial_values())
            if strict:
                given.initial.require_complete()
                check_counts(self.points, self.book)
            replaced = replaced_coordinates(self.points, self.point_system, given.initial)
            initial, boundary = given.initial, Boundary()
            mirrored = boundary.attempt(
                "the test of the sense of axes", lambda: mirror_warning(self.points, initial), ()
            )
            given = self._placed(given)
        with computation.watch.phase("equations"):
            equations = equations_of(self.frame, self.point_system, given, computation.blocks)
        check_scales(given, equations, self._equations, computation.whole)
        check_sights(given.book, given.initial)
        Plumb(self.frame, given.points).check(given.book, given.initial.orientations)
        is_snooped = computation.quality.snooping is not None
        first = computation.plain() if is_snooped else computation
        model = self._model(given, computation.blocks)
        found = self._computed_somehow(model, equations, first, boundary, strict=strict)
        with computation.watch.phase("diagnosis"):
            if found.start is not given:
                model = self._model(found.start, computation.blocks)
            model.solved = found.solved(first.quality)
            out = self._judged(model, computation, boundary)
        diagnosis = out.diagnosis
        if strict and diagnosis.accused:
            raise InputError(listed_errors(diagnosis))
        adjustment = self._without(found, model, out, computation) if is_snooped else found.adjustment
        odd = boundary.attempt("the test of sigmas", lambda: odd_sigmas(adjustment, self.units), ())
        adjustment = replace(adjustment, notes=(*adjustment.notes, *odd), diagnosis=diagnosis)
        return adjustment.announcing(replaced).warned(*mirrored).failing(boundary.failures)

    def _placed(self, given: Determined) -> Determined:
        """The network without what initial values have not placed, not even in plan."""
        kept = in_plan(given) if self.has_heights else given
        return leave_out(kept, kept.initial.unplaced)

    def _computed_somehow(
        self,
        model: NetworkModel,
        equations: Equations,
        computation: Computation,
        boundary: Boundary,
        *,
        strict: bool,
    ) -> Computed:
        """The adjustment from the initial values; where that fails, from where a robust estimate leads.

        What has not arrived after a dozen iterations goes on, or is begun there, only if the robust place
        does not contradict most of what is given.
        """
        failed: ObseqError | None = None
        found: Computed | None = None
        first = replace(computation, max_iterations=min(computation.max_iterations, _DOZEN))
        try:
            found = first.computed(model.as_given, equations, strict=strict)
        except ObseqError as error:
            failed = error
        if found is not None and _is_sound(found):
            return found
        with computation.watch.phase("diagnosis"):
            if found is not None and boundary.attempt(_DIAGNOSIS, model.is_contradicted, False):
                return found
        if found is not None and _is_sound(found := found.continued(computation, strict=strict)):
            return found
        with computation.watch.phase("diagnosis"):
            start = boundary.attempt(_DIAGNOSIS, lambda: started(model), None)
        if start is not None:
            try:
                again = computation.computed(start, strict=strict)
            except ObseqError:
                pass
            else:
                if found is None or _is_sound(again):
                    return again
        if found is not None:
            return found
        assert failed is not None
        told = boundary.attempt(_DIAGNOSIS, lambda: self._recorded(model), None)
        if told is not None and told.accused:
            reason = f"the adjustment fails, which may follow from them: {failed}"
            raise InputError(f"{listed_errors(told)}\n{reason}") from failed
        raise failed

    def _recorded(
        self, model: NetworkModel, policy: Policy = POLICY, told: Progress | None = None
    ) -> DiagnosisRecord:
        """What is wrong with a network, judged by a policy."""

        def begun(points: Points, book: FieldBook) -> Determined:
            return self._placed(Determined(points, book, self._computed(points, book, Choice())))

        return record_of(model, self.units, begun, policy, told)

    def _model(self, given: Determined, blocks: Blocks | None) -> NetworkModel:
        """A network as its diagnosis sees it."""
        make = partial(equations_of, self.frame, self.point_system, blocks=blocks)
        return NetworkModel(make, given, (self.units, self.point_system))

    def _judged(self, model: NetworkModel, computation: Computation, boundary: Boundary) -> Snooped:
        """What is wrong with an adjustment, undecided where that fails; what snooping leaves out of it."""
        wanted = computation.quality
        failed = DiagnosisRecord("undecided", 0.0, 0, (), "the search failed or was interrupted")

        def found() -> Snooped:
            search = partial(self._recorded, model, told=computation.watch.progress)
            if wanted.snooping is None:
                return Snooped(search(), POLICY)
            return snooped(search, wanted, lambda: noise(model))

        return boundary.attempt(_DIAGNOSIS, found, Snooped(failed, POLICY), ends=True)

    def _without(
        self, found: Computed, model: NetworkModel, out: Snooped, computation: Computation
    ) -> Adjustment:
        """The adjustment without what snooping leaves out, if that leaves everything determined."""
        rows, start, is_needed = out.rows(len(found.start.book.observations)), found.start, False
        try:
            near = started(model) if out.gone else start
            after = computation.computed(replace(near, book=near.book.without(rows)), strict=bool(out.gone))
        except SingularSystemError:
            out, rows, is_needed = replace(out, gone=()), np.zeros_like(rows), True
            after = computation.computed(start, strict=False)
        told = snooping_record(
            out, computation.quality, start.book, found.adjustment, after.adjustment, is_needed=is_needed
        )
        quality = replace(after.adjustment.quality, rejected=rows, snooping=told)
        return replace(after.adjustment, quality=quality)

    def _check_datum(self) -> None:
        """Raises InputError when nothing says where any point is, with the rank deficiency if it shows."""
        try:
            check_datum(self.points, self.book)
        except InputError as error:
            start = Determined(self.points, self.book, self.initial_values())
            if start.initial.unplaced:
                raise
            try:
                self._equations(start).system.solve(max_iterations=1)
            except SingularSystemError as free:
                whole = "" if "shape" in str(free) else "; or adjust without known points (--datum inner)"
                moves = free_motions_in_words(free)
                raise InputError(f"{error}{whole}. By the observations, {moves}") from error
            raise

    def _equations(self, start: Determined) -> Equations:
        return equations_of(self.frame, self.point_system, start)


_DOZEN = 12
"""Iterations within which an adjustment without gross errors arrives."""


def _is_sound(found: Computed) -> bool:
    """Whether an adjustment has arrived where all is determined."""
    return found.adjustment.converged and found.adjustment.solution.weak is None


def listed_errors(found: DiagnosisRecord) -> str:
    """The errors of a diagnosis, in some lines."""
    listed = [f"  {one.what}: {one.text}" for one in found.accused[:_MOST_NAMED]]
    more = len(found.accused) - len(listed)
    listed += [f"  and {more} more"] if more > 0 else []
    return "gross errors are suspected, the worst first:\n" + "\n".join(listed)
