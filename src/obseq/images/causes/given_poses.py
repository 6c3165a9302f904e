"""Poses that are given, or observed, and are not those of the measures: images exchanged, turned, or far off.

The block is adjusted with poses from its measures and control points alone. Where it fits then, these are
compared with the ones that were given.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.causes.comparison import common
from obseq.images.causes.pose_rewritings import (
    MOST,
    Rewriting,
    compared,
    exchanges,
    rewritings_of,
    without_rotations,
)
from obseq.images.causes.shared import SharedCause, Subject, Told, Trial
from obseq.images.causes.unit_of_control import with_control_divided

LEAST, WORST, PAIR = 4, 3, 2
"""Images of a block in which two may be exchanged; the worst that are tried; how many are exchanged."""


def _trials(subject: Subject) -> Iterator[Trial]:
    """The block with exchanged images put right; with poses from its measures alone.

    What is observed takes no part in these only to see what is wrong with it. It is put right then, and takes
    part: a mistake is judged by all observations.
    """
    yield from _exchanged(subject)
    block = subject.block
    is_observed = bool(block.pose_observations or block.antennas)
    if not (len(subject.given) or is_observed) or len(block.camera_of) > MOST:
        return
    made = _without_poses(block)
    alone = Trial(
        "poses from the measures alone", made, lambda found: compared(found.poses, subject.given, False)
    )
    if is_observed:
        made.pose_observations, made.antennas = [], []
        alone = replace(alone, then=partial(_put_right, subject))
    yield alone


def _without_poses(block: AdjustableBlock) -> AdjustableBlock:
    made = block.copied()
    made.poses = made.poses.select([])
    return made


def _put_right(subject: Subject, alone: BundleSolution) -> Iterator[Trial]:
    """The block with what is wrong with observed, or given, poses put right, as measures alone tell it."""
    block, found = subject.block, alone.poses
    antennas = [without_rotations(one.images, one.positions, one.sigmas) for one in block.antennas]
    observed = [*block.pose_observations, *antennas]
    rewritings = [right for part in observed for right in rewritings_of(found, part)]
    for right in {right.told.said: right for right in rewritings}.values():
        for made in _rewritten(block, right):
            yield Trial.saying(right.told.said, right.told, made)
    if len(subject.given) and (told := compared(found, subject.given, True)).said:
        yield Trial.saying("poses from the measures", told, _without_poses(block))


def _exchanged(subject: Subject) -> Iterator[Trial]:
    """Names that are exchanged in the measures: each image has the camera of another then.

    Those that ended where the other was given are tried, and the images that fit worst.
    """
    if subject.solution is None or len(subject.given) < LEAST or len(subject.block.camera_of) > MOST:
        return
    found = tuple(exchanges(*common(subject.solution.poses, subject.given)))
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
        yield Trial(said, made, partial(_of_pair, subject, Told(said, (first, second))))


def _of_pair(subject: Subject, told: Told, found: BundleSolution) -> Told:
    """What is told of two exchanged images; nothing where images are not where they were given still."""
    return Told("") if compared(found.poses, subject.given, True).said else told


def _rewritten(block: AdjustableBlock, right: Rewriting) -> Iterator[AdjustableBlock]:
    """The block with observed poses put right; where units differ, with either of the two put right.

    Sigmas may be in the unit of their own coordinates, or in that of the others.
    """
    made = _without_poses(block)
    made.pose_observations = [
        replace(part, poses=right.change(part.poses)) for part in block.pose_observations
    ]
    for k, one in enumerate(block.antennas):
        as_poses = without_rotations(one.images, one.positions, one.sigmas).poses
        made.antennas[k] = replace(one, positions=right.change(as_poses).centres)
    yield made
    for sigmas in (1.0, right.scale) if right.scale != 1.0 else ():
        yield with_control_divided(_without_poses(block), 1.0 / right.scale, sigmas)


GIVEN_POSES = SharedCause(
    "I140",
    "given poses",
    "Poses were given, or observed, for other images, or in another convention.",
    "Two images exchanged in a list, rotations from the world to the camera, kappa of turned images.",
    "Correct the names or the angles in the list of poses, or leave the poses out.",
    4.0,
    _trials,
)
