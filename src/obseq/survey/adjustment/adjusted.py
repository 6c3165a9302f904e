"""The adjusted network: points, stations, observations, and the record that is written to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from obseq.arrays import FloatArray
from obseq.boundary import Boundary
from obseq.crs import Unit, parse
from obseq.dataclass import dataclass
from obseq.leastsquares import LeastSquaresResult
from obseq.leastsquares.statistics.ellipses import ErrorEllipses, confidence_factor, ellipses_of
from obseq.records.adjustment import (
    AdjustmentRecord,
    DoubtfulRecord,
    IterationRecord,
    LeftOutRecord,
    MotionRecord,
    ObservationRecord,
    OperationRecord,
    PhaseRecord,
    PointRecord,
    ReplacedRecord,
    RunRecord,
)
from obseq.records.columns import NO_CODE, Column, Texts
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord
from obseq.records.rows import Rows
from obseq.records.shown_units import METRIC, ShownUnits
from obseq.survey.adjustment.adjusted_quality import AdjustedQuality, ellipse_columns
from obseq.survey.adjustment.adjusted_records import (
    AdjustedPoints,
    AdjustedStations,
    Fit,
    by_setup,
    by_type,
    constraint_records,
    ellipsoid_columns,
    finite,
    global_test_record,
    reliability_columns,
    unused_azimuths,
)
from obseq.survey.adjustment.asked import Asked
from obseq.survey.adjustment.joint_groups import joint_records
from obseq.survey.equations.frame import area_warning
from obseq.survey.equations.known_coordinates import CoordinateResiduals
from obseq.survey.initial.approximations import sentences_of
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook


@dataclass(frozen=True, eq=False)
class Adjustment(Asked):
    """An adjusted network; residuals, coordinates and sigma0 all belong to the same, final, solution.

    Attributes:
        solution: The result of the least squares.
        points: The adjusted points.
        stations: The adjusted stations.
        book: The observations.
        residuals: (n,) computed minus observed, m or rad; those of inactive observations too, NaN where
            the solution says nothing of them.
        sigmas: (n,) m or rad, what they were adjusted with: relative parts included.
        frame: Definition of the computation frame.
        points_crs: Definition of the system of the points.
        points_crs_units: Units of its plan and of its heights.
        precision: "a posteriori" when precisions are scaled by the variance factor, "a priori" when there
            is no redundancy to estimate it.
        known: How the known coordinates fit.
        warnings: What the user should know of the input, one sentence each.
        notes: What was computed and how far it holds, one sentence each.
        phases: Seconds of each phase of the work.
        run: Which run made it.
        quality: Reliability, snooping, variance components, relative precisions: what was asked for.
        refraction: Coefficient of refraction of zenith angles.
        operations: How PROJ leads from the systems to the Earth.
        inner: (n, 3, 3) covariances with the datum of inner constraints, NaN for points without observation;
            None when not asked for, or where the observations alone do not determine the shape (a warning).
        left_out: The points and stations that nothing determined, left out with their observations.
        replaced: The approximate coordinates that observations contradict, and that were not used.
        diagnosis: What is wrong with it; None where nobody has looked.
        undetermined: The motions that the datum of a free network takes away.
        doubtful: The points of which the observations say next to nothing.
        shown: Units of the reports, where the files have others than metres and gon.
        failures: What should explain the result, and failed; among the warnings too.
    """

    solution: LeastSquaresResult
    points: AdjustedPoints
    stations: AdjustedStations
    book: FieldBook
    residuals: FloatArray
    sigmas: FloatArray
    frame: str
    points_crs: str
    points_crs_units: tuple[Unit, Unit]
    precision: str
    known: CoordinateResiduals
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    phases: Mapping[str, float]
    run: RunRecord
    quality: AdjustedQuality
    refraction: float | None = None
    operations: tuple[OperationRecord, ...] = ()
    inner: FloatArray | None = None
    left_out: tuple[LeftOutRecord, ...] = ()
    replaced: tuple[ReplacedRecord, ...] = ()
    diagnosis: DiagnosisRecord | None = None
    undetermined: tuple[MotionRecord, ...] = ()
    doubtful: tuple[DoubtfulRecord, ...] = ()
    shown: ShownUnits | None = None
    failures: tuple[str, ...] = ()

    @property
    def sigma0(self) -> float | None:
        """Unit-weight estimate of the final solution, survey observations only (MMVII's definition)."""
        return self.solution.sigma0

    @property
    def converged(self) -> bool:
        """Whether the iterations ended by themselves."""
        return self.solution.converged

    def announcing(self, replaced: tuple[ReplacedRecord, ...]) -> Adjustment:
        """The adjustment with the approximate coordinates that it did not use."""
        return replace(self, replaced=replaced, warnings=(*sentences_of(replaced), *self.warnings))

    @property
    def gross_errors(self) -> tuple[AccusedRecord, ...]:
        """The errors that were found, the clearest first."""
        return () if self.diagnosis is None else self.diagnosis.accused

    def doubting(self, doubtful: tuple[DoubtfulRecord, ...]) -> Adjustment:
        """The adjustment with points that should not be used, named in warnings."""
        warnings = (*self.warnings, *(item.sentence for item in doubtful))
        return replace(self, doubtful=doubtful, warnings=warnings)

    def warned(self, *sentences: str) -> Adjustment:
        """The adjustment with more warnings, before the others."""
        return replace(self, warnings=(*sentences, *self.warnings))

    def failing(self, failures: Sequence[str]) -> Adjustment:
        """The adjustment with what failed after it, told first."""
        return replace(self.warned(*failures), failures=(*self.failures, *failures)) if failures else self

    def with_inner(self, covariances: FloatArray) -> Adjustment:
        """The adjustment with covariances (n, 3, 3) of inner constraints, a priori; scaled as its own are."""
        factor = 1.0 if self.precision == "a priori" else self.solution.variance_factor or 1.0
        return replace(self, inner=factor * covariances)

    @property
    def is_complete(self) -> bool:
        """Whether it converged, with all that was given, nothing wrong and no point doubtful."""
        return self.is_whole and (self.diagnosis is None or self.diagnosis.is_quiet)

    @property
    def is_whole(self) -> bool:
        """The same, but for a large sigma0 of which nothing is accused: precisions are scaled by it."""
        is_clean = (self.diagnosis is None or self.diagnosis.is_silent) and not self.doubtful
        is_all = not self.left_out and not self.book.unused and not self.quality.rejected.any()
        return self.converged and is_all and is_clean and not self.failures

    @property
    def normalised_residuals(self) -> FloatArray:
        """(n,) residual over sigma, of inactive observations too."""
        return np.asarray(self.residuals / self.sigmas)

    def record(self, title: str | None = None) -> AdjustmentRecord:
        """What the result file holds and the reports print, under a title of the user's."""
        solution, numbers = self.solution, self.quality.observations
        standardised, shares = (None if numbers is None else numbers.standardised), self.quality.shares
        redundancy = None if numbers is None else numbers.redundancy
        fit = Fit(self.book, self.normalised_residuals, standardised, redundancy, shares)
        boundary = Boundary()
        return AdjustmentRecord(
            n_observations=solution.n_observations,
            n_constraints=solution.n_constraints,
            n_unknowns=solution.n_unknowns,
            redundancy=solution.redundancy,
            iterations=tuple(IterationRecord(step.sigma0, step.max_step) for step in solution.iterations),
            sigma0=solution.sigma0,
            variance_factor=solution.variance_factor,
            global_test=global_test_record(solution),
            reliability=self.quality.reliability,
            snooping=self.quality.snooping,
            variance_components=self.quality.components,
            ellipse_level=self.quality.ellipses,
            relative=self.quality.relative,
            converged=solution.converged,
            stop_reason=solution.ending,
            precision=self.precision,
            frame=self.frame,
            points_crs=self.points_crs,
            units=self.shown or METRIC,
            points_crs_unit=self.points_crs_units[0].name,
            points_crs_height_unit=self.points_crs_units[1].name,
            points_crs_is_angular=self.points_crs_units[0].is_angle,
            points=self._points(),
            stations=self.stations.records(),
            observations=self._observations(),
            constraints=constraint_records(self.points.points, self.known, self.quality.known),
            warnings=(*boundary.failures, *self.warnings),
            notes=self.notes,
            left_out=self.left_out,
            replaced=self.replaced,
            diagnosis=self.diagnosis,
            phases=tuple(PhaseRecord(name, seconds) for name, seconds in self.phases.items()),
            run=self.run,
            title=title,
            files=tuple(dict.fromkeys((*self.book.files, *self.points.points.files))),
            refraction=self.refraction,
            operations=self.operations,
            types=by_type(fit),
            setups=by_setup(fit),
            undetermined=self.undetermined or None,
            doubtful=self.doubtful,
            unused=self.book.unused,
            failures=(*self.failures, *boundary.failures),
            outside=self._outside() if self.gross_errors else "",
            joint=joint_records(
                self.quality.joint, self.quality.reliability, self.book, self.points.points, self.known
            ),
        )

    def _outside(self) -> str:
        """What to say of points outside the area of their system."""
        points = replace(self.points.points, coordinates=self.points.crs_coordinates)
        return area_warning(parse(self.points_crs), points) or ""

    def _points(self) -> Rows[PointRecord]:
        points, n = self.points, len(self.points.names)
        columns = points.columns({item.name for item in self.replaced})
        columns |= ellipse_columns(
            self._ellipses(), points.has_plan & ~points.points.is_held[:, :2].all(axis=1)
        )
        if self.quality.ellipsoids and self.solution.weak is None:
            redundancy = None if self.quality.a_priori else self.solution.redundancy
            columns |= ellipsoid_columns(
                points.covariances, confidence_factor(self.quality.ellipses, 3, redundancy)
            )
        if self.inner is not None:
            variances = np.diagonal(self.inner, axis1=1, axis2=2)
            columns["inner"] = np.sqrt(np.maximum(variances, 0.0))
            columns["inner.there"] = np.isfinite(self.inner[:, 0, 0])
        return Rows.of(PointRecord, columns, n)

    def _ellipses(self) -> ErrorEllipses:
        points = self.points
        redundancy = None if self.quality.a_priori else self.solution.redundancy
        return ellipses_of(points.names, points.covariances, self.quality.ellipses, redundancy)

    def to_dict(self) -> dict[str, Any]:
        """The plain form of the record: the content of the result file (docs/result-file.md)."""
        return self.record().to_dict()

    def __repr__(self) -> str:
        from obseq.report.notebook import adjustment_text

        return adjustment_text(self.record())

    def _repr_html_(self) -> str:
        from obseq.report.notebook import adjustment_html

        return adjustment_html(self.record())

    def _observations(self) -> Rows[ObservationRecord]:
        book, rows, quality = self.book, self.book.observations, self.quality
        names = list(book.point_names)
        codes, kinds = np.unique(rows.types, return_inverse=True)
        known = [BY_CODE[code] for code in codes.tolist()]
        columns: dict[str, Column] = {
            "type": Texts(kinds.astype(np.int32), [kind.name for kind in known]),
            "unit": Texts(kinds.astype(np.int32), [kind.unit for kind in known]),
            "from": Texts(rows.from_points, names),
            "to": Texts(rows.to_points, names),
            "value": rows.values,
            "sigma": self.sigmas,
            "residual": finite(self.residuals),
            "normalised_residual": finite(self.normalised_residuals),
            "file": Texts(rows.file_indices, list(book.files)),
            "line": rows.lines,
            "active": rows.active,
            "rejected": np.where(quality.rejected, 1, -1).astype(np.int8),
            "backsight": Texts(np.maximum(rows.backsights, NO_CODE), names),
            "adjusted": finite(rows.values + self.residuals),
            "azimuth": unused_azimuths(book, self.stations.g0),
            **reliability_columns(quality.observations),
            **(quality.effects or {}),
        }
        return Rows.of(ObservationRecord, columns, len(rows))
