"""The record of a bundle adjustment, from its solution."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.boundary import Boundary
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.adjustment.start import LeftOut
from obseq.images.camera import Camera
from obseq.images.causes.comparison import has_robust_weights
from obseq.images.output.arrays import grid_of
from obseq.images.output.block_record import (
    BlockLeftOutRecord,
    BlockPointRecord,
    BundleRecord,
    CameraRecord,
    ImageRecord,
    MeasureRecord,
    ParameterRecord,
)
from obseq.images.output.instruments import clinometer_records, rigid_records
from obseq.images.output.references import antenna_records, check_records, shutter_records
from obseq.images.output.testing import BlockReliabilityRecord, reliability_of
from obseq.records.adjustment import IterationRecord, new_run
from obseq.records.columns import Column, Texts, texts_of
from obseq.records.diagnosis import DiagnosisRecord
from obseq.records.quality import GlobalTestRecord
from obseq.records.rows import Rows
from obseq.survey.adjustment.adjusted_records import global_test_record


def record_of(
    solution: BundleSolution,
    precisions: bool = True,
    diagnosis: DiagnosisRecord | None = None,
    failures: Sequence[str] = (),
) -> BundleRecord:
    """The record of a solution.

    Args:
        solution: of the block.
        precisions: False when its covariances were not asked for.
        diagnosis: what is wrong with it (see `diagnosed`).
        failures: what should explain the solution, and failed.
    """
    result, boundary = solution.result, Boundary()
    precisions = precisions and result.weak is None
    far = solution.is_far if precisions else np.zeros(len(solution.points), dtype=bool)
    reliability: BlockReliabilityRecord | None = None
    tests: dict[str, Column] = {}
    if precisions and result.redundancy:
        reliability, tests = boundary.attempt(
            "the tests of image points", lambda: reliability_of(solution), (reliability, tests)
        )
    measures = _measures(solution, tests)
    return BundleRecord(
        result.n_observations + result.n_constraints,
        result.n_unknowns,
        result.redundancy,
        result.sigma0,
        result.converged,
        result.ending,
        _precision(solution) if precisions else "none",
        tuple(IterationRecord(step.sigma0, step.max_step) for step in solution.iterations),
        dict(result.squares),
        tuple(_cameras(solution, precisions)),
        tuple(_images(solution, precisions)),
        _points(solution, precisions),
        _left_out(solution.left_out),
        _left_out(solution.unpaired),
        tuple(solution.block.notes),
        measures.take(np.flatnonzero(solution.is_behind & ~far[solution.residuals.point])),
        int(np.count_nonzero(solution.residuals.weights < 0.5)),
        measures,
        reliability,
        tuple(rigid_records(solution, precisions)),
        tuple(clinometer_records(solution)),
        new_run(),
        _global_test(solution),
        _left_out(solution.start.unmeasured),
        diagnosis,
        solution.weak,
        (*failures, *boundary.failures),
        tuple(solution.points[row] for row in np.flatnonzero(far)),
        tuple(antenna_records(solution, precisions)),
        tuple(shutter_records(solution, precisions)),
        tuple(check_records(solution)),
        solution.check_residuals().unmeasured,
        solution.block.frame,
    )


def _global_test(solution: BundleSolution) -> GlobalTestRecord | None:
    """The test of sigma0, where no robust weight takes its distribution away."""
    return None if has_robust_weights(solution) else global_test_record(solution.result)


def _left_out(items: Iterable[LeftOut]) -> tuple[BlockLeftOutRecord, ...]:
    return tuple(BlockLeftOutRecord(item.kind, item.name, item.reason) for item in items)


def _precision(solution: BundleSolution) -> str:
    return "a posteriori" if solution.is_a_posteriori else "a priori"


def _cameras(solution: BundleSolution, precisions: bool) -> Iterator[CameraRecord]:
    fits = solution.by_camera()
    for row, (name, camera) in enumerate(solution.cameras.items()):
        sigmas: dict[str, float] = solution.camera_precisions(name) if precisions else {}
        correlations = solution.camera_correlations(name).tolist() if precisions else None
        yield CameraRecord(
            name,
            camera.width,
            camera.height,
            camera.projection,
            camera.degree,
            camera.backward,
            tuple(
                ParameterRecord(parameter, float(value), sigmas.get(parameter))
                for parameter, value in zip(camera.parameter_names, camera.parameters, strict=True)
            ),
            None if correlations is None else tuple(map(tuple, correlations)),
            int(fits.counts[row]),
            float(fits.rms[row]),
            *_undistorted(camera),
        )


def _undistorted(camera: Camera) -> tuple[tuple[float | None, ...], tuple[float | None, ...]]:
    """Columns and lines of a grid of the image without distortion."""
    given = grid_of((camera.width, camera.height), camera.focal)
    plane = camera.undistorted((given - camera.principal_point) / camera.focal)
    x, y = (camera.principal_point + camera.focal * plane).T
    return _finite(x), _finite(y)


def _images(solution: BundleSolution, precisions: bool) -> Iterator[ImageRecord]:
    poses, fits = solution.poses, solution.by_image()
    quaternions, angles = poses.attitudes("quaternion"), poses.attitudes("opk")
    n = len(poses)
    centres: list[tuple[float, ...] | None] = [None] * n
    turns: list[tuple[float | None, ...] | None] = [None] * n
    if precisions:
        variances = np.diagonal(solution.centre_covariances, axis1=1, axis2=2)
        centres = [tuple(row) for row in np.sqrt(variances).tolist()]
        turns = [_finite(row) for row in solution.attitude_precisions("opk")]
    for k in range(n):
        yield ImageRecord(
            poses.images[k],
            poses.cameras[k],
            tuple(poses.centres[k].tolist()),
            centres[k],
            tuple(quaternions[k].tolist()),
            tuple(angles[k].tolist()),
            turns[k],
            int(fits.counts[k]),
            float(fits.rms[k]),
            float(fits.largest[k]),
            float(fits.mean[k, 0]),
            float(fits.mean[k, 1]),
        )


def _finite(row: FloatArray) -> tuple[float | None, ...]:
    return tuple(float(value) if np.isfinite(value) else None for value in row)


def _points(solution: BundleSolution, precisions: bool) -> Rows[BlockPointRecord]:
    fits, start = solution.by_point(), solution.start
    control = start.is_control & ~start.is_free.all(axis=1)
    checks = set(solution.block.check_points.names)
    shifts = solution.coordinates - start.coordinates
    kinds = [
        "control" if given else "check" if name in checks else "tie"
        for given, name in zip(control, solution.points, strict=True)
    ]
    columns: dict[str, Column] = {
        "name": Texts(np.arange(len(kinds), dtype=np.int32), solution.points),
        "kind": texts_of(kinds),
        **dict(zip("xyz", solution.coordinates.T, strict=True)),
        "n_rays": fits.counts.astype(np.int64),
        "rms": fits.rms,
        "residual": np.where(control[:, None], shifts, np.nan),
        "residual.there": control,
    }
    if precisions:
        upper = np.triu_indices(3)
        covariances = solution.point_covariances[:, upper[0], upper[1]]
        columns |= {"covariance": covariances, "covariance.there": np.ones(len(kinds), np.int8)}
    return Rows.of(BlockPointRecord, columns, len(kinds))


def _measures(solution: BundleSolution, tests: dict[str, Column]) -> Rows[MeasureRecord]:
    found = solution.residuals
    pairs = {"": found.xy, "d": found.residuals, "s": found.sigmas}
    columns: dict[str, Column] = {
        "image": Texts(found.image.astype(np.int32), solution.poses.images),
        "point": Texts(found.point.astype(np.int32), solution.points),
        **{of + axis: values[:, k] for of, values in pairs.items() for k, axis in enumerate("xy")},
        "weight": found.weights,
    }
    return Rows.of(MeasureRecord, columns | tests, len(found.image))
