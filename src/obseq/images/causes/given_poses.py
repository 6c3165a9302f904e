"""Poses that are given, or observed, and are not those of the measures: images exchanged, turned, or far off.

The block is adjusted with poses from its measures and control points alone. Where it fits then, these are
compared with the ones that were given.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.geometry import exponential
from obseq.images.causes.comparison import angles_of, common, turns
from obseq.images.causes.shared import SharedCause, Told, Trial
from obseq.images.causes.unit_of_control import UNIT_OF_CONTROL
from obseq.images.initial.growth import similarity
from obseq.images.initial.units import UNITS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.images.causes.shared import Subject
    from obseq.images.poses import Poses

LEAST, WORST, PAIR = 4, 3, 2
"""Images of a block in which two may be exchanged; the worst that are tried; how many are exchanged."""
NEAR = 0.3
"""Share of the way to its own place within which an image is at that of another."""
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


def _trials(subject: Subject) -> Iterator[Trial]:
    """The block with exchanged images put right; with poses from its measures alone."""
    yield from _exchanged(subject)
    observed = [part.poses for part in subject.block.pose_observations]
    if not (len(subject.given) or observed) or len(subject.block.camera_of) > MOST:
        return
    made = subject.block.copied()
    made.poses, made.pose_observations = made.poses.select([]), []
    yield Trial(
        "poses from the measures alone",
        made,
        lambda found: next(
            filter(
                lambda told: told.said,
                (compared(found.poses, poses, bool(observed)) for poses in (subject.given, *observed)),
            ),
            Told(""),
        ),
    )


def _exchanged(subject: Subject) -> Iterator[Trial]:
    """Names that are exchanged in the measures: each image has the camera of another then.

    Those that ended where the other was given are tried, and the images that fit worst.
    """
    if subject.solution is None or len(subject.given) < LEAST or len(subject.block.camera_of) > MOST:
        return
    found = exchanged_images(*common(subject.solution.poses, subject.given)).images
    rms = subject.solution.by_image().rms
    worst = [subject.solution.poses.images[row] for row in np.argsort(-rms)[:WORST]]
    pairs = dict.fromkeys([*([found] if len(found) == PAIR else []), *itertools.combinations(worst, PAIR)])
    for first, second in pairs:
        other = {first: second, second: first}
        made, sets = subject.block.copied(), []
        made.poses = subject.given
        for part in made.sets:
            names = tuple(other.get(name, name) for name in part.measures.image_names)
            sets.append(replace(part, measures=replace(part.measures, image_names=names)))
        made.sets = sets
        said = f"images {first} and {second} are exchanged in the measures"
        yield Trial(said, made, partial(_telling, told=Told(said, (first, second))))


def _telling(found: BundleSolution, told: Told) -> Told:
    return told


def compared(found: Poses, given: Poses, are_observed: bool) -> Told:
    """What is wrong with given poses of images that are found at others."""
    new, old = common(found, given)
    if (told := exchanged_images(new, old)).said:
        return told
    if said := _turned(new, old):
        return Told(said)
    if said := _scaled(new, old):
        return Told(said, code=UNIT_OF_CONTROL.code)
    return Told(_off(new, old, are_observed))


def exchanged_images(found: Poses, given: Poses) -> Told:
    """Images whose places are those that were given for others.

    Args:
        found: their poses.
        given: poses of the same images.
    """
    if not 2 <= len(found) <= MOST:
        return Told("")
    apart = np.linalg.norm(found.centres[:, None] - given.centres[None], axis=2)
    everyone, other = np.arange(len(apart)), np.argmin(apart, axis=1)
    rows = np.flatnonzero((other != everyone) & (apart[everyone, other] < NEAR * np.diagonal(apart)))
    if len(rows) < 2 or sorted(other[rows].tolist()) != rows.tolist() or not _are_sharp(apart):
        return Told("")
    names = [found.images[row] for row in rows]
    places = [f"{found.images[row]} is where {found.images[other[row]]} was given" for row in rows[:SHOWN]]
    more = f", ... ({len(rows)} in all)" if len(rows) > SHOWN else ""
    said = f"images {' and '.join(names[:SHOWN])}{more} look exchanged: {', '.join(places)}"
    return Told(said, tuple(names))


def _are_sharp(apart: FloatArray) -> bool:
    """Whether places that were given are good enough to tell images by them."""
    nearest = np.sort(apart, axis=1)
    return bool(np.median(nearest[:, 0]) < NEAR * np.median(nearest[:, 1]))


def _turned(found: Poses, given: Poses) -> str:
    """The turn of all rotations that were given, in words; empty where they do not share one."""
    relative = np.swapaxes(given.rotations, 1, 2) @ found.rotations
    for vector, said in TURNS:
        if (angles_of(relative @ exponential(np.array(vector)).T) < ALIKE).all():
            return f"the rotations of the given poses are turned against the measures {said}"
    if np.median(turns(given, found)) > OFF and (angles_of(given.rotations @ found.rotations) < ALIKE).all():
        return "the rotations of the given poses are those from the world to the camera, not back"
    return ""


def _scaled(found: Poses, given: Poses) -> str:
    """The unit that centres are in, where the control points are in another one, in words."""
    try:
        scale, motion = similarity(given.centres, found.centres)
    except InputError:
        return ""
    off = motion.centre + scale * given.centres @ motion.rotation.T - found.centres
    if np.median(np.linalg.norm(off, axis=1)) > SCALE * np.linalg.norm(np.ptp(found.centres, axis=0)):
        return ""
    for factor, units in UNITS:
        if abs(scale / factor - 1.0) < SCALE:
            return f"the control points are {factor:.6g} times as large as the given poses say (in {units})"
    return ""


def _off(found: Poses, given: Poses, are_observed: bool) -> str:
    """The poses that are far from those of the measures, in words; or that all are too rough."""
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


GIVEN_POSES = SharedCause(
    "I140",
    "given poses",
    "Poses were given, or observed, for other images, or in another convention.",
    "Two images exchanged in a list, rotations from the world to the camera, kappa of turned images.",
    "Correct the names or the angles in the list of poses, or leave the poses out.",
    4.0,
    _trials,
)
