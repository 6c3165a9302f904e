"""The record of a bundle adjustment: what is computed once, written as JSON, and printed.

Format "obseq-bundle", version 3 (1 had no `residuals`, 2 no `unpaired`, `notes`, `reliability`,
`rigid_blocks`, `clinometers` and `backward`). Coordinates are in the unit of the world; radians, pixels. A
number that is not defined is None, and null in the file.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.images.output.instruments import (
    ClinometerRecord,
    RigidRecord,
    clinometer_records,
    rigid_records,
)
from obseq.images.output.testing import ReliabilityRecord, reliability_record
from obseq.plain import to_plain
from obseq.record import IterationRecord, RunRecord, new_run
from obseq.record_quality import GlobalTestRecord
from obseq.survey.adjustment.adjusted_records import global_test_record

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.adjustment.start import LeftOut

FORMAT = "obseq-bundle"
VERSION = 3
WORST = 20
"""Image points with the largest residuals that the record lists by name."""


@dataclass(frozen=True, slots=True)
class ParameterRecord:
    """A camera parameter: value, and standard deviation (0: frozen; None: not asked for)."""

    name: str
    value: float
    sigma: float | None


@dataclass(frozen=True, slots=True)
class CameraRecord:
    """A calibration; `correlations` are the rows of the matrix, in the order of the parameters.

    `backward` is True where the distortion corrects the measured points.
    """

    name: str
    width: int
    height: int
    projection: str
    degree: tuple[int, ...]
    backward: bool
    parameters: tuple[ParameterRecord, ...]
    correlations: tuple[tuple[float, ...], ...] | None
    n_measures: int
    rms: float


@dataclass(frozen=True, slots=True)
class ImageRecord:
    """A pose and how its measures fit.

    Attributes:
        centre: projection centre.
        centre_sigmas: None when no precision was asked for.
        quaternion: w, x, y, z of the rotation from camera to world.
        opk: photogrammetric omega, phi, kappa.
        opk_sigmas: None when no precision was asked for, or where an angle has none.
    """

    name: str
    camera: str
    centre: tuple[float, ...]
    centre_sigmas: tuple[float, ...] | None
    quaternion: tuple[float, ...]
    opk: tuple[float, ...]
    opk_sigmas: tuple[float | None, ...] | None
    n_measures: int
    rms: float
    largest: float
    mean_dx: float
    mean_dy: float


@dataclass(frozen=True, slots=True)
class BlockPointRecord:
    """A point: kind is `control` or `tie`; `residual` is adjusted minus given, of control points.

    Attributes:
        covariance: xx, xy, xz, yy, yz, zz; None when no precision was asked for.
    """

    name: str
    kind: str
    x: float
    y: float
    z: float
    covariance: tuple[float, ...] | None
    n_rays: int
    rms: float
    residual: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class ImagePointRecord:
    """An image point, its residual (computed minus measured, pixels), and what robust weights left of it."""

    image: str
    point: str
    x: float
    y: float
    dx: float
    dy: float
    weight: float


@dataclass(frozen=True, slots=True)
class ResidualColumns:
    """All image points that were adjusted, by columns.

    Attributes:
        image: number of the image, a position in the images of the record.
        point: number of the point, a position in its points.
        x: column measured, pixels; `y` the line.
        dx: computed minus measured, pixels; `dy` the same.
        sx: sigma, pixels; `sy` the same.
        weight: what robust weights left, 1 for all.
    """

    image: tuple[int, ...]
    point: tuple[int, ...]
    x: tuple[float, ...]
    y: tuple[float, ...]
    dx: tuple[float, ...]
    dy: tuple[float, ...]
    sx: tuple[float, ...]
    sy: tuple[float, ...]
    weight: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class BlockLeftOutRecord:
    """Something that took no part."""

    kind: str
    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class BundleRecord:
    """A whole bundle adjustment.

    Attributes:
        precision: "a posteriori": scaled by sigma0; "a priori": not; "none": not computed.
        squares: weighted sums of squares by kind of observation.
        stopped: why the iterations ended.
        unpaired: exposures of rigid blocks that lack an image; what there is of them took part.
        notes: what a file held and nothing here uses.
        behind: image points whose point is behind the camera in the end.
        worst: the largest residuals, in sigmas.
        residuals: of all image points.
        reliability: None when no precision was asked for, or without redundancy.
        global_test: of sigma0; None without redundancy, and where robust weights make it meaningless.
    """

    n_observations: int
    n_unknowns: int
    redundancy: int
    sigma0: float | None
    converged: bool
    stopped: str
    precision: str
    iterations: tuple[IterationRecord, ...]
    squares: dict[str, float]
    cameras: tuple[CameraRecord, ...]
    images: tuple[ImageRecord, ...]
    points: tuple[BlockPointRecord, ...]
    left_out: tuple[BlockLeftOutRecord, ...]
    unpaired: tuple[BlockLeftOutRecord, ...]
    notes: tuple[str, ...]
    behind: tuple[ImagePointRecord, ...]
    weakened: int
    worst: tuple[ImagePointRecord, ...]
    residuals: ResidualColumns
    reliability: ReliabilityRecord | None
    rigid_blocks: tuple[RigidRecord, ...]
    clinometers: tuple[ClinometerRecord, ...]
    run: RunRecord
    global_test: GlobalTestRecord | None = None
    format: str = FORMAT
    version: int = VERSION

    @property
    def is_complete(self) -> bool:
        """Converged, with nothing left out and no point behind a camera."""
        return self.converged and not self.left_out and not self.behind

    def to_json(self) -> str:
        """The result file."""
        return json.dumps(to_plain(self), indent=1, allow_nan=False) + "\n"


def record_of(solution: BundleSolution, precisions: bool = True) -> BundleRecord:
    """The record of a solution; without precisions when its covariances were not asked for."""
    result = solution.result
    order = np.argsort(-_normalised(solution))[:WORST]
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
        tuple(_points(solution, precisions)),
        _left_out(solution.left_out),
        _left_out(solution.unpaired),
        tuple(solution.block.notes),
        tuple(_image_points(solution, np.flatnonzero(solution.is_behind))),
        int(np.count_nonzero(solution.residuals.weights < 0.5)),
        tuple(_image_points(solution, order)),
        _residuals(solution),
        reliability_record(solution) if precisions and result.redundancy else None,
        tuple(rigid_records(solution, precisions)),
        tuple(clinometer_records(solution)),
        new_run(),
        _global_test(solution),
    )


def _global_test(solution: BundleSolution) -> GlobalTestRecord | None:
    """The test of sigma0, where no robust weight takes its distribution away."""
    weights = solution.residuals.weights
    is_robust = bool((np.abs(weights[np.isfinite(weights)] - 1.0) > 1e-12).any())
    return None if is_robust else global_test_record(solution.result)


def _left_out(items: Iterable[LeftOut]) -> tuple[BlockLeftOutRecord, ...]:
    return tuple(BlockLeftOutRecord(item.kind, item.name, item.reason) for item in items)


def _precision(solution: BundleSolution) -> str:
    return "a posteriori" if solution.is_a_posteriori else "a priori"


def _normalised(solution: BundleSolution) -> FloatArray:
    found = solution.residuals
    return np.asarray(np.linalg.norm(found.residuals / found.sigmas, axis=1))


def _cameras(solution: BundleSolution, precisions: bool) -> Iterator[CameraRecord]:
    fits = solution.by_camera()
    for row, (name, camera) in enumerate(solution.cameras.items()):
        sigmas: dict[str, Any] = solution.camera_precisions(name) if precisions else {}
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
        )


def _images(solution: BundleSolution, precisions: bool) -> Iterator[ImageRecord]:
    poses, fits = solution.poses, solution.by_image()
    quaternions, angles = poses.attitudes("quaternion"), poses.attitudes("opk")
    n = len(poses)
    centres: list[Any] = [None] * n
    turns: list[Any] = [None] * n
    if precisions:
        centres = np.sqrt(np.diagonal(solution.centre_covariances, axis1=1, axis2=2)).tolist()
        turns = [_finite(row) for row in solution.attitude_precisions("opk")]
    for k in range(n):
        yield ImageRecord(
            poses.images[k],
            poses.cameras[k],
            tuple(poses.centres[k].tolist()),
            centres[k] and tuple(centres[k]),
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


def _points(solution: BundleSolution, precisions: bool) -> Iterator[BlockPointRecord]:
    fits, control = solution.by_point(), solution.start.is_control
    shifts = solution.coordinates - solution.start.coordinates
    upper = np.triu_indices(3)
    covariances: list[Any] = [None] * len(solution.points)
    if precisions:
        covariances = solution.point_covariances[:, upper[0], upper[1]].tolist()
    for k, name in enumerate(solution.points):
        x, y, z = solution.coordinates[k].tolist()
        yield BlockPointRecord(
            name,
            "control" if control[k] else "tie",
            x,
            y,
            z,
            covariances[k] and tuple(covariances[k]),
            int(fits.counts[k]),
            float(fits.rms[k]),
            tuple(shifts[k].tolist()) if control[k] else None,
        )


def _residuals(solution: BundleSolution) -> ResidualColumns:
    found = solution.residuals
    columns = np.hstack([found.xy, found.residuals, found.sigmas, found.weights[:, None]])
    numbers = (tuple(column) for column in columns.T.tolist())
    return ResidualColumns(tuple(found.image.tolist()), tuple(found.point.tolist()), *numbers)


def _image_points(solution: BundleSolution, rows: IntArray) -> Iterator[ImagePointRecord]:
    found = solution.residuals
    for row in rows:
        (x, y), (dx, dy) = found.xy[row].tolist(), found.residuals[row].tolist()
        yield ImagePointRecord(
            solution.poses.images[found.image[row]],
            solution.points[found.point[row]],
            x,
            y,
            dx,
            dy,
            float(found.weights[row]),
        )
