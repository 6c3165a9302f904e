"""The computation of an adjustment: iterations, what they leave undetermined, the results with precisions."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import ObseqError, SingularSystemError
from obseq.records.adjustment import ReplacedRecord, new_run
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.adjustment.adjusted_quality import adjusted_quality
from obseq.survey.adjustment.adjusted_records import AdjustedPoints, AdjustedStations, operations
from obseq.survey.adjustment.doubtful import doubtful_points
from obseq.survey.adjustment.inner import inner_covariances
from obseq.survey.adjustment.notes import datum_note, held_heights_note, notes, of_unit_weight
from obseq.survey.adjustment.quality import Examination, Quality, examine
from obseq.survey.adjustment.singular import free_motions, in_words, points_of, singular_parts
from obseq.survey.equations.loose_motions import UNDETERMINED, loose_error, size_of
from obseq.survey.equations.point_system import PointSystem
from obseq.survey.initial.approximations import nearest_sights
from obseq.survey.initial.left_out import Determined, leave_out

if TYPE_CHECKING:
    from obseq import crs
    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares import Blocks, LeastSquaresResult
    from obseq.records.adjustment import DoubtfulRecord
    from obseq.stopwatch import Stopwatch
    from obseq.survey.equations.equations import Equations
    from obseq.survey.equations.frame import Frame
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.model import Points


def equations_of(
    frame: Frame, system: PointSystem, start: Determined, blocks: Blocks | None = None
) -> Equations:
    """The equations of what is determined, in a frame; solved in blocks, or at once when None."""
    from obseq.leastsquares import LeastSquares
    from obseq.survey.equations.equations import Equations

    solved = LeastSquares(blocks or "auto")
    return Equations(frame, system, start.points, start.book, start.initial, solved)


def replaced_coordinates(
    points: Points, system: PointSystem, initial: InitialValues
) -> tuple[ReplacedRecord, ...]:
    """The approximate coordinates of files that are not used, in the system of the points."""
    rows = [row for row in initial.replaced if points.has_coordinates[row]]
    if not rows:
        return ()
    names = [points.names[row] for row in rows]
    both = points.coordinates[rows], initial.coordinates[rows]
    moved = np.linalg.norm(both[1] - both[0], axis=1).tolist()
    given, used = (map(tuple, system.coordinates(xyz, names).tolist()) for xyz in both)
    places = [points.place(row) for row in rows]
    return tuple(ReplacedRecord(*parts) for parts in zip(names, places, given, used, moved, strict=True))


@dataclass(frozen=True, eq=False)
class Computed:
    """An adjustment, the network that was adjusted, and its equations, which stand at the solution."""

    adjustment: Adjustment
    start: Determined
    equations: Equations

    def solved(self, quality: Quality) -> tuple[Equations, LeastSquaresResult] | None:
        """The equations and their solution, if that is the one of the given sigmas."""
        return None if quality.variance_components else (self.equations, self.adjustment.solution)

    def continued(self, computation: Computation, *, strict: bool) -> Computed:
        """The same after the iterations that are left, where it has not converged and they lead somewhere."""
        before = self.adjustment.solution
        more = computation.max_iterations - len(before.iterations)
        if before.converged or more <= 0:
            return self
        try:
            computation = replace(computation, max_iterations=more)
            after = computation.computed(self.start, self.equations, strict=strict)
        except ObseqError:
            return self
        solution = after.adjustment.solution
        solution = replace(solution, iterations=(*before.iterations, *solution.iterations))
        return replace(after, adjustment=replace(after.adjustment, solution=solution))


@dataclass(frozen=True)
class Computation:
    """How networks are adjusted.

    Attributes:
        frame: The computation frame.
        points_crs: The coordinate system of the results.
        unit_sigma: By what another program multiplies sigma0 where it reports it; None for no such program.
        max_iterations: The iterations end at this number.
        tolerance: Convergence: no unknown moves any more by this share of its standard deviation.
        watch: Times the phases, and tells of progress.
        quality: What is wanted beside residuals and precisions.
        strategy: How the iterations move.
        blocks: How it is solved in blocks; None for at once.
    """

    frame: Frame
    points_crs: crs.CoordinateSystem
    unit_sigma: float | None
    max_iterations: int
    tolerance: float
    watch: Stopwatch
    quality: Quality
    strategy: str = "controlled"
    blocks: Blocks | None = None

    def plain(self) -> Computation:
        """The same with nothing beside residuals and precisions."""
        quality = replace(
            self.quality, reliability=False, relative=False, variance_components=False, snooping=None
        )
        return replace(self, quality=quality)

    def solved(self, start: Determined) -> LeastSquaresResult:
        """The solution of a network, without precisions.

        Raises:
            ObseqError: there is none.
        """
        equations = self._equations(start)
        solution = equations.system.solve(**self._solving(equations))
        if solution.weak is not None:
            raise solution.weak
        return solution

    @cached_property
    def point_system(self) -> PointSystem:
        """The coordinates of points in the system of the results."""
        return PointSystem(self.frame.system, self.points_crs)

    def determined(
        self, start: Determined, equations: Equations | None = None, *, strict: bool
    ) -> Adjustment:
        """Adjusts, without what turns out to be undetermined.

        Args:
            start: The network.
            equations: Its equations at its initial values, where they have been made.
            strict: Refuse what would have to be left out.

        Raises:
            SingularSystemError: the observations do not determine some unknowns, and `strict`; or they did
                where the iterations started.
        """
        return self.computed(start, equations, strict=strict).adjustment

    def computed(self, start: Determined, equations: Equations | None = None, *, strict: bool) -> Computed:
        """The same, with the network that was left, and its equations."""
        while True:
            equations = equations or self._equations(start)
            try:
                return Computed(self._adjusted(start, equations, strict=strict), start, equations)
            except SingularSystemError as found:
                error = _with_loose_motions(equations, found)
                undetermined = singular_parts(start, error)
                if strict or self._was_determined(start, error):
                    raise in_words(error) from error
                start, equations = leave_out(start, undetermined), None

    def whole(self, start: Determined, equations: Equations | None = None) -> Determined:
        """A network without what its observations leave undetermined where the iterations start.

        Args:
            start: The network.
            equations: Its equations at its initial values, where they have been made; they stay there.

        Raises:
            SingularSystemError: that is all of it.
        """
        while True:
            equations = equations or self._equations(start)
            system, first = equations.system, equations.system.unknowns.state()
            try:
                system.solve(max_iterations=1)
            except SingularSystemError as error:
                system.unknowns.restore(first)
                undetermined = singular_parts(start, _with_loose_motions(equations, error))
                start, equations = leave_out(start, undetermined), None
            else:
                return start
            finally:
                system.unknowns.restore(first)

    def _equations(self, start: Determined) -> Equations:
        with self.watch.phase("equations"):
            return equations_of(self.frame, self.point_system, start, self.blocks)

    def _was_determined(self, start: Determined, error: ObseqError) -> bool:
        """Whether what an error names was determined where the iterations started: they have gone astray."""
        if not isinstance(error, SingularSystemError):
            return True
        equations, lost = self._equations(start), points_of(error)
        if loose_error(equations.system, equations.points) is not None:
            return False
        try:
            solution = equations.system.solve(max_iterations=0, covariance=True)
        except SingularSystemError:
            return False
        rows = np.array([row for row, name in enumerate(start.points.names) if name in lost], np.intp)
        covariances = covariances_of(solution, equations.points[rows], a_priori=True)
        precisions = np.sqrt(np.trace(covariances, axis1=1, axis2=2))
        return bool((precisions < nearest_sights(start.book, start.initial.coordinates, rows)).all())

    def _adjusted(self, start: Determined, equations: Equations, *, strict: bool) -> Adjustment:
        """Adjusts what is determined."""
        with self.watch.phase("iterations and covariances"):
            found = examine(equations, start.book, self.quality, self._solving(equations))
        weak = _weak(start, equations, found.solution)
        if weak is not None:
            if strict or not self._was_determined(start, weak):
                raise weak
            found = Examination(found.wanted, replace(found.solution, weak=weak))
        with self.watch.phase("results"):
            adjustment = self.described(start, equations, found)
            adjustment = adjustment.doubting(_doubtful(start, adjustment)).failing(
                (*found.failures, *_withheld(weak))
            )
        if self.quality.inner:
            with self.watch.phase("inner constraints"):
                adjustment = self._with_inner(adjustment, start, equations)
        return replace(
            adjustment,
            left_out=start.left_out,
            warnings=(*(item.sentence for item in start.left_out), *adjustment.warnings),
        )

    def _with_inner(self, adjustment: Adjustment, start: Determined, equations: Equations) -> Adjustment:
        """The adjustment with precisions of inner constraints; with a warning where there are none."""
        in_frame = PointSystem(self.frame.system, self.frame.system)
        try:
            found = inner_covariances(
                partial(equations_of, self.frame, in_frame, blocks=self.blocks), start, equations
            )
        except SingularSystemError as error:
            return replace(adjustment, warnings=(*adjustment.warnings, str(error)))
        return adjustment.with_inner(found)

    def _solving(self, equations: Equations) -> dict[str, Any]:
        """Arguments of `LeastSquares.solve`."""
        return {
            "max_iterations": self.max_iterations,
            "tolerance": self.tolerance,
            "before_iteration": equations.follow,
            "sigma0_groups": [batch.group for _, batch in equations.batches.values()],
            "progress": lambda step: self.watch.progress(str(step)),
            "strategy": self.strategy,
        }

    def described(self, start: Determined, equations: Equations, found: Examination) -> Adjustment:
        """What a solution of the equations says of a network, which may be part of a larger system."""
        book, solution, quality = start.book, found.solution, adjusted_quality(equations, start.book, found)
        coordinates = solution.values(equations.points)
        residuals, sigmas = equations.fitted(solution)
        rows, *beside = equations.unused(solution)
        residuals[rows], sigmas[rows] = beside
        covariances = covariances_of(solution, equations.points, found.a_priori)
        undetermined = free_motions(equations, start.points.names)
        return Adjustment(
            solution=solution,
            points=self.placed(start.points, coordinates, covariances),
            stations=_stations(start, equations.instrument_rotations(solution)),
            book=book,
            residuals=residuals,
            sigmas=sigmas,
            frame=self.frame.system.definition,
            points_crs=self.points_crs.definition,
            points_crs_units=(self.points_crs.plan_unit, self.points_crs.height_unit),
            precision="a priori" if found.a_priori else "a posteriori",
            known=equations.known.residuals(solution),
            warnings=book.warnings,
            notes=(
                *of_unit_weight(self.unit_sigma, solution.sigma0),
                *datum_note(equations.system.datum_defect, undetermined, len(start.points)),
                *held_heights_note(equations, self.point_system, start.points),
                *notes(self.frame, book, coordinates, start.points.is_invented),
                *equations.shared.sentences(solution, found.a_priori),
            ),
            phases={},
            run=new_run(),
            quality=quality,
            refraction=self.frame.refraction_coefficient,
            operations=operations((self.frame.system, self.points_crs)),
            undetermined=undetermined,
        )

    def placed(self, points: Points, coordinates: FloatArray, covariances: FloatArray) -> AdjustedPoints:
        """Points at coordinates (n, 3) in the frame, with their covariances, in their system too."""
        given, axes, _ = self.point_system.coordinates_and_axes(coordinates, points.names)
        turned = axes @ covariances @ axes.transpose(0, 2, 1)
        precisions = np.sqrt(np.maximum(np.diagonal(turned, axis1=1, axis2=2), 0.0))
        given, precisions = (np.where(points.is_invented, np.nan, part) for part in (given, precisions))
        return AdjustedPoints(points, coordinates, covariances, given, precisions)


def _doubtful(start: Determined, adjustment: Adjustment) -> tuple[DoubtfulRecord, ...]:
    rows = np.flatnonzero(start.points.is_free.any(axis=1))
    factor = adjustment.solution.variance_factor if adjustment.precision == "a posteriori" else None
    sigmas = adjustment.points.precisions[rows] / math.sqrt(factor or 1.0)
    coordinates = start.initial.coordinates
    return tuple(doubtful_points(start.book, start.points.names, coordinates, rows, sigmas))


def _weak(start: Determined, equations: Equations, solution: LeastSquaresResult) -> ObseqError | None:
    """What is hardly determined at a solution, and precisions would say so of: its error."""
    if solution.weak is not None:
        return solution.weak
    loose = _loose_motions(start, equations, solution)
    return loose if loose is not None or solution.converged else _lost_points(start, equations, solution)


def _loose_motions(
    start: Determined, equations: Equations, solution: LeastSquaresResult
) -> SingularSystemError | None:
    """The error of a singular system where only the curvature of the Earth says where points are."""
    if start.points.in_datum.any() or not solution.n_unknowns:
        return None
    covariances = covariances_of(solution, equations.points, a_priori=True)
    precisions = np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    if precisions.max() > UNDETERMINED * size_of(solution.values(equations.points)):
        return loose_error(equations.system, equations.points)
    return None


def _with_loose_motions(equations: Equations, error: SingularSystemError) -> SingularSystemError:
    """The error of a singular system, or that of all motions that are as good as free."""
    loose = None if error.kernel is None else loose_error(equations.system, equations.points)
    return error if loose is None or (loose.defect or 0) <= (error.defect or 0) else loose


def _lost_points(
    start: Determined, equations: Equations, solution: LeastSquaresResult
) -> SingularSystemError | None:
    """The error of a singular system for points less precise than their sights are long."""
    rows = np.flatnonzero(start.points.is_free.any(axis=1))
    covariances = covariances_of(solution, equations.points[rows], a_priori=True)
    precisions = np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    lost = rows[precisions > nearest_sights(start.book, solution.values(equations.points), rows)]
    if not lost.size:
        return None
    names = [start.points.names[row] for row in lost]
    return SingularSystemError(
        f"the observations leave {', '.join(names)} undetermined: the iterations find no end",
        tuple(f"{name}.{axis}" for name in names for axis in "xyz"),
    )


def _withheld(weak: ObseqError | None) -> tuple[str, ...]:
    """Why a solution has no precisions."""
    if weak is None:
        return ()
    told = in_words(weak) if isinstance(weak, SingularSystemError) else weak
    return (f"precisions are withheld, the coordinates are those of the last iteration: {told}",)


def _stations(start: Determined, rotations: FloatArray) -> AdjustedStations:
    return AdjustedStations(
        origins=tuple(start.points.names[origin] for origin in start.book.stations.origins),
        orientations=start.initial.orientations,
        g0=np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0]),
        rotations=rotations,
    )


def covariances_of(solution: LeastSquaresResult, ids: IntArray, a_priori: bool) -> FloatArray:
    """(n, 3, 3) covariances of points; 0 where all of them are held, NaN where they are withheld."""
    if not solution.n_unknowns or solution.weak is not None:
        return np.full((len(ids), 3, 3), 0.0 if solution.weak is None else np.nan)
    return solution.covariance(ids, a_priori)
