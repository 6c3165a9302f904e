"""Where a block starts when the poses that were given are left aside.

From measures and control points; or from measures alone, in the frame that most control points agree with.
"""

from __future__ import annotations

import functools
import itertools

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.errors import InputError, ObseqError
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.start import Start, start_of
from obseq.images.control import ControlPoints
from obseq.images.initial.growth import place_images, place_the_last, similarity
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses


def without_poses(block: AdjustableBlock) -> AdjustableBlock:
    """The block with poses from its measures and control points alone.

    Raises:
        InputError: images cannot be placed.
    """
    made = block.copied()
    made.poses = made.poses.select([])
    made.initialise(causes=False)
    return made


def start_from_measures(block: AdjustableBlock) -> Start | None:
    """The start of a block without the poses that were given; None where its images cannot be placed."""
    try:
        return start_of(without_poses(block))
    except ObseqError:
        return None


FAR = 0.06
"""Share of their extent by which a similarity may miss control points: a block without them is bent."""
LEAST, TRIPLES = 4, 150
"""Control points that agree, at least; triples of them that are tried."""


def start_from_images(block: AdjustableBlock) -> Start | None:
    """The start of a block that its images make alone, in the frame of most control points; None for none."""
    try:
        return start_of(placed_by_images(block))
    except ObseqError:
        return None


def placed_by_images(block: AdjustableBlock) -> AdjustableBlock:
    """The block with poses from its measures alone, in the frame of most control points.

    Raises:
        InputError: its images do not make a block, or too few control points agree with it.
    """
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in block.sets))
    cameras = {image: block.cameras[name] for image, name in block.camera_of.items()}
    nothing = ControlPoints.of([], np.zeros((0, 3)))
    growth = place_images(measures, nothing, cameras, Poses.of([], [], []))
    place_the_last(growth, nothing)
    if growth.waiting():
        raise InputError(f"{len(growth.waiting())} images cannot be placed by images alone")
    met, known = growth.points(np.inf), set(block.control.names)
    points = met.select([name for name in met.names if name in known])
    given = block.control.select(points.names).coordinates
    agree = _agreeing(points.coordinates, given)
    if agree.sum() < LEAST:
        raise InputError("too few control points agree with what the images make of them")
    growth.transform(*similarity(points.coordinates[agree], given[agree]))
    made = block.copied()
    made.poses = growth.as_poses()
    return made


def _agreeing(points: FloatArray, given: FloatArray) -> BoolArray:
    """(n,) control points that the similarity brings home that brings home most."""
    middle = np.median(given, axis=0)
    far = FAR * float(np.median(np.linalg.norm(given - middle, axis=1)))
    best = np.zeros(len(points), dtype=bool)
    chosen = [list(rows) for rows in itertools.combinations(range(len(points)), 3)]
    for rows in chosen[:: max(1, len(chosen) // TRIPLES)]:
        try:
            scale, motion = similarity(points[rows], given[rows])
        except InputError:
            continue
        moved = motion.centre + scale * points @ motion.rotation.T
        near = np.linalg.norm(moved - given, axis=1) < far
        best = near if near.sum() > best.sum() else best
    return best
