"""From points and observations to an adjustment: first values, gross errors, what nothing determines."""

from __future__ import annotations

import logging
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NoReturn

from obseq.boundary import Boundary
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError, SingularSystemError
from obseq.records.shown_units import METRIC, ShownUnits
from obseq.survey.adjustment.checks import check_counts, check_datum, check_sights
from obseq.survey.adjustment.computation import equations_of, replaced_coordinates
from obseq.survey.adjustment.datum import DatumKind, freed, held, is_free_standing, without_azimuths
from obseq.survey.adjustment.first_places import with_barycentres, with_first_places
from obseq.survey.adjustment.loose_scale import check_scales
from obseq.survey.adjustment.plumb import Plumb
from obseq.survey.adjustment.point_system import PointSystem
from obseq.survey.adjustment.singular_words import free_motions_in_words
from obseq.survey.initial.initial_values import InitialValues, collector_at_rest, values_by
from obseq.survey.initial.kept_graphs import Graphs
from obseq.survey.initial.left_out import Determined, leave_out
from obseq.survey.initial.rivals import Choice
from obseq.survey.model import join

if TYPE_CHECKING:
    from obseq import crs
    from obseq.stopwatch import Progress
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.computation import Computation
    from obseq.survey.adjustment.datum import Datum
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.adjustment.frame import Frame
    from obseq.survey.model import FieldBook, Points
    from obseq.survey.screening.findings import GrossError
    from obseq.survey.screening.robust import Model
    from obseq.survey.screening.search import Search

_SMALL = 5000
"""Observations up to which what a search leaves behind takes little memory until its end."""
_SEARCH = "the search for gross errors"
_LOG = logging.getLogger(__name__)


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

    @cached_property
    def _graphs(self) -> Graphs:
        """What the networks of trials, which differ in little, have in common."""
        return Graphs()

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
            more = with_barycentres(points, book, found.coordinates)
            if more is None:
                return found
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

    def model(self) -> Model:
        """How initial values and equations are made, where gross errors are looked for."""
        from obseq.report.units import Units
        from obseq.survey.screening.robust import Model

        return Model(self._started, self._equations, Units(self.shown or METRIC, self.written or METRIC))

    def search(self, progress: Progress | None = None) -> Search:
        """What contradicts the rest grossly, with likely causes; progress is told to one."""
        from obseq.survey.screening.search import search

        model = replace(self.model(), progress=progress)
        is_small = len(self.book.observations) <= _SMALL
        with collector_at_rest() if is_small else nullcontext():
            return search(model, self.point_system, self.points, self.book)

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
        from obseq.survey.screening.names import mistyped_names

        boundary, found = Boundary(), (adjustment.points, adjustment.left_out)
        told, notes = boundary.attempt(
            "the search for mistyped names",
            lambda: mistyped_names(self.model(), self.points, self.book, *found),
            ((), ()),
        )
        named = replace(adjustment, warnings=(*told, *adjustment.warnings), notes=(*adjustment.notes, *notes))
        return named.failing(boundary.failures)

    def _blame_names(self, error: ObseqError) -> NoReturn:
        """Raises an error of the adjustment again, with names that may be the reason."""
        from obseq.survey.screening.names import advice

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
        place = points.coordinates if before is None else before.points.coordinates
        book, told = without_azimuths(self.book)
        free, book = join(freed(points, place, datum), book)
        adjustment = replace(self, points=free, book=book)._adjusted_as_given(computation, strict=strict)
        if before is None:
            return replace(adjustment, warnings=(*told, *adjustment.warnings))
        return replace(
            adjustment,
            warnings=(*told, *before.warnings),
            left_out=before.left_out,
            replaced=before.replaced,
            gross_errors=before.gross_errors,
        )

    def _adjusted_as_given(
        self, computation: Computation, *, strict: bool, start: InitialValues | None = None
    ) -> Adjustment:
        """Adjusts with the known coordinates, or the datum, that the points have."""
        from obseq.survey.screening.mirrored import mirror_warning
        from obseq.survey.screening.odd_sigmas import odd_sigmas
        from obseq.survey.screening.search import blame, refuse

        with computation.watch.phase("initial values"):
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
            given = leave_out(given, given.initial.unplaced)
        with computation.watch.phase("equations"):
            equations = self._equations(given)
        check_scales(given, equations, self._equations, computation.whole)
        announced = self._announced(given, equations, computation, boundary, strict=strict)
        if announced is not None and announced.errors and announced.places is not None:
            given = announced.places.places_in(given)
            equations = self._equations(given)
            computation = replace(computation, wrong=announced.wrong)
        try:
            adjustment = computation.determined(given, equations, strict=strict)
        except ObseqError as error:
            search = partial(self._looked_for, announced, given, computation)
            blame(error, boundary.attempt(_SEARCH, search, ()))
        explain = partial(self._explained, announced, given, equations, computation, adjustment)
        errors, told = boundary.attempt(_SEARCH, explain, (announced.errors if announced else (), ()))
        if strict and errors:
            refuse(errors)
        odd = boundary.attempt("the test of sigmas", lambda: odd_sigmas(adjustment, self.model().units), ())
        adjustment = replace(adjustment, notes=(*adjustment.notes, *odd))
        told_of = adjustment.announcing(errors, replaced).warned(*mirrored, *told)
        return told_of.failing(boundary.failures)

    def _explained(
        self,
        announced: Search | None,
        given: Determined,
        equations: Equations,
        computation: Computation,
        adjustment: Adjustment,
    ) -> tuple[tuple[GrossError, ...], tuple[str, ...]]:
        """The gross errors of an adjustment, and a sentence that lists several."""
        from obseq.survey.screening.common_factor import common_factor
        from obseq.survey.screening.shared_offsets import shared_offset_cause

        errors = announced.errors if announced else ()
        if not errors:
            errors = () if adjustment.is_honest else self._looked_for(announced, given, computation)
            errors = errors or common_factor(self.model(), computation, given, equations, adjustment)
        errors = shared_offset_cause(self.model(), given, equations, adjustment, errors) or errors
        return self._told_best(errors, computation, given, equations, adjustment)

    def _told_best(
        self,
        errors: tuple[GrossError, ...],
        computation: Computation,
        given: Determined,
        equations: Equations,
        adjustment: Adjustment,
    ) -> tuple[tuple[GrossError, ...], tuple[str, ...]]:
        """The gross errors, and a sentence that lists several; none where the adjustment tells them better.

        Components of vectors are looked for one by one; it tests the vectors, and heights of antennas.
        """
        from obseq.survey.adjustment.sequence import one_after_the_other
        from obseq.survey.screening.antennas import antenna_cause, concern_vectors, is_one_vector
        from obseq.survey.screening.contradictions import contradiction, vectors_of
        from obseq.survey.screening.known_heights import heights_cause

        units = self.model().units
        found = contradiction(equations, adjustment) if vectors_of(adjustment) else None
        if found and (heights := heights_cause(found, units)):
            return heights, ()
        if errors and not concern_vectors(errors, adjustment):
            return errors, ()
        if found and (antenna := antenna_cause(found, units)):
            return antenna, ()
        if any(error.points for error in errors):
            return errors, ()
        told = one_after_the_other(computation, given, adjustment)
        return () if told or is_one_vector(adjustment) else errors, told

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

    def _errors_among_determined(
        self, start: Determined, computation: Computation, equations: Equations | None = None
    ) -> Search:
        """The gross errors without what nothing determines, which therefore contradicts nothing."""
        kept = computation.whole(start, equations).book.observations.active
        lost = start.book.observations.active & ~kept
        work = replace(self, book=self.book.without(lost)) if lost.any() else self
        return work.search(computation.watch.progress)

    def _looked_for(
        self, announced: Search | None, start: Determined, computation: Computation
    ) -> tuple[GrossError, ...]:
        """The gross errors, looked for unless that was done, be it in vain, for the announcement."""
        found = self._errors_among_determined(start, computation) if announced is None else announced
        return found.errors

    def _announced(
        self,
        start: Determined,
        equations: Equations,
        computation: Computation,
        boundary: Boundary,
        *,
        strict: bool,
    ) -> Search | None:
        """The gross errors, looked for where some observation does not fit the initial values; else None."""
        from obseq.survey.screening.search import is_doubtful, refuse

        check_sights(start.book, start.initial)
        Plumb(self.frame, start.points).check(start.book, start.initial.orientations)
        with computation.watch.phase("gross errors"):
            search = partial(self._errors_among_determined, start, computation, equations)
            doubtful = boundary.attempt(_SEARCH, lambda: is_doubtful(start, equations), False)
            found = boundary.attempt(_SEARCH, search, None) if doubtful else None
        errors = found.errors if found else ()
        for error in errors:
            _LOG.info("%s", error.sentence())
        if strict and errors:
            refuse(errors)
        return found

    def _equations(self, start: Determined) -> Equations:
        return equations_of(self.frame, self.point_system, start)
