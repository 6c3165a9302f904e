"""What a solution says of rigid blocks and clinometers, in numbers that a file holds; radians."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.images.adjustment.solution import BundleSolution
from obseq.records.record import Record


class PlaceRecord(Record, frozen=True):
    """The place of a camera in its rigid block.

    Attributes:
        quaternion: w, x, y, z of the rotation from camera to block.
        sigmas: of the centre and of a small rotation about the axes of the camera (0: held); None when no
            precision was asked for.
    """

    camera: str
    centre: tuple[float, ...]
    quaternion: tuple[float, ...]
    sigmas: tuple[float, ...] | None


class ExposureRecord(Record, frozen=True):
    """How two cameras stood to each other at an exposure, minus their places, in the frame of the first."""

    first: str
    second: str
    exposure: str
    translation: tuple[float, ...]
    rotation: tuple[float, ...]
    sigma_translation: float
    sigma_rotation: float


class PairRecord(Record, frozen=True):
    """A pair of cameras over all exposures: quadratic means per coordinate."""

    first: str
    second: str
    rms_translation: float
    rms_rotation: float


class RigidRecord(Record, frozen=True):
    """An adjusted rigid block."""

    name: str
    master: str
    places: tuple[PlaceRecord, ...]
    pairs: tuple[PairRecord, ...]
    exposures: tuple[ExposureRecord, ...]


PERFECT = (0.0, 1.0, 0.0, 0.0)
"""Coefficients of no correction."""


class ClinometerRecord(Record, frozen=True):
    """An adjusted clinometer, or a pendulum.

    Attributes:
        axis: direction in the frame of its camera; of a pendulum that about which its needle turns.
        correction: coefficients of degrees 0 to 3; of a pendulum there is none.
        images: of its readings.
        residuals: computed minus read, one for each image.
    """

    name: str
    axis: tuple[float, ...]
    correction: tuple[float, ...]
    images: tuple[str, ...]
    residuals: tuple[float, ...]
    rms: float


def rigid_records(solution: BundleSolution, precisions: bool) -> Iterator[RigidRecord]:
    """The rigid blocks of a solution."""
    for block in (part.block for part in solution.equations.rigid):
        scatter = solution.rigid_residuals(block.name).scatter().items()
        pairs = tuple(PairRecord(*cameras, *means) for cameras, means in scatter)
        places = tuple(_places(solution, block.name, precisions))
        yield RigidRecord(block.name, block.master, places, pairs, tuple(_exposures(solution, block.name)))


def _places(solution: BundleSolution, name: str, precisions: bool) -> Iterator[PlaceRecord]:
    found = solution.rigid_places(name)
    turns = found.attitudes("quaternion").tolist()
    sigmas = solution.rigid_place_precisions(name).tolist() if precisions else None
    for k, (camera, centre) in enumerate(zip(found.images, found.centres.tolist(), strict=True)):
        yield PlaceRecord(camera, tuple(centre), tuple(turns[k]), tuple(sigmas[k]) if sigmas else None)


def _exposures(solution: BundleSolution, name: str) -> Iterator[ExposureRecord]:
    found = solution.rigid_residuals(name)
    numbers = (found.translations.tolist(), found.rotations.tolist(), found.sigmas.tolist())
    for pair, exposure, shift, turn, sigmas in zip(found.cameras, found.exposures, *numbers, strict=True):
        yield ExposureRecord(*pair, exposure, tuple(shift), tuple(turn), *sigmas)


def clinometer_records(solution: BundleSolution) -> Iterator[ClinometerRecord]:
    """The clinometers of a solution, then its pendulums."""
    yield from _inclinations(solution)
    needles, first = solution.block.instruments.needles, 0
    residuals = solution.needle_residuals() if needles else np.zeros(0)
    for read in needles:
        own = residuals[first : first + len(read.images)]
        pivot, rms = solution.pendulum(read.pendulum).boresight[2], float(np.sqrt(np.mean(own**2)))
        yield ClinometerRecord(
            read.pendulum, tuple(pivot.tolist()), PERFECT, read.images, tuple(own.tolist()), rms
        )
        first += len(read.images)


def _inclinations(solution: BundleSolution) -> Iterator[ClinometerRecord]:
    instruments = solution.block.instruments
    residuals = solution.clinometer_residuals()[1] if instruments.inclinations else np.zeros(0)
    images = [image for part in instruments.inclinations for image in part.images]
    owners = np.array(
        [part.clinometer for part in instruments.inclinations for _ in part.images], dtype=object
    )
    for name in dict.fromkeys(owners.tolist()):
        rows = np.flatnonzero(owners == name)
        found, own = solution.clinometer(name), residuals[rows]
        yield ClinometerRecord(
            name,
            tuple(found.axis.tolist()),
            found.correction,
            tuple(images[row] for row in rows),
            tuple(own.tolist()),
            float(np.sqrt(np.mean(own**2))),
        )
