"""What a bundle adjustment found: poses, calibrations, points, residuals, and how well each is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.geometry import attitude_jacobian
from obseq.images.adjustment.equations import Equations, are_far
from obseq.images.adjustment.quality import BlundersFound, MeasureReliability, measure_reliability
from obseq.images.adjustment.reference_equations import ClinometerEquations, PendulumEquations
from obseq.images.adjustment.referenced import Referenced
from obseq.images.adjustment.rigid_equations import RigidEquations, RigidResiduals, residuals_of
from obseq.images.adjustment.start import LeftOut, Start
from obseq.images.adjustment.surveys import JoinedSurvey
from obseq.images.adjustment.verdicts import weakness
from obseq.images.block import Block
from obseq.images.camera import Camera
from obseq.images.names import index_of
from obseq.images.parts import Clinometer, Pendulum
from obseq.images.poses import Poses, are_in_front
from obseq.leastsquares import Iteration, LeastSquaresResult


@dataclass(frozen=True, eq=False)
class MeasureResiduals:
    """Residuals of the image points that were adjusted.

    Attributes:
        image: (n,) image, a position in the poses of the solution.
        point: (n,) point, a position in the points of the solution.
        part: (n,) set of measures.
        row: (n,) row in its set.
        xy: (n, 2) measured, pixels.
        residuals: (n, 2) computed minus measured, pixels.
        sigmas: (n, 2) given, pixels.
        weights: (n,) what robust weights left: 1 full, 0 none.
    """

    image: IntArray
    point: IntArray
    part: IntArray
    row: IntArray
    xy: FloatArray
    residuals: FloatArray
    sigmas: FloatArray
    weights: FloatArray

    @property
    def norms(self) -> FloatArray:
        """(n,) lengths of the residuals, pixels."""
        return np.asarray(np.linalg.norm(self.residuals, axis=1))


@dataclass(frozen=True, eq=False)
class Statistics:
    """Residuals of image points put together by image, camera or point, one row each.

    Attributes:
        names: what each row is about.
        counts: (n,) measures.
        rms: (n,) quadratic mean of residuals per coordinate, pixels.
        largest: (n,) longest residual, pixels.
        mean: (n, 2) mean residual, pixels.
    """

    names: tuple[str, ...]
    counts: IntArray
    rms: FloatArray
    largest: FloatArray
    mean: FloatArray


@dataclass(frozen=True, eq=False)
class BundleSolution(Referenced):
    """An adjusted block; everything belongs to the same, final, state.

    Precisions are a posteriori (scaled by sigma0^2) where there is redundancy, else a priori.

    Attributes:
        block: what was adjusted.
        start: its numbers, and where it started.
        equations: its least-squares system.
        result: the solution of the system.
        iterations: all that led to it.
        surveys: the survey networks that share its points.
        blunders: what the search for blunders left out; None when none was asked for.
        beyond: points that thresholds left too few measures.
    """

    block: Block
    start: Start
    equations: Equations
    result: LeastSquaresResult
    iterations: tuple[Iteration, ...]
    surveys: tuple[JoinedSurvey, ...] = ()
    blunders: BlundersFound | None = None
    beyond: tuple[LeftOut, ...] = ()

    # The state

    @cached_property
    def poses(self) -> Poses:
        """Adjusted poses of the images."""
        return Poses(
            self.start.poses.images,
            self.result.values(self.equations.centres),
            self.result.values(self.equations.rotations),
            self.start.poses.cameras,
        )

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """Adjusted cameras by name."""
        return {
            name: self.block.cameras[name].with_parameters(self.result.values([ids])[0])
            for name, ids in zip(self.equations.cameras, self.equations.calibrations, strict=True)
        }

    @property
    def points(self) -> tuple[str, ...]:
        """Names of the points."""
        return self.start.points

    @cached_property
    def coordinates(self) -> FloatArray:
        """(n, 3) adjusted coordinates of the points."""
        return self.result.values(self.equations.points)

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """What took no part, and why."""
        rejected = () if self.blunders is None else self.blunders.rejected
        return (*self.start.left_out, *self.beyond, *(item.as_left_out() for item in rejected))

    @property
    def unpaired(self) -> tuple[LeftOut, ...]:
        """Exposures of rigid blocks that lack an image of a pair of cameras, and images of no exposure."""
        return tuple(item for part in self.equations.rigid for item in part.pairs.missing)

    @property
    def sigma0(self) -> float | None:
        """Square root of the weighted sum of squares over the redundancy; None without redundancy."""
        return self.result.sigma0

    @property
    def converged(self) -> bool:
        """Whether the iterations ended by themselves."""
        return self.result.converged

    @property
    def weak(self) -> str:
        """Why there are no precisions, and what is hardly determined; empty where nothing is."""
        return weakness(self.equations, self.result)

    def adjusted_block(self) -> Block:
        """The block at the solution: its cameras, poses, points as approximations, and used measures."""
        block = type(self.block)()
        block.add_cameras(*self.cameras.values())
        block.add_poses(self.poses)
        block.add_approximations(self.points, self.coordinates)
        for part in self.start.sets:
            block.add_measures(part.given.measures.rows(part.rows), part.given.weighting, part.given.name)
        return block

    # Precisions

    @property
    def is_a_posteriori(self) -> bool:
        """Whether precisions are scaled by sigma0^2: there is redundancy to estimate it from."""
        return self.result.variance_factor is not None

    @cached_property
    def point_covariances(self) -> FloatArray:
        """(n, 3, 3) of the points."""
        return self.result.covariance(self.equations.points, not self.is_a_posteriori)

    @cached_property
    def centre_covariances(self) -> FloatArray:
        """(n, 3, 3) of the projection centres."""
        return self.result.covariance(self.equations.centres, not self.is_a_posteriori)

    @cached_property
    def rotation_covariances(self) -> FloatArray:
        """(n, 3, 3) of the small rotations about the camera's axes, radians^2."""
        return self.result.covariance(self.equations.rotations, not self.is_a_posteriori)

    def pose_covariance(self, image: str) -> FloatArray:
        """(6, 6) of centre and small rotation of one image."""
        row = index_of(self.poses.images, [image], "image")
        ids = [int(self.equations.centres[row][0])], [int(self.equations.rotations[row][0])]
        parts = [[self.covariance_between(first, second) for second in ids] for first in ids]
        return np.block(parts)

    def attitude_precisions(self, form: str = "opk") -> FloatArray:
        """(n, 3) standard deviations of the angles of a form, radians (see `obseq.geometry.attitudes`)."""
        jacobian = attitude_jacobian(self.poses.rotations, form)
        covariances = jacobian @ self.rotation_covariances @ np.swapaxes(jacobian, 1, 2)
        return np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))

    def camera_covariance(self, name: str) -> FloatArray:
        """(k, k) of the parameters of a camera, in the order of its `parameter_names`."""
        ids = self._calibration(name)
        return np.asarray(self.result.covariance(ids, not self.is_a_posteriori)[0])

    def camera_precisions(self, name: str) -> dict[str, float]:
        """Standard deviations of the parameters of a camera; zero where frozen."""
        sigmas = np.sqrt(np.diagonal(self.camera_covariance(name)))
        return dict(zip(self.block.cameras[name].parameter_names, map(float, sigmas), strict=True))

    def camera_correlations(self, name: str) -> FloatArray:
        """(k, k) correlations within a calibration; 0 with frozen parameters."""
        return _correlations(self.camera_covariance(name))

    def camera_pose_correlations(self, camera: str, image: str) -> FloatArray:
        """(k, 6) correlations of a calibration with centre and small rotation of an image."""
        ids = self._calibration(camera)
        row = index_of(self.poses.images, [image], "image")
        cross = np.hstack(
            [
                self.covariance_between(ids, other[row])
                for other in (self.equations.centres, self.equations.rotations)
            ]
        )
        own = np.sqrt(np.diagonal(self.camera_covariance(camera)))
        other = np.sqrt(np.diagonal(self.pose_covariance(image)))
        return _divided(cross, own, other)

    def covariance_between(self, first: ArrayLike, second: ArrayLike) -> FloatArray:
        """Covariance of unknowns of the system, by block."""
        return self.result.covariance_between(first, second, not self.is_a_posteriori)

    def _calibration(self, name: str) -> IntArray:
        return self.equations.calibrations[index_of(self.equations.cameras, [name], "camera")]

    # Instruments

    def _rigid(self, name: str) -> RigidEquations:
        names = [item.block.name for item in self.equations.rigid]
        return self.equations.rigid[int(index_of(names, [name], "rigid block")[0])]

    def rigid_places(self, name: str) -> Poses:
        """Adjusted places of the cameras of a rigid block, by their identifiers."""
        part = self._rigid(name)
        cameras = part.block.places.images
        return Poses.of(cameras, self.result.values(part.centres), self.result.values(part.rotations))

    def rigid_place_precisions(self, name: str) -> FloatArray:
        """(k, 6) standard deviations of the places: centres, small rotations (radians); 0 where held."""
        part, a_priori = self._rigid(name), not self.is_a_posteriori
        parts = [self.result.covariance(ids, a_priori) for ids in (part.centres, part.rotations)]
        return np.sqrt(np.hstack([np.diagonal(found, axis1=1, axis2=2) for found in parts]))

    def rigid_residuals(self, name: str) -> RigidResiduals:
        """How the adjusted poses agree with the places of a rigid block, exposure by exposure."""
        return residuals_of(self._rigid(name), self.poses, self.rigid_places(name))

    @property
    def _clinometers(self) -> ClinometerEquations:
        if self.equations.clinometers is None:
            raise InputError("the block has no readings of clinometers (add_inclinations)")
        return self.equations.clinometers

    def clinometer(self, name: str) -> Clinometer:
        """A clinometer with its adjusted axis and correction."""
        return self._clinometers.adjusted(self.result, name)

    @property
    def _pendulums(self) -> PendulumEquations:
        if self.equations.pendulums is None:
            raise InputError("the block has no readings of pendulums (add_needles)")
        return self.equations.pendulums

    def pendulum(self, name: str) -> Pendulum:
        """A pendulum with its adjusted boresight."""
        return self._pendulums.adjusted(self.result, name)

    def needle_residuals(self) -> FloatArray:
        """(n,) readings of pendulums, computed minus read, radians."""
        return self._pendulums.residuals(self.result)

    @property
    def vertical(self) -> FloatArray:
        """(3,) the adjusted vertical, upwards in the world."""
        return np.asarray(self.result.values(self._clinometers.vertical)[0])

    def clinometer_residuals(self) -> tuple[list[str], FloatArray]:
        """Readings by name, and (n,) computed minus read, radians."""
        return self._clinometers.residuals(self.result)

    # Residuals

    @cached_property
    def residuals(self) -> MeasureResiduals:
        """Residuals of the image points that took part."""
        parts, sets = self.equations.measures, self.start.sets
        active = [item.batch.active for item in parts]
        rows = [item.rows[kept] for item, kept in zip(parts, active, strict=True)]
        given = [sets[item.part] for item in parts]
        return MeasureResiduals(
            np.concatenate([part.image[row] for part, row in zip(given, rows, strict=True)]),
            np.concatenate([part.point[row] for part, row in zip(given, rows, strict=True)]),
            np.concatenate([np.full(len(row), item.part) for item, row in zip(parts, rows, strict=True)]),
            np.concatenate(rows),
            np.concatenate([part.given.measures.xy[row] for part, row in zip(given, rows, strict=True)]),
            np.concatenate(
                [self.result.residuals(item.batch)[kept] for item, kept in zip(parts, active, strict=True)]
            ),
            np.concatenate([part.given.measures.sigmas[row] for part, row in zip(given, rows, strict=True)]),
            np.concatenate(
                [item.batch.robust_weights()[kept] for item, kept in zip(parts, active, strict=True)]
            ),
        )

    def reliability(self, level: float = 0.001, power: float = 0.80) -> MeasureReliability:
        """How the image points control each other: redundancy numbers, tests, detectable blunders.

        Args:
            level: of the test of one coordinate, behind the detectable blunders.
            power: of that test.

        Raises:
            InputError: the solution is one without covariances.
        """
        return measure_reliability(self.equations, self.result, level, power)

    def control_residuals(self) -> tuple[tuple[str, ...], FloatArray]:
        """Names of the control points in the adjustment, and (n, 3) adjusted minus given."""
        rows = np.flatnonzero(self.start.is_control)
        names = tuple(self.points[row] for row in rows)
        return names, self.coordinates[rows] - self.start.coordinates[rows]

    def by_image(self) -> Statistics:
        """Residuals per image."""
        return self._statistics(self.residuals.image, self.poses.images)

    def by_point(self) -> Statistics:
        """Residuals per point."""
        return self._statistics(self.residuals.point, self.points)

    def by_camera(self) -> Statistics:
        """Residuals per camera."""
        of_image = index_of(self.equations.cameras, [camera.name for camera in self.start.cameras], "camera")
        return self._statistics(of_image[self.residuals.image], tuple(self.equations.cameras))

    def _statistics(self, owner: IntArray, names: tuple[str, ...]) -> Statistics:
        found, n = self.residuals, len(names)
        counts = np.bincount(owner, minlength=n)
        divisor = np.maximum(counts, 1)
        squares = np.bincount(owner, found.norms**2, n)
        largest = np.zeros(n)
        np.maximum.at(largest, owner, found.norms)
        mean = np.column_stack([np.bincount(owner, found.residuals[:, k], n) for k in (0, 1)])
        return Statistics(names, counts, np.sqrt(squares / (2 * divisor)), largest, mean / divisor[:, None])

    @cached_property
    def is_far(self) -> BoolArray:
        """(n,) points whose rays do not tell how far they are, infinity included; none without precisions.

        Where rays spread by less than they are uncertain, such a point is behind all its cameras.
        """
        if not self.result.has_covariances:
            return np.zeros(len(self.points), dtype=bool)
        return are_far(self.start, self.poses.centres, self.coordinates, self.point_covariances)

    @cached_property
    def is_behind(self) -> BoolArray:
        """(n,) image points, as in `residuals`, whose point is behind the camera in the solution."""
        found = self.residuals
        return ~are_in_front(self.start.cameras, self.poses, found.image, self.coordinates, found.point)


def _correlations(covariance: FloatArray) -> FloatArray:
    sigmas = np.sqrt(np.diagonal(covariance))
    return _divided(covariance, sigmas, sigmas)


def _divided(covariance: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    scale = first[:, None] * second[None, :]
    return np.divide(covariance, scale, out=np.zeros_like(covariance), where=scale > 0.0)
