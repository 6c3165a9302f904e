"""The least-squares system of a block: one batch per set of measures and camera model, arrays handed over."""

from __future__ import annotations

import itertools

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.geometry import sums_by_owner
from obseq.images.adjustment.reference_equations import (
    AntennaEquations,
    ClinometerEquations,
    PendulumEquations,
    shutters_of,
)
from obseq.images.adjustment.rigid_equations import RigidEquations, attach_rotations
from obseq.images.adjustment.start import NumberedSet, Start
from obseq.images.block import Block
from obseq.images.camera import Camera
from obseq.images.names import are_among, expression, index_of, no_parameter
from obseq.images.parts import PoseObservations
from obseq.kernels.loading import Kernel
from obseq.leastsquares import Batch, LeastSquares

CONTROL = "control points"
LENGTHS = "lengths"
POSES = "observed poses"
PARAMETERS = "observed parameters"
ROLLING = ("EqColinearityCamPPC_", "EqColinearityRolling_")
"""How the name of an equation becomes that of a shutter that rolls."""


@dataclass(frozen=True, eq=False)
class MeasureBatch:
    """A batch of image points.

    Attributes:
        part: number of the set.
        rows: (n,) rows of the set.
        batch: in the system.
    """

    part: int
    rows: IntArray
    batch: Batch


class Equations:
    """A block as a least-squares system.

    Attributes:
        system: the system.
        centres: block of the centre of every image.
        rotations: block of the rotation of every image.
        cameras: names of the cameras that took images.
        calibrations: block of each of them.
        points: block of every point.
        measures: the batches of image points.
        control: batch of the coordinates of control points, and (n, 2) their point and component.
        antennas: receivers that cameras carry.
        shutters: that roll.
        rigid: rigid blocks.
        clinometers: the clinometers; None where nothing was read.
        pendulums: the same of pendulums.
        eliminated: blocks of the points that are taken out of the normal equations first.
    """

    def __init__(self, block: Block, start: Start, system: LeastSquares, eliminate: bool) -> None:
        self.block, self.start, self.system = block, start, system
        images = start.poses.images
        self.centres = system.add_points([f"{image} centre" for image in images], start.poses.centres)
        self.rotations = system.add_rotations(images, start.poses.rotations)
        self._add_calibrations()
        self.points = system.add_points(start.points, start.places)
        self._freeze()
        self.shutters = shutters_of(system, block, images)
        self.measures = [
            found for number, part in enumerate(start.sets) for found in self._add_measures(number, part)
        ]
        self.control: tuple[Batch | None, IntArray] = self._add_control()
        self._add_lengths()
        for observed in block.pose_observations:
            self._observe_poses(observed)
        poses = self.centres, self.rotations
        self.antennas = [AntennaEquations(system, one, images, poses) for one in block.antennas]
        self.rigid = [RigidEquations(system, rigid, images, poses) for rigid in block.rigid_blocks]
        self.clinometers: ClinometerEquations | None = None
        if block.instruments.inclinations:
            self.clinometers = ClinometerEquations(system, block.instruments, images, poses)
        self.pendulums: PendulumEquations | None = None
        if block.instruments.needles:
            self.pendulums = PendulumEquations(system, block.instruments, images, self.rotations)
        self._slow()
        self._see()
        self.eliminated = self._eliminated() if eliminate else self.points[:0]
        if self.eliminated.size:
            system.eliminate(self.eliminated)

    @property
    def instruments(self) -> list[IntArray]:
        """Blocks of unknowns of what carries the cameras, one array for each kind."""
        found = [ids for part in self.rigid for ids in (part.centres, part.rotations)]
        found += [part.lever for part in self.antennas] + [part.readout for part in self.shutters]
        if self.clinometers is not None:
            found += [self.clinometers.vertical, self.clinometers.axes, self.clinometers.corrections]
        if self.pendulums is not None:
            found.append(self.pendulums.boresights)
        return found

    # Unknowns

    def _add_calibrations(self) -> None:
        """Cameras one after the other that have the same parameters are added at once."""
        used = list({camera.name: camera for camera in self.start.cameras}.values())
        self.cameras = [camera.name for camera in used]
        alike = itertools.groupby(used, key=lambda camera: camera.parameter_names)
        self.calibrations = np.concatenate(
            [self._add_alike(list(cameras), parameters) for parameters, cameras in alike]
        )
        of_image = index_of(self.cameras, [camera.name for camera in self.start.cameras], "camera")
        self._calibration_of_image = self.calibrations[of_image]

    def _add_alike(self, cameras: list[Camera], parameters: tuple[str, ...]) -> IntArray:
        values = np.stack([camera.parameters for camera in cameras])
        return self.system.add_vectors([camera.name for camera in cameras], values, parameters)

    def _freeze_parameters(self) -> None:
        together: dict[tuple[tuple[str, ...], tuple[str, ...]], list[int]] = {}
        for name, ids in zip(self.cameras, self.calibrations.tolist(), strict=True):
            names = self.block.cameras[name].parameter_names
            frozen = tuple(parameter for parameter in names if self.block.is_frozen(name, parameter))
            together.setdefault((names, frozen), []).append(ids)
        for (_, frozen), alike in together.items():
            if frozen:
                self.system.freeze(alike, frozen)

    def _freeze(self) -> None:
        system, block, images = self.system, self.block, self.start.poses.images
        self._freeze_parameters()
        for patterns, ids in (
            (block.fixed_centres, self.centres),
            (block.fixed_rotations, self.rotations),
        ):
            fixed = [
                k for k, image in enumerate(images) if any(pattern.fullmatch(image) for pattern in patterns)
            ]
            if fixed:
                system.freeze(ids[fixed])
        if self.start.is_control.any():
            for component, held in enumerate(self.start.is_held.T):
                if held.any():
                    system.freeze(self.points[held], (component,))
        for parameters, cameras in block.shared:
            self._share(parameters, cameras)
        for parameters, cameras, value, sigma in block.parameter_priors:
            self._observe_parameters(parameters, cameras, value, sigma)

    def _matching(self, parameters: str, cameras: str) -> dict[str, list[int]]:
        """Blocks of the cameras that have each parameter, by name of the parameter."""
        wanted, of = expression(parameters), expression(cameras)
        found: dict[str, list[int]] = {}
        for name, ids in zip(self.cameras, self.calibrations, strict=True):
            if of.fullmatch(name):
                for parameter in self.block.cameras[name].parameter_names:
                    if wanted.fullmatch(parameter):
                        found.setdefault(parameter, []).append(int(ids))
        if not found:
            known = {name: self.block.cameras[name].parameter_names for name in self.cameras}
            raise no_parameter(parameters, cameras, known)
        return found

    def _share(self, parameters: str, cameras: str) -> None:
        for parameter, ids in self._matching(parameters, cameras).items():
            if len(ids) > 1:
                self.system.share(ids, (parameter,))

    def _observe_parameters(self, parameters: str, cameras: str, value: float | None, sigma: float) -> None:
        for parameter, ids in self._matching(parameters, cameras).items():
            for block in ids:
                known = self.system.values([block])
                names = self.system.unknowns.components(block)
                sigmas = np.where([name == parameter for name in names], sigma, np.inf)
                given = known if value is None else np.full_like(known, value)
                self.system.add_prior([block], given, sigmas[None], PARAMETERS)

    def _eliminated(self) -> IntArray:
        """Blocks of the points that only image measures and their own coordinates concern."""
        alone = ~are_among(self.start.points, self.block.joined_points)
        if self.start.is_control.any():
            alone &= ~self.start.is_held.all(axis=1)
        return self.points[alone]

    # Equations

    def _add_measures(self, number: int, part: NumberedSet) -> list[MeasureBatch]:
        """One batch per camera model."""
        rows = part.rows
        kinds = [self._equation_of(image) for image in range(len(self.start.cameras))]
        formulas, equations = [name for name, _ in kinds], dict(kinds)
        if len(equations) == 1:
            chosen = [(formula, rows) for formula in equations.values()]
        else:
            kind = index_of(list(equations), formulas, "formula")[part.image[rows]]
            chosen = [(formula, rows[kind == k]) for k, formula in enumerate(equations.values())]
        return [
            MeasureBatch(number, here, self._add_batch(formula, part, here))
            for formula, here in chosen
            if here.size
        ]

    def _equation_of(self, image: int) -> tuple[str, str | Kernel]:
        """The equation of the points of an image, and a name; that of a rolling shutter is of its own."""
        camera = self.start.cameras[image]
        if any(image in shutter.row_of for shutter in self.shutters):
            name = camera.formula.replace(*ROLLING)
            return f"{name} {camera.name}", name
        return camera.formula, camera.equation

    def _add_batch(self, formula: str | Kernel, part: NumberedSet, rows: IntArray) -> Batch:
        measures = part.given.measures
        chosen = slice(None) if rows is part.rows and part.is_in_order else rows
        image = part.image[chosen]
        blocks = {
            "point": self.points[part.point[chosen]],
            "camera.centre": self.centres[image],
            "camera.rotation": self.rotations[image],
            "calibration": self._calibration_of_image[image],
        }
        observed = measures.xy[chosen]
        for shutter in self.shutters:
            if shutter.row_of.get(int(image[0])) is not None:
                height = self.block.cameras[shutter.shutter.name].height
                observed = shutter.observations(observed, image, height)
                blocks["readout"] = np.repeat(shutter.readout, len(image))
        is_correlated = measures.are_correlated
        return self.system.add(
            formula,
            blocks,
            observed,
            None if is_correlated else measures.sigmas[chosen],
            lambda row: measures.label(int(rows[row])),
            part.given.name,
            covariances=measures.matrices[chosen] if is_correlated else None,
            loss=part.given.loss,
        )

    def _add_control(self) -> tuple[Batch | None, IntArray]:
        """Coordinates as observations; those of one point are whitened where they are correlated."""
        start = self.start
        nothing = None, np.zeros((0, 2), dtype=np.int64)
        if not start.is_control.any():
            return nothing
        given = start.is_control[:, None] & ~start.is_held & ~start.is_free
        if not given.any():
            return nothing
        rows = np.argwhere(given)
        roots = roots_of(start.covariances, given)
        coefficients = roots[rows[:, 0], rows[:, 1]]
        values = np.sum(coefficients * start.coordinates[rows[:, 0]], axis=1)
        labels = [f"{start.points[point]} {'xyz'[component]}" for point, component in rows]
        ids = self.points[rows[:, 0]]
        return self.system.add_linear([ids], [coefficients], values, 1.0, labels, CONTROL), rows

    def _add_lengths(self) -> None:
        lengths = self.block.lengths
        if lengths.values:
            ends = [
                self.points[index_of(self.start.points, names, "length: point")]
                for names in (lengths.first, lengths.second)
            ]
            blocks = {"p1": ends[0], "p2": ends[1]}
            self.system.add("Dist3D", blocks, lengths.values, lengths.sigmas, group=LENGTHS)

    def _observe_poses(self, observed: PoseObservations) -> None:
        rows = index_of(self.start.poses.images, observed.poses.images, "observed poses: image")
        self.system.add_prior(self.centres[rows], observed.poses.centres, observed.centre_sigmas, POSES)
        if observed.rotation_sigma is not None:
            known, sigma = observed.poses.rotations, observed.rotation_sigma
            attach_rotations(self.system, self.rotations[rows], known, sigma, POSES)

    def _see(self) -> None:
        """Points that nothing but images concerns move in their inverse distance from where they are seen."""
        free = self.start.is_free.all(axis=1) & ~are_among(self.start.points, self.block.joined_points)
        if free.any():
            places = viewpoints(self.start, self.start.poses.centres)
            self.system.unknowns.see_from(self.points[free], places[free])

    def _slow(self) -> None:
        for sigma, ids in zip(self.block.viscosity, (self.centres, self.rotations), strict=True):
            if sigma is not None:
                self.system.add_viscosity(ids, sigma)


def roots_of(covariances: FloatArray, given: BoolArray) -> FloatArray:
    """(n, 3, 3) rows that make the given coordinates independent and of unit sigma; 0 for the others."""
    roots = np.zeros_like(covariances)
    variances = np.diagonal(covariances, axis1=1, axis2=2)
    off = np.abs(covariances[:, [0, 0, 1], [1, 2, 2]]).max(axis=1, initial=0.0) > 0.0
    simple = given & ~off[:, None]
    where = np.argwhere(simple)
    roots[where[:, 0], where[:, 1], where[:, 1]] = 1.0 / np.sqrt(variances[simple])
    for k in np.flatnonzero(off):
        roots[k] = np.linalg.cholesky(np.linalg.inv(covariances[k])).T
    return roots


FAR_SIGMAS = 3.0
"""Standard deviations of an inverse distance within which it may be zero."""


def viewpoints(start: Start, centres: FloatArray) -> FloatArray:
    """(n, 3) the middle of the places (k, 3) from where the points of a block are seen."""
    image, point = rays_of(start)
    counts = np.maximum(np.bincount(point, minlength=len(start.points)), 1)
    return np.asarray(sums_by_owner(centres[image], point, len(start.points)) / counts[:, None])


def rays_of(start: Start) -> tuple[IntArray, IntArray]:
    """(m,) images and (m,) points of the measures that take part at first."""
    images = [part.image[part.rows] for part in start.sets]
    points = [part.point[part.rows] for part in start.sets]
    return np.concatenate(images), np.concatenate(points)


def are_far(start: Start, centres: FloatArray, coordinates: FloatArray, covariances: FloatArray) -> BoolArray:
    """(n,) points of which infinity is within the precision of their distance, known points aside.

    The inverse of a distance has the relative standard deviation of the distance.

    Args:
        start: of the block.
        centres: (k, 3) adjusted.
        coordinates: (n, 3) adjusted.
        covariances: (n, 3, 3) of these.
    """
    arms = coordinates - viewpoints(start, centres)
    squares = np.einsum("ij,ij->i", arms, arms)
    along = np.einsum("ij,ijk,ik->i", arms, covariances, arms)
    return np.asarray(start.is_free.all(axis=1) & (FAR_SIGMAS**2 * along > squares**2))
