"""Antennas, rolling shutters and clinometers in the system of a block of images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.images.block import Block
from obseq.images.names import index_of
from obseq.images.parts import Clinometer, Instruments, Needles, Pendulum
from obseq.images.references import Antenna, Shutter
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
from obseq.leastsquares.problem.priors import Prior

ANTENNAS = "antennas"
LEVER_ARMS = "lever arms"
READOUTS = "readouts"


class AntennaEquations:
    """The antenna of a receiver in a system.

    Attributes:
        antenna: of the images that are adjusted.
        lever: (1,) block of its lever arm; none where the antenna is the projection centre.
        rows: (n,) images.
        source: the equations.
    """

    def __init__(
        self, system: LeastSquares, antenna: Antenna, images: Sequence[str], poses: tuple[IntArray, IntArray]
    ) -> None:
        self.antenna = own = antenna.of(set(images))
        self.rows = index_of(images, own.images, f"antenna {own.name}: image")
        self.lever = np.zeros(0, dtype=np.int64)
        self.source: Batch | Prior | None = None
        if not own.images:
            return
        if own.is_central:
            centres = poses[0][self.rows]
            self.source = system.add_prior(centres, own.positions, own.sigmas, ANTENNAS)
            return
        self.lever = system.add_points([f"lever arm {own.name}"], own.lever_arm[None])
        held_or_observed(system, self.lever, own.lever_arm, own.lever_sigmas, LEVER_ARMS)
        blocks = {
            "camera.centre": poses[0][self.rows],
            "camera.rotation": poses[1][self.rows],
            "lever": np.repeat(self.lever, len(self.rows)),
        }
        labels = [f"antenna {own.name}, image {image}" for image in own.images]
        self.source = system.add("AntennaPosition", blocks, own.positions, own.sigmas, labels, ANTENNAS)


class ShutterEquations:
    """A rolling shutter in a system: the unknown of its readout, and what its image points take.

    Attributes:
        shutter: what is known.
        readout: (1,) block of its readout.
        row_of: rows of its velocities by image, a position in the images of the block.
    """

    def __init__(self, system: LeastSquares, shutter: Shutter, images: Sequence[str]) -> None:
        self.shutter = shutter
        self.readout = system.add_vectors([f"shutter {shutter.name}"], [[shutter.readout]], ["readout"])
        known = {image: row for row, image in enumerate(shutter.images)}
        self.row_of = {k: known[image] for k, image in enumerate(images) if image in known}
        value, sigma = np.array([shutter.readout]), np.array([shutter.sigma])
        held_or_observed(system, self.readout, value, sigma, READOUTS)

    def observations(self, xy: FloatArray, images: IntArray, height: int) -> FloatArray:
        """(n, 6) what the equations of image points (n, 2) in images (n,) take: pixel, velocity, height."""
        rows = [self.row_of[image] for image in images.tolist()]
        return np.column_stack([xy, self.shutter.velocities[rows], np.full(len(xy), float(height))])


def held_or_observed(
    system: LeastSquares, block: IntArray, values: FloatArray, sigmas: FloatArray, group: str
) -> None:
    """Holds the components (k,) of a block whose sigma is 0, and observes those whose sigma is finite."""
    held = np.flatnonzero(sigmas == 0.0).tolist()
    if held:
        system.freeze(block, held)
    spread = np.where(sigmas == 0.0, np.inf, sigmas)
    if np.isfinite(spread).any():
        system.add_prior(block, values[None], spread[None], group)


def shutters_of(system: LeastSquares, block: Block, images: Sequence[str]) -> list[ShutterEquations]:
    """The rolling shutters of a block, whose cameras and images are checked.

    Raises:
        InputError: a camera has no size, or is one whose equation does not roll; an image is not its own.
    """
    for shutter in block.shutters:
        wrong = [image for image in shutter.images if block.camera_of.get(image) != shutter.name]
        if wrong:
            raise InputError(f"shutter of {shutter.name}: image {wrong[0]} is not of this camera")
        camera = block.cameras[shutter.name]
        if not (camera.height and camera.is_mmvii):
            raise InputError(
                f"shutter of {shutter.name}: a rolling shutter takes a camera with a size, whose distortion "
                "moves the computed point"
            )
    return [ShutterEquations(system, shutter, images) for shutter in block.shutters]


CLINOMETERS = "clinometers"
RIGHT_ANGLES = "right angles"
DEGREE_NAMES = ("degree 0", "degree 1", "degree 2", "degree 3")


class ClinometerEquations:
    """The clinometers of a block in a system.

    Attributes:
        instruments: what they are, and what they read.
        vertical: (1,) block of unknowns of the vertical.
        axes: (k,) blocks of the axes.
        corrections: (k,) blocks of the corrections.
        batches: one for each set of readings.
    """

    def __init__(
        self,
        system: LeastSquares,
        instruments: Instruments,
        images: Sequence[str],
        poses: tuple[IntArray, IntArray],
    ) -> None:
        self.instruments, self._system = instruments, system
        clinometers = instruments.clinometers
        self._names = [item.name for item in clinometers]
        self.vertical = system.add_directions(["vertical"], [instruments.vertical])
        if not instruments.vertical_is_free:
            system.freeze(self.vertical)
        self.axes = system.add_directions(
            [f"{name} axis" for name in self._names], [item.axis for item in clinometers]
        )
        self.corrections = system.add_vectors(
            [f"{name} correction" for name in self._names],
            [item.correction for item in clinometers],
            DEGREE_NAMES,
        )
        self._freeze()
        self.batches = [self._add(number, images, poses) for number in range(len(instruments.inclinations))]
        self._add_right_angles()

    def _freeze(self) -> None:
        for row, item in enumerate(self.instruments.clinometers):
            held = [degree for degree in range(len(DEGREE_NAMES)) if degree not in item.free_degrees]
            if held:
                self._system.freeze(self.corrections[row : row + 1], held)
            if item.is_fixed:
                self._system.freeze(self.axes[row : row + 1])

    def _add(self, number: int, images: Sequence[str], poses: tuple[IntArray, IntArray]) -> Batch:
        read = self.instruments.inclinations[number]
        rows = index_of(images, read.images, f"clinometer {read.clinometer}: image")
        (own,) = index_of(self._names, [read.clinometer], "clinometer")
        blocks = {
            "block.centre": poses[0][rows],
            "block.rotation": poses[1][rows],
            "axis": self.axes[own],
            "vertical": self.vertical,
            "correction": self.corrections[own],
        }
        labels = [f"clinometer {read.clinometer}, image {image}" for image in read.images]
        sigmas = read.sigmas * np.cos(read.angles)
        return self._system.add("Clino_0_3", blocks, read.angles, sigmas, labels, CLINOMETERS)

    def _add_right_angles(self) -> None:
        for first, second, sigma in self.instruments.right_angles:
            a, b = index_of(self._names, [first, second], "right angle: clinometer")
            blocks = {"first": self.axes[a : a + 1], "second": self.axes[b : b + 1]}
            labels = [f"right angle of {first} and {second}"]
            self._system.add("VNormOrthog", blocks, None, sigma, labels, RIGHT_ANGLES)

    def adjusted(self, result: LeastSquaresResult, name: str) -> Clinometer:
        """A clinometer with its adjusted axis and correction."""
        (row,) = index_of(self._names, [name], "clinometer")
        given = self.instruments.clinometers[row]
        axis = result.values(self.axes[row : row + 1])[0]
        correction = tuple(result.values(self.corrections[row : row + 1])[0].tolist())
        return Clinometer(name, axis, correction, given.free_degrees, given.is_fixed)

    def residuals(self, result: LeastSquaresResult) -> tuple[list[str], FloatArray]:
        """Readings by name, and (n,) computed minus read, radians."""
        read = self.instruments.inclinations
        labels = [f"clinometer {part.clinometer}, image {image}" for part in read for image in part.images]
        sines = np.concatenate([result.residuals(batch)[:, 0] for batch in self.batches])
        cosines = np.cos(np.concatenate([part.angles for part in read]))
        return labels, np.asarray(sines / cosines)


NEEDLES = "needles"


class PendulumEquations:
    """The pendulums of a block in a system; the vertical is as it was given.

    Attributes:
        instruments: what they are, and what they read.
        boresights: (k,) blocks of their boresights.
        batches: one for each set of readings.
    """

    def __init__(
        self, system: LeastSquares, instruments: Instruments, images: Sequence[str], rotations: IntArray
    ) -> None:
        if instruments.vertical_is_free:
            raise InputError("pendulums refer to a vertical that is known (set_vertical)")
        self.instruments, pendulums = instruments, instruments.pendulums
        self._names = [item.name for item in pendulums]
        names = [f"{name} boresight" for name in self._names]
        self.boresights = system.add_rotations(names, [item.boresight for item in pendulums])
        held = [row for row, item in enumerate(pendulums) if item.is_fixed]
        if held:
            system.freeze(self.boresights[held])
        self._tie(system)
        up = np.array(instruments.vertical)
        down = -up / np.linalg.norm(up)
        self.batches = [self._add(system, read, images, rotations, down) for read in instruments.needles]

    def _tie(self, system: LeastSquares) -> None:
        """Small turns are about the axes of the camera, and those of one body are the same."""
        for row, item in enumerate(self.instruments.pendulums):
            if item.turns_with:
                (other,) = index_of(self._names, [item.turns_with], f"pendulum {item.name}: turns with")
                ids = [np.repeat(self.boresights[k], 3) for k in (row, other)]
                labels = [f"boresight {item.name} = {item.turns_with}, {axis}" for axis in "xyz"]
                system.constrain_linear(ids, [np.eye(3), -np.eye(3)], np.zeros(3), labels, is_tangent=True)

    def _add(
        self,
        system: LeastSquares,
        read: Needles,
        images: Sequence[str],
        rotations: IntArray,
        down: FloatArray,
    ) -> Batch:
        rows = index_of(images, read.images, f"pendulum {read.pendulum}: image")
        (own,) = index_of(self._names, [read.pendulum], "pendulum")
        blocks = {"boresight": self.boresights[own], "rotation": rotations[rows]}
        labels = [f"pendulum {read.pendulum}, image {image}" for image in read.images]
        observed = np.column_stack([np.tile(down, (len(rows), 1)), read.angles])
        return system.add("ClinoNeedle", blocks, observed, read.sigmas, labels, NEEDLES)

    def adjusted(self, result: LeastSquaresResult, name: str) -> Pendulum:
        """A pendulum with its adjusted boresight."""
        (row,) = index_of(self._names, [name], "pendulum")
        given = self.instruments.pendulums[row]
        boresight = result.values(self.boresights[row : row + 1])[0]
        return Pendulum(name, boresight, given.is_fixed, given.turns_with)

    def residuals(self, result: LeastSquaresResult) -> FloatArray:
        """(n,) computed minus read, radians, in the order of the readings."""
        return np.concatenate([result.residuals(batch)[:, 0] for batch in self.batches])
