"""A block of images: what is known and what was measured, put together by name."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING

import numpy as np

from obseq.arguments import expecting, instance
from obseq.dataclass import dataclass
from obseq.errors import InputError, RowError
from obseq.images.control import ControlPoints
from obseq.images.measure_checks import check_frames, check_known, check_pair
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among, as_names, expression, index_of, no_parameter, rows_of, sigmas_of
from obseq.images.parts import (
    Approximations,
    Inclinations,
    Instruments,
    Lengths,
    MeasureSet,
    Needles,
    PoseObservations,
    Rule,
)
from obseq.images.poses import Poses
from obseq.images.references import References
from obseq.leastsquares.problem.arguments import finite

if TYPE_CHECKING:
    import re
    from collections.abc import Iterable, Sequence

    from numpy.typing import ArrayLike

    from obseq.images.camera import Camera
    from obseq.images.parts import Clinometer, Pendulum, Weighting
    from obseq.images.rigid import RigidBlock
    from obseq.reading.origin import Origin
    from obseq.survey import Network


@dataclass(eq=False)
class Block(References):
    """Cameras, images, points and measures, by name; nothing is computed here.

    What is added is checked at once: names, numbers, and that measures lie in their images. `notes` are what
    a reader of files found there and has no use for; they are in what is printed of a solution. `origin` is
    the file of another program that the block was read from, `control_origins` where its control points were:
    messages name them. `datum_points` carry the datum of a free block, as its file has them.
    """

    cameras: dict[str, Camera] = field(default_factory=dict)
    camera_of: dict[str, str] = field(default_factory=dict)
    poses: Poses = field(default_factory=lambda: Poses.of([], np.zeros((0, 3)), np.zeros((0, 3, 3))))
    control: ControlPoints = field(default_factory=lambda: ControlPoints.of([], np.zeros((0, 3))))
    sets: list[MeasureSet] = field(default_factory=list)
    approximations: Approximations = field(default_factory=Approximations)
    lengths: Lengths = field(default_factory=Lengths)
    surveys: list[Network] = field(default_factory=list)
    rigid_blocks: list[RigidBlock] = field(default_factory=list)
    pose_observations: list[PoseObservations] = field(default_factory=list)
    instruments: Instruments = field(default_factory=Instruments)
    rules: list[Rule] = field(default_factory=list)
    shared: list[tuple[str, str]] = field(default_factory=list)
    parameter_priors: list[tuple[str, str, float | None, float]] = field(default_factory=list)
    fixed_centres: list[re.Pattern[str]] = field(default_factory=list)
    fixed_rotations: list[re.Pattern[str]] = field(default_factory=list)
    viscosity: tuple[float | None, float | None] = (None, None)
    notes: list[str] = field(default_factory=list)
    origin: Origin | None = None
    datum_points: tuple[str, ...] = ()
    control_origins: list[tuple[tuple[str, ...], Origin]] = field(default_factory=list)

    # What is known

    def add_cameras(self, *cameras: Camera) -> None:
        """Adds calibrations; all their parameters are unknowns until something freezes them.

        Raises:
            InputError: a name comes twice, or a focal length cannot be in pixels.
        """
        for camera in cameras:
            if camera.name in self.cameras:
                raise InputError(f"camera {camera.name!r} is given twice")
            camera.require_plausible()
            self.cameras[camera.name] = camera

    def add_images(self, images: Iterable[str], camera: str) -> None:
        """Says which camera took images, whose poses come later or are to be found."""
        (camera,) = as_names([camera], "camera")
        for image in as_names(images, "images"):
            if image in self.camera_of:
                raise InputError(f"image {image!r} is given twice")
            self._require_camera(image, camera)
            self.camera_of[image] = camera

    def add_poses(
        self,
        images: Poses | Sequence[str],
        centres: ArrayLike = (),
        rotations: ArrayLike = (),
        form: str = "matrix",
        cameras: Sequence[str] | str = "",
    ) -> None:
        """Adds poses of images: a `Poses`, or what makes one (see `Poses.of`).

        An image without a camera gets the one that `add_images` said, or the only one there is.

        Raises:
            InputError: an image has a pose already, or its camera is missing.
        """
        given = images if isinstance(images, Poses) else Poses.of(images, centres, rotations, form, cameras)
        chosen = [self._camera_for(*pair) for pair in zip(given.images, given.cameras, strict=True)]
        twice = set(self.poses.images) & set(given.images)
        if twice:
            raise InputError(f"image {min(twice)!r} has two poses")
        self.camera_of.update(zip(given.images, chosen, strict=True))
        self.poses = Poses(
            self.poses.images + given.images,
            np.concatenate([self.poses.centres, given.centres]),
            np.concatenate([self.poses.rotations, given.rotations]),
            self.poses.cameras + tuple(chosen),
        )

    def _camera_for(self, image: str, camera: str) -> str:
        known = self.camera_of.get(image, "")
        if camera and known and camera != known:
            raise InputError(f"image {image!r}: camera {camera!r} here, {known!r} before")
        only = next(iter(self.cameras)) if len(self.cameras) == 1 else ""
        chosen = camera or known or only
        self._require_camera(image, chosen)
        return chosen

    def _require_camera(self, image: str, camera: str) -> None:
        if camera not in self.cameras:
            known = ", ".join(sorted(self.cameras)) or "none"
            raise InputError(
                f"image {image}: its calibration {camera or '(not named)'} is missing; known: {known}"
            )

    @expecting(control=instance(ControlPoints))
    def add_control_points(self, control: ControlPoints, origin: Origin | None = None) -> None:
        """Adds known points, and where they were read.

        Raises:
            InputError: a name is there already.
        """
        twice = np.flatnonzero(are_among(control.names, self.control.names))
        if twice.size:
            row = int(twice[0])
            raise RowError(f"control point {control.names[row]!r} is given twice", row)
        self.control = ControlPoints(
            self.control.names + control.names,
            np.concatenate([self.control.coordinates, control.coordinates]),
            np.concatenate([self.control.covariances, control.covariances]),
        )
        if origin is not None:
            self.control_origins.append((control.names, origin))

    def control_places(self, names: Sequence[str]) -> list[str]:
        """Control points in words: their names, with file and line where lines are known."""
        found = {
            name: f"{name} ({origin.place(row)})"
            for known, origin in self.control_origins
            for row, name in enumerate(known)
            if origin.lines
        }
        return [found.get(name, name) for name in names]

    @property
    def source(self) -> str:
        """The files that say where the block is in the world, to begin a message; empty when nobody said."""
        control = [origin.path for _, origin in self.control_origins]
        measures = [part.origin.path for part in self.sets if part.origin is not None]
        whole = [] if self.origin is None else [self.origin.path]
        files = ", ".join(dict.fromkeys(control or whole or measures))
        return files and f"{files}: "

    def add_approximations(self, names: Sequence[str], coordinates: ArrayLike) -> None:
        """Gives free points a start; without one, they start where their rays meet."""
        names = as_names(names, "approximations: point")
        array = rows_of(coordinates, len(names), 3, "approximations: coordinates")
        if not np.isfinite(array).all():
            raise InputError(f"approximations of {len(names)} points are a finite ({len(names)}, 3) array")
        self.approximations.add(names, array)

    # What was measured

    @expecting(measures=instance(ImagePoints))
    def add_measures(
        self,
        measures: ImagePoints,
        weighting: Weighting | None = None,
        name: str = "",
        only_known_points: bool = False,
        origin: Origin | None = None,
    ) -> None:
        """Adds points measured in images.

        Args:
            measures: with their sigmas.
            weighting: replaces all sigmas by its own, and weakens or leaves out large residuals.
            name: of the set, for sums of squares; `image points` when empty.
            only_known_points: True to refuse points that are neither control points nor approximations.
            origin: where they were read, for messages.

        Raises:
            InputError: an image or a point is not known, a point is measured twice in an image, or a measure
                lies outside its image.
        """
        check_known(list(self.camera_of), measures.image_names, measures.image, "image points: image")
        if only_known_points:
            known = [*self.control.names, *self.approximations]
            check_known(known, measures.point_names, measures.point, "image points: point")
        check_frames([self.cameras[self.camera_of[image]] for image in measures.image_names], measures)
        for other in self.sets:
            check_pair(other.measures, measures)
        self.sets.append(_weighed(MeasureSet(measures, None, name or "image points", origin), weighting))

    def weigh_measures(self, weighting: Weighting) -> None:
        """Gives all image points that were added one weighting, in place of their own sigmas."""
        self.sets = [_weighed(part, weighting) for part in self.sets]

    def add_length(self, first: str, second: str, length: float, sigma: float) -> None:
        """Adds a distance between two points of the block, a scale bar for instance."""
        first, second = as_names((first, second), "length: point")
        if not (length > 0.0 and sigma > 0.0 and np.isfinite([length, sigma]).all()) or first == second:
            raise InputError(
                f"length {first} - {second}: {length} +- {sigma} between two points is no length"
            )
        old = self.lengths
        self.lengths = Lengths(
            (*old.first, first), (*old.second, second), (*old.values, length), (*old.sigmas, sigma)
        )

    def add_survey(self, network: Network) -> None:
        """Adds a survey network: its observations, its known points and its stations.

        Points of one name are one point. The block must be in the computation frame of the network.

        Raises:
            InputError: a point is known to both, as a control point and with a sigma in the network.
        """
        known = np.flatnonzero(~network.points.is_free.all(axis=1))
        twice = {network.points.names[row] for row in known}
        twice &= set(self.control.names)
        if twice:
            raise InputError(
                f"point {min(twice)!r} is a control point, and known in the survey network too: its "
                "coordinates would count twice; leave one of them free"
            )
        self.surveys.append(network)

    @property
    def joined_points(self) -> set[str]:
        """Names of the points that other observations than image measures join."""
        names = {name for network in self.surveys for name in network.points.names}
        return names | {*self.lengths.first, *self.lengths.second}

    def add_rigid_block(self, block: RigidBlock) -> None:
        """Adds cameras that are fixed to one another."""
        index_of(list(self.camera_of), block.exposures.images, f"block {block.name}: image")
        taken = {image: other.name for other in self.rigid_blocks for image in other.exposures.images}
        for image in block.exposures.images:
            if image in taken:
                raise InputError(f"image {image} is in two rigid blocks, {taken[image]} and {block.name}")
        self.rigid_blocks.append(block)

    def add_clinometer(self, clinometer: Clinometer) -> None:
        """Adds a clinometer that a camera carries; `add_inclinations` says what it read."""
        self.instruments.carry(self.instruments.clinometers, clinometer)

    def add_inclinations(
        self, clinometer: str, images: Sequence[str], angles: ArrayLike, sigmas: ArrayLike
    ) -> None:
        """Adds readings of a clinometer (radians, above the horizon), each with the image taken then."""
        known = [item.name for item in self.instruments.clinometers]
        index_of(known, [clinometer], "inclinations: clinometer")
        index_of(list(self.camera_of), images, f"clinometer {clinometer}: image")
        read = Inclinations(clinometer, tuple(images), np.asarray(angles), np.asarray(sigmas))
        self.instruments.inclinations.append(read)

    def add_pendulum(self, pendulum: Pendulum) -> None:
        """Adds a pendulum that a camera carries; `add_needles` says what it read."""
        self.instruments.carry(self.instruments.pendulums, pendulum)

    def add_needles(self, pendulum: str, images: Sequence[str], angles: ArrayLike, sigmas: ArrayLike) -> None:
        """Adds readings of a pendulum (radians, from its x towards its y), each with the image taken then."""
        known = [item.name for item in self.instruments.pendulums]
        index_of(known, [pendulum], "needles: pendulum")
        index_of(list(self.camera_of), images, f"pendulum {pendulum}: image")
        read = Needles(pendulum, tuple(images), np.asarray(angles), np.asarray(sigmas))
        self.instruments.needles.append(read)

    def add_right_angle(self, first: str, second: str, sigma: float) -> None:
        """Says that the axes of two clinometers are at right angles, to a sigma (radians)."""
        known = [item.name for item in self.instruments.clinometers]
        index_of(known, [first, second], "right angle: clinometer")
        if first == second or not (np.isfinite(sigma) and sigma > 0.0):
            raise InputError(f"right angle of {first} and {second}: two clinometers and a positive sigma")
        self.instruments.right_angles.append((first, second, sigma))

    def set_vertical(self, up: ArrayLike = (0.0, 0.0, 1.0), is_free: bool = False) -> None:
        """Says where upwards is in the world, for clinometers; free, it is an unknown that starts there."""
        x, y, z = finite(up, (3,), "vertical").tolist()
        self.instruments.vertical, self.instruments.vertical_is_free = (x, y, z), is_free

    def observe_poses(
        self, poses: Poses, centre_sigmas: ArrayLike, rotation_sigma: float | None = None
    ) -> None:
        """Adds observed poses: centres with sigmas (a number, (3,) or (n, 3)), and rotations if one is given.

        The observation stays what it is during the adjustment (MMVII's `RefOri`).
        """
        index_of(list(self.camera_of), poses.images, "observed poses: image")
        per_axis = np.shape(centre_sigmas) == (3,)
        given = np.broadcast_to(centre_sigmas, (len(poses), 3)) if per_axis else centre_sigmas
        sigmas = sigmas_of(given, len(poses), 3, "observed poses: sigmas of centres")
        wrong = np.flatnonzero(~(sigmas > 0.0).all(axis=1))
        if wrong.size:
            image = poses.images[wrong[0]]
            raise RowError(f"observed poses: image {image}: sigmas must be above zero", int(wrong[0]))
        if not (rotation_sigma is None or rotation_sigma > 0.0):
            raise InputError(f"observed poses: the sigma of rotations is above zero, not {rotation_sigma}")
        self.pose_observations.append(PoseObservations(poses, sigmas, rotation_sigma))

    # What keeps its value

    def freeze_parameters(self, parameters: str = ".*", cameras: str = ".*") -> None:
        """Keeps the parameters of cameras whose names match two regular expressions, as a whole each."""
        self._rule(parameters, cameras, True)

    def free_parameters(self, parameters: str = ".*", cameras: str = ".*") -> None:
        """Frees them again; what was said last holds."""
        self._rule(parameters, cameras, False)

    def _rule(self, parameters: str, cameras: str, frozen: bool) -> None:
        rule = Rule(expression(cameras), expression(parameters), frozen)
        known = {name: camera.parameter_names for name, camera in self.cameras.items()}
        named = [names for camera, names in known.items() if rule.cameras.fullmatch(camera)]
        if not any(rule.parameters.fullmatch(name) for names in named for name in names):
            raise no_parameter(parameters, cameras, known)
        self.rules.append(rule)

    def is_frozen(self, camera: str, parameter: str) -> bool:
        """Whether a parameter of a camera keeps its value."""
        matching = [
            rule
            for rule in self.rules
            if rule.cameras.fullmatch(camera) and rule.parameters.fullmatch(parameter)
        ]
        return bool(matching) and matching[-1].frozen

    def share_parameters(self, parameters: str, cameras: str = ".*") -> None:
        """Makes parameters one for all cameras that match; of the same name each."""
        expression(parameters), expression(cameras)
        self.shared.append((parameters, cameras))

    def observe_parameters(
        self, parameters: str, sigma: float, cameras: str = ".*", value: float | None = None
    ) -> None:
        """Adds what is known of camera parameters: their present values, or one value, with a sigma."""
        expression(parameters), expression(cameras)
        if not (np.isfinite(sigma) and sigma > 0.0):
            raise InputError(f"parameters {parameters!r}: a sigma must be positive, not {sigma}")
        self.parameter_priors.append((parameters, cameras, value, sigma))

    def freeze_centres(self, images: str = ".*") -> None:
        """Keeps the projection centres of images whose names match."""
        self.fixed_centres.append(self._image_pattern(images))

    def freeze_rotations(self, images: str = ".*") -> None:
        """Keeps the rotations of images whose names match."""
        self.fixed_rotations.append(self._image_pattern(images))

    def _image_pattern(self, images: str) -> re.Pattern[str]:
        pattern = expression(images)
        if not any(pattern.fullmatch(image) for image in self.camera_of):
            raise InputError(f"no image has a name that matches {images!r}")
        return pattern

    def slow_poses(self, centre: float | None = None, rotation: float | None = None) -> None:
        """Lets poses move by about this much per iteration (unit of the world; radians).

        It changes the way to the solution and nothing in it: it is no observation (MMVII's `PoseVisc` is).
        """
        self.viscosity = (centre, rotation)


def _weighed(part: MeasureSet, weighting: Weighting | None) -> MeasureSet:
    if weighting is None:
        return part
    given = part.measures
    names = given.image_names, given.point_names
    measures = ImagePoints.packed(*names, given.image, given.point, given.xy, weighting.sigma)
    return MeasureSet(measures, weighting, part.name, part.origin)
