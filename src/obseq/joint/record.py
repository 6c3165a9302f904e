"""The record of an open adjustment: what result files hold and reports print, of points and observations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from msgspec import structs

from obseq import crs
from obseq.joint.named import Column, NamedEquation
from obseq.joint.solution import Solved
from obseq.leastsquares import Batch, LeastSquaresResult, Reliability
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.statistics.ellipses import ellipses_of
from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
from obseq.records.adjustment import (
    AdjustmentRecord,
    ConstraintRecord,
    IterationRecord,
    ObservationRecord,
    PointRecord,
    StationRecord,
    StatisticsRecord,
    defined,
    new_run,
)
from obseq.records.diagnosis import DiagnosisRecord, KnownRecord, PlaceRecord, SuspectRecord
from obseq.records.rows import Rows
from obseq.stopwatch import Stopwatch
from obseq.survey.adjustment.adjusted_quality import (
    NAMES,
    ReliabilityNumbers,
    ellipse_columns,
    levels_of,
)
from obseq.survey.adjustment.adjusted_records import (
    RELIABILITY,
    finite_number,
    global_test_record,
    tested_types,
)
from obseq.survey.adjustment.computation import Computation
from obseq.survey.adjustment.quality import Quality
from obseq.survey.equations.frame import Frame

Tested = Sequence[ObservationReliability[Batch | Prior]]

IMAGES = "image points are observations too: the record of the block lists them (`block()`)"
NOT_LISTED = "observations of {} are listed by no value in m or rad: their types alone are told"


class Listed(NamedTuple):
    """Observations of formulas, as a record lists them, and what it cannot list."""

    rows: list[ObservationRecord]
    names: list[str]
    not_listed: list[str]


def record_of(solution: Solved, title: str | None = None) -> AdjustmentRecord:
    """The record of all surveys, points and equations of an open adjustment, under a title of the user's."""
    result, tests = solution.result, solution.reliability if solution.result.has_covariances else None
    surveys = [part.adjusted(result, tests) for part in solution.surveys]
    records = [survey.record() for survey in surveys]
    listed = _observations(solution, tests)
    own = Rows(ObservationRecord, listed.rows)
    observations = Rows.joined(ObservationRecord, [*(record.observations for record in records), own])
    places = {
        part.network.book.label(row): first + row
        for part, first in zip(solution.surveys, _firsts(records), strict=True)
        for row in range(len(part.network.book.observations))
    }
    first = sum(len(record.observations) for record in records)
    places |= {name: first + k for k, name in enumerate(listed.names)}
    notes = [note for record in records for note in record.notes]
    if solution.images_part is not None:
        notes.append(IMAGES)
    if listed.not_listed:
        notes.append(NOT_LISTED.format(", ".join(listed.not_listed)))
    types = [*(row for record in records for row in record.types or ()), *_types(solution, tests)]
    head = records[0] if records else None
    return structs.replace(
        head or _empty(result),
        points=_points(solution, [record.points for record in records]),
        stations=Rows.joined(StationRecord, [record.stations for record in records]),
        observations=observations,
        constraints=Rows.joined(
            ConstraintRecord,
            [
                *(record.constraints for record in records),
                Rows(ConstraintRecord, _known(solution, tests)),
            ],
        ),
        setups=tuple(row for record in records for row in record.setups or ()),
        types=tested_types(types),
        sigma0=result.sigma0,
        variance_factor=result.variance_factor,
        global_test=global_test_record(result),
        reliability=None if tests is None else levels_of(tests),
        stop_reason=result.ending,
        precision="a priori" if result.variance_factor is None else "a posteriori",
        warnings=tuple(dict.fromkeys(text for record in records for text in record.warnings)),
        notes=tuple(dict.fromkeys(notes)),
        joint=tuple(row for record in records for row in record.joint) if len(records) == 1 else (),
        files=tuple(dict.fromkeys(file for record in records for file in record.files or ())),
        diagnosis=_placed(solution.diagnosis, places, observations),
        run=new_run(),
        title=title,
    )


def _empty(result: LeastSquaresResult) -> AdjustmentRecord:
    return AdjustmentRecord(
        result.n_observations,
        result.n_constraints,
        result.n_unknowns,
        result.redundancy,
        tuple(IterationRecord(step.sigma0, step.max_step) for step in result.iterations),
        result.sigma0,
        result.converged,
        "Local",
        "Local",
        Rows(PointRecord),
        Rows(StationRecord),
        Rows(ObservationRecord),
        setups=(),
        operations=(),
    )


def _firsts(records: Sequence[AdjustmentRecord]) -> list[int]:
    """Where the observations of each network begin."""
    return [sum(len(record.observations) for record in records[:k]) for k in range(len(records))]


# Points


def _points(solution: Solved, found: Sequence[Rows[PointRecord]]) -> Rows[PointRecord]:
    """Points of the surveys, then those that none of them has: of images, and one's own."""
    of_surveys = {point.name: point for points in reversed(found) for point in points}
    surveyed = Rows(PointRecord, of_surveys.values())
    rest = solution.others(of_surveys)
    if not rest.names:
        return surveyed
    computation = Computation(*_systems(solution), None, 0, 0.0, Stopwatch(), Quality())
    coordinates = solution.points(rest.names)
    covariances = np.full((len(rest.names), 3, 3), np.nan)
    if solution.result.has_covariances:
        covariances = solution.covariance(rest.names)
    redundancy = solution.result.redundancy if solution.result.variance_factor else None
    placed = computation.placed(rest, coordinates, covariances)
    ellipses = ellipses_of(rest.names, covariances, None, redundancy)
    columns = placed.columns() | ellipse_columns(ellipses, placed.has_plan)
    return Rows.joined(PointRecord, [surveyed, Rows.of(PointRecord, columns, len(rest.names))])


def _systems(solution: Solved) -> tuple[Frame, crs.CoordinateSystem]:
    """Frame, and system of the points: those of the first network, or a plane with heights."""
    if solution.surveys:
        network = solution.surveys[0].network
        return network.frame, network.points_crs
    local = crs.parse("Local")
    return Frame(local), local


def _known(solution: Solved, tests: Reliability | None) -> Iterator[ConstraintRecord]:
    """Coordinates of points that were given with sigmas, to this adjustment itself."""
    for name, prior in solution.priors:
        here = solution.points([name])[0]
        part = None if tests is None else tests.of(prior)
        value, sigmas = dict(zip("xyz", here, strict=True)), np.asarray(prior.sigmas)[:, 0]
        for k, (axis, given) in enumerate(zip("xyz", prior.values.tolist(), strict=True)):
            residual, sigma = float(value[axis] - given), float(sigmas[k])
            controlled = None if part is None else finite_number(part.redundancy[k, 0])
            w = None if part is None else finite_number(part.w[k, 0])
            yield ConstraintRecord(name, axis, given, sigma, residual, residual / sigma, "", 0, controlled, w)


# Observations


def _observations(solution: Solved, tests: Reliability | None) -> Listed:
    found = Listed([], [], [])
    for equation, batch in solution.equations:
        for column in equation.columns:
            if column.unit not in ("m", "rad"):
                if column.type not in found.not_listed:
                    found.not_listed.append(column.type)
                continue
            found.rows.extend(_rows(solution, equation, batch, column, tests))
            found.names.extend(batch.label(row) for row in range(batch.n))
    return found


def _rows(
    solution: Solved,
    equation: NamedEquation,
    batch: Batch,
    column: Column,
    tests: Reliability | None,
) -> Iterator[ObservationRecord]:
    k = column.residual
    residuals = solution.result.residuals(batch)[:, k]
    sigmas = np.broadcast_to(batch.sigmas, (batch.n, batch.shape.n_residuals))[:, k]
    plain = zip(*map(defined, (residuals, residuals / sigmas, column.values + residuals)), strict=True)
    found = [np.full(batch.n, np.nan)] * len(NAMES)
    if tests is not None:
        found = [getattr(tests.of(batch), name)[:, k] for name in NAMES]
    redundancy, w, tau, detectable, external, residual = found
    tested = ReliabilityNumbers(redundancy, w, tau, detectable, external, -residual)
    numbers = {name: defined(getattr(tested, field)) for name, field in RELIABILITY.items()}
    for row, (off, normalised, adjusted) in enumerate(plain):
        ends = equation.ends(row)
        yield ObservationRecord(
            type=column.type,
            origin=ends[0],
            target=ends[1],
            value=float(column.values[row]),
            sigma=float(sigmas[row]),
            residual=off,
            normalised_residual=normalised,
            file="",
            line=0,
            active=bool(batch.active[row]),
            unit=column.unit,
            adjusted=adjusted,
            rejected=None,
            backsight=None,
            effect=None,
            azimuth=None,
            **{name: values[row] for name, values in numbers.items()},
        )


def _types(solution: Solved, tests: Reliability | None) -> Iterator[StatisticsRecord]:
    """How the observations of each group fit that is of no survey: image points, clinometers, one's own."""
    if tests is None:
        return
    of_surveys = {id(batch) for part in solution.surveys for batch in part.batches()}
    groups: dict[str, list[ObservationReliability[Batch | Prior]]] = {}
    for part in tests.all:
        if id(part.source) not in of_surveys:
            groups.setdefault(part.source.group, []).append(part)
    for name, parts in groups.items():
        yield _statistics(name, parts, solution.result.squares[name])


def _statistics(name: str, parts: Tested, squares: float) -> StatisticsRecord:
    active = [part.active for part in parts]
    normalised, w, redundancy = (
        np.concatenate([values[own] for values, own in zip(found, active, strict=True)])
        for found in (
            [part.residuals / np.broadcast_to(part.sigmas, part.residuals.shape) for part in parts],
            [part.w for part in parts],
            [part.redundancy for part in parts],
        )
    )
    unused = sum(int(np.count_nonzero(~own.any(axis=1))) for own in active)
    freedom = float(redundancy.sum())
    return StatisticsRecord(
        name,
        len(normalised),
        unused,
        freedom,
        float(np.sqrt(np.mean(normalised**2))) if len(normalised) else None,
        float(np.mean(normalised)) if len(normalised) else None,
        float(np.nanmax(np.abs(w), initial=0.0)),
        float(np.sqrt(squares / freedom)) if freedom > 1e-6 else None,
    )


# What is wrong


def _placed(
    found: DiagnosisRecord | None, places: dict[str, int], observations: Sequence[ObservationRecord]
) -> DiagnosisRecord | None:
    """The diagnosis with the rows of this record: image points have none in it."""
    if found is None:
        return None

    def own(one: SuspectRecord) -> tuple[tuple[PlaceRecord, ...], tuple[KnownRecord, ...]]:
        row = places.get(one.what)
        if row is None:
            return (), one.points
        return (PlaceRecord(observations[row].file, observations[row].line, row),), one.points

    def placed(one: SuspectRecord) -> SuspectRecord:
        rows, points = own(one)
        return structs.replace(one, observations=rows, points=points)

    return structs.replace(
        found,
        accused=tuple(
            structs.replace(placed(one), others=tuple(map(placed, one.others))) for one in found.accused
        ),
        remarks=tuple(map(placed, found.remarks)),
    )
