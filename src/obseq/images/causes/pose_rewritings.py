"""What is wrong with poses that were given for images found at others, and what they should have been."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.images.causes.axes import ORDERS
from obseq.images.causes.comparison import angles_of, common, turns
from obseq.images.causes.shared import Told
from obseq.images.causes.unit_of_control import UNIT_OF_CONTROL
from obseq.images.initial.growth import similarity
from obseq.images.initial.units import UNITS
from obseq.images.parts import PoseObservations
from obseq.images.poses import Poses

NEAR = 0.3
"""Share of the way to its own place within which an image is at that of another, or where it was written."""
ALIKE = 0.2
"""Radians within which turns of all images are the same one."""
OFF = 0.5
"""Radians by which a rotation is off that cannot have been a rough one."""
FAR = 0.5
"""Share of the distance to the nearest other image, beyond which a centre is off."""
SCALE = 0.1
"""Share by which centres that are given roughly may be off a unit with their scale, and off a similarity."""
SHOWN = 4
MOST = 500
"""Images of a block whose places are compared with each other."""
QUARTER = np.pi / 2.0
TURNS = (
    (
        [0.0, 0.0, QUARTER],
        "by 90 degrees about the viewing axis: kappa, or images that were turned after all",
    ),
    (
        [0.0, 0.0, -QUARTER],
        "by -90 degrees about the viewing axis: kappa, or images that were turned after all",
    ),
    ([0.0, 0.0, 2 * QUARTER], "by 180 degrees about the viewing axis: kappa, or images upside down"),
    ([2 * QUARTER, 0.0, 0.0], "by 180 degrees about x: cameras look along +z here, y goes down"),
    ([0.0, 2 * QUARTER, 0.0], "by 180 degrees about y: cameras look along +z here, x goes to the right"),
)
"""Rotation vectors in the axes of the camera, and what they are called."""


class Rewriting(NamedTuple):
    """How poses should have been written.

    Attributes:
        told: what is wrong with them.
        change: from poses as they are written to those that are meant.
        scale: by which that makes centres larger.
    """

    told: Told
    change: Callable[[Poses], Poses]
    scale: float = 1.0


def without_rotations(images: Sequence[str], centres: FloatArray, sigmas: FloatArray) -> PoseObservations:
    """Centres (n, 3), of an antenna for instance, as observed poses whose rotations are not."""
    turns = np.broadcast_to(np.eye(3), (len(images), 3, 3))
    return PoseObservations(Poses.of(images, centres, turns), sigmas, None)


def rewritings_of(found: Poses, observed: PoseObservations) -> Iterator[Rewriting]:
    """How observed poses of images that are found at others may have been meant."""
    has_centres = bool(np.isfinite(observed.centre_sigmas).all())
    yield from _rewritings(found, observed.poses, has_centres, observed.rotation_sigma is not None)


def compared(found: Poses, given: Poses, are_observed: bool) -> Told:
    """What is wrong with given poses of images that are found at others."""
    told = next((right.told for right in _rewritings(found, given, True, True)), None)
    return told or Told(_off(*common(found, given), are_observed))


def _rewritings(found: Poses, given: Poses, has_centres: bool, has_rotations: bool) -> Iterator[Rewriting]:
    new, old = common(found, given)
    if not len(new):
        return
    if has_centres and (exchanged := exchanges(new, old)):
        yield Rewriting(words_of_exchange(exchanged), partial(_exchanged, exchanged))
    if has_rotations:
        yield from _turned(new, old)
    if has_centres:
        yield from _ordered(new, old)
        yield from _scaled(new, old)


def exchanges(found: Poses, given: Poses) -> dict[str, str]:
    """Images whose places are those that were given for others, and these others.

    Args:
        found: their poses.
        given: poses of the same images.
    """
    if not 2 <= len(found) <= MOST:
        return {}
    apart = np.linalg.norm(found.centres[:, None] - given.centres[None], axis=2)
    everyone, other = np.arange(len(apart)), np.argmin(apart, axis=1)
    rows = np.flatnonzero((other != everyone) & (apart[everyone, other] < NEAR * np.diagonal(apart)))
    if len(rows) < 2 or sorted(other[rows].tolist()) != rows.tolist() or not _are_sharp(apart):
        return {}
    return {found.images[row]: found.images[other[row]] for row in rows.tolist()}


def words_of_exchange(exchanged: Mapping[str, str]) -> Told:
    """Which images are exchanged."""
    names = list(exchanged)
    places = [f"{name} is where {other} was given" for name, other in exchanged.items()][:SHOWN]
    more = f", ... ({len(names)} in all)" if len(names) > SHOWN else ""
    said = f"images {' and '.join(names[:SHOWN])}{more} look exchanged: {', '.join(places)}"
    return Told(said, tuple(names))


def _exchanged(exchanged: Mapping[str, str], poses: Poses) -> Poses:
    place = {name: row for row, name in enumerate(poses.images)}
    rows = [place.get(exchanged.get(name, name), row) for name, row in place.items()]
    return replace(poses, centres=poses.centres[rows], rotations=poses.rotations[rows])


def _are_sharp(apart: FloatArray) -> bool:
    """Whether places that were given are good enough to tell images by them."""
    nearest = np.sort(apart, axis=1)
    return bool(np.median(nearest[:, 0]) < NEAR * np.median(nearest[:, 1]))


def _turned(found: Poses, given: Poses) -> Iterator[Rewriting]:
    """The turn of all rotations that were given, if they share one."""
    relative = np.swapaxes(given.rotations, 1, 2) @ found.rotations
    for vector, where in TURNS:
        turn = exponential(np.array(vector))
        if (angles_of(relative @ turn.T) < ALIKE).all():
            said = f"the rotations of the given poses are turned against the measures {where}"
            yield Rewriting(Told(said), partial(_with_turn, turn))
            return
    if np.median(turns(given, found)) > OFF and (angles_of(given.rotations @ found.rotations) < ALIKE).all():
        said = "the rotations of the given poses are those from the world to the camera, not back"
        yield Rewriting(Told(said), _back)


def _with_turn(turn: FloatArray, poses: Poses) -> Poses:
    return replace(poses, rotations=poses.rotations @ turn)


def _back(poses: Poses) -> Poses:
    return replace(poses, rotations=np.swapaxes(poses.rotations, 1, 2).copy())


def _ordered(found: Poses, given: Poses) -> Iterator[Rewriting]:
    """Another order of the coordinates of all centres, or heights downwards, with which they are found."""
    axes = np.eye(3)
    changes = [
        (axes[list(order)], f"{what} of the given centres are exchanged ({here})")
        for order, what, here in ORDERS
    ]
    down = "the heights of the given centres count downwards (z goes up here)"
    for change, said in (*changes, (np.diag([1.0, 1.0, -1.0]), down)):
        if _apart(found.centres, given.centres @ change) < NEAR * _apart(found.centres, given.centres):
            yield Rewriting(Told(said), partial(_with_axes, change))


def _with_axes(change: FloatArray, poses: Poses) -> Poses:
    return replace(poses, centres=poses.centres @ change)


def _apart(found: FloatArray, given: FloatArray) -> float:
    """The farthest that centres are from those found."""
    return float(np.linalg.norm(found - given, axis=1).max())


def _scaled(found: Poses, given: Poses) -> Iterator[Rewriting]:
    """The unit that centres are in, where the control points are in another one."""
    try:
        scale, motion = similarity(given.centres, found.centres)
    except InputError:
        return
    off = motion.centre + scale * given.centres @ motion.rotation.T - found.centres
    if np.median(np.linalg.norm(off, axis=1)) > SCALE * np.linalg.norm(np.ptp(found.centres, axis=0)):
        return
    for factor, units in UNITS:
        if abs(scale / factor - 1.0) < SCALE:
            said = f"the control points are {factor:.6g} times as large as the given poses say (in {units})"
            told = Told(said, code=UNIT_OF_CONTROL.code)
            yield Rewriting(told, partial(_with_axes, factor * np.eye(3)), factor)
            return


def _off(found: Poses, given: Poses, are_observed: bool) -> str:
    """The poses that are far from those of the measures, in words; or that all are too rough."""
    if not len(found):
        return "" if are_observed else "the given poses are too rough to start from"
    angles, shifts = turns(given, found), np.linalg.norm(found.centres - given.centres, axis=1)
    is_off = (angles > OFF) | (shifts > FAR * _between(found.centres))
    rows = np.flatnonzero(is_off)
    if are_observed and not 0 < 2 * len(rows) <= len(is_off):
        return ""
    if not len(rows):
        return "the given poses are too rough to start from"
    return _listed(found, rows, shifts, angles)


def _listed(found: Poses, rows: IntArray, shifts: FloatArray, angles: FloatArray) -> str:
    parts = [
        f"{found.images[row]} (by {shifts[row]:.3g} and {np.degrees(angles[row]):.0f} degrees)"
        for row in rows[:SHOWN]
    ]
    more = f", ... ({len(rows)} of {len(found)})" if len(rows) > SHOWN else ""
    return f"given poses are not those of the measures: {', '.join(parts)}{more}"


def _between(centres: FloatArray) -> float:
    """The usual distance of an image to the nearest other one; that of rotations alone for a single image."""
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    least = apart.min(axis=1)
    return float(np.median(least[np.isfinite(least)])) if np.isfinite(least).any() else np.inf
