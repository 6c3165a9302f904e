"""What a solution says of antennas, rolling shutters and check points, in numbers that a file holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from obseq.arrays import BoolArray
from obseq.images.adjustment.referenced import CheckResiduals
from obseq.images.adjustment.solution import BundleSolution
from obseq.records.record import Record

FAMILY = 0.001
"""Chance that right check points, all together, show one that is off."""


class AntennaRecord(Record, frozen=True):
    """An antenna that a camera carries.

    Attributes:
        lever_arm: from the projection centre, in the frame of the camera.
        lever_sigmas: 0 where held; None when no precision was asked for.
        images: of its positions.
        residuals: adjusted minus observed, one for each image.
        rms: of them, by axis.
    """

    name: str
    lever_arm: tuple[float, ...]
    lever_sigmas: tuple[float, ...] | None
    images: tuple[str, ...]
    residuals: tuple[tuple[float, ...], ...]
    rms: tuple[float, ...]


class ShutterRecord(Record, frozen=True):
    """A rolling shutter: seconds from the first line to the last (sigma 0: held; None: not asked for)."""

    camera: str
    readout: float
    sigma: float | None


class CheckPointRecord(Record, frozen=True):
    """A check point.

    Attributes:
        residual: adjusted minus given.
        sigmas: of the residual, from the precisions of both; None where there is none of one.
        n_rays: images that see it.
        is_off: whether the residual is larger than chance makes it.
    """

    name: str
    residual: tuple[float, ...]
    sigmas: tuple[float, ...] | None
    n_rays: int
    is_off: bool


def antenna_records(solution: BundleSolution, precisions: bool) -> Iterator[AntennaRecord]:
    """The antennas of a solution."""
    for part in solution.equations.antennas:
        name = part.antenna.name
        images, residuals = solution.antenna_residuals(name)
        if not images:
            continue
        lever, sigmas = solution.lever_arm(name) if precisions else (solution.lever_value(part), None)
        yield AntennaRecord(
            name,
            tuple(lever.tolist()),
            None if sigmas is None else tuple(sigmas.tolist()),
            images,
            tuple(map(tuple, residuals.tolist())),
            tuple(np.sqrt(np.mean(residuals**2, axis=0)).tolist()),
        )


def shutter_records(solution: BundleSolution, precisions: bool) -> Iterator[ShutterRecord]:
    """The rolling shutters of a solution."""
    for part in solution.equations.shutters:
        name = part.shutter.name
        if precisions:
            yield ShutterRecord(name, *solution.readout(name))
        else:
            yield ShutterRecord(name, float(solution.result.values(part.readout)[0, 0]), None)


def check_records(solution: BundleSolution) -> Iterator[CheckPointRecord]:
    """The check points that the adjustment has determined."""
    found = solution.check_residuals()
    counts = dict(zip(solution.points, solution.by_point().counts.tolist(), strict=True))
    known = np.asarray((np.isfinite(found.sigmas) & (found.sigmas > 0.0)).all(axis=1))
    off = _are_off(found, known)
    for row, name in enumerate(found.names):
        yield CheckPointRecord(
            name,
            tuple(found.differences[row].tolist()),
            tuple(found.sigmas[row].tolist()) if known[row] else None,
            counts[name],
            bool(off[row]),
        )


def _are_off(found: CheckResiduals, known: BoolArray) -> BoolArray:
    """(n,) whether differences are larger than chance makes those of so many points."""
    off = np.zeros(len(known), dtype=bool)
    if known.any():
        differences = found.differences[known]
        squares = np.einsum(
            "ij,ij->i", differences, np.linalg.solve(found.covariances[known], differences[..., None])[..., 0]
        )
        off[known] = squares > chdtri(3, FAMILY / np.count_nonzero(known))
    return off
