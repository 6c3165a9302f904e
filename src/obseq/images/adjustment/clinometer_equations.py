"""Clinometers in the system of a block of images: their axes, their corrections, and the vertical."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.clinometers import Clinometer
from obseq.images.names import index_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.parts import Instruments
    from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult

GROUP = "clinometers"
RIGHT_ANGLES = "right angles"
NAMES = ("degree 0", "degree 1", "degree 2", "degree 3")


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
            [f"{name} correction" for name in self._names], [item.correction for item in clinometers], NAMES
        )
        self._freeze()
        self.batches = [self._add(number, images, poses) for number in range(len(instruments.inclinations))]
        self._add_right_angles()

    def _freeze(self) -> None:
        for row, item in enumerate(self.instruments.clinometers):
            held = [degree for degree in range(len(NAMES)) if degree not in item.free_degrees]
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
        return self._system.add("Clino_0_3", blocks, read.angles, sigmas, labels, GROUP)

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
