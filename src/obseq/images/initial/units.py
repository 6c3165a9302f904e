"""Control points in another unit than poses, observed centres or lengths: by how much, and its name."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.images.block import Block
from obseq.images.initial.growth import similarity
from obseq.images.initial.intersection import intersect
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

UNITS = (
    (1000.0, "millimetres, and the rest in metres"),
    (100.0, "centimetres, and the rest in metres"),
    (1.0 / 0.3048, "feet, and the rest in metres"),
    (0.3048, "metres, and the rest in feet"),
    (0.001, "kilometres, and the rest in metres, or metres, and the rest in millimetres"),
)
"""How many times as large coordinates are, and the units that may be."""
SAME, TIMES, KNOWN = 0.03, 3.0, 0.1
"""Share of itself by which a scale may be off a unit, or times its precision; the poorest of these."""


def unit_of_control(block: Block, poses: Poses) -> tuple[float, str] | None:
    """How many times as large the control points are as the rest of a block says, with the units of that.

    Args:
        block: with measures.
        poses: as they were given, not found from control points.
    """
    for scale, spread in _scales(block, poses):
        if abs(math.log(scale)) < TIMES * spread + SAME:
            continue
        for factor, units in UNITS:
            if abs(math.log(scale / factor)) < max(SAME, TIMES * spread):
                return factor, f"their coordinates in {units}"
    return None


def _scales(block: Block, poses: Poses) -> Iterator[tuple[float, float]]:
    """Scales of the control points, and their relative precision: by lengths, by rays from poses."""
    control, lengths = block.control, block.lengths
    place = dict(zip(control.names, control.coordinates, strict=True))
    ends = zip(lengths.first, lengths.second, lengths.values, strict=True)
    ratios = [
        float(np.linalg.norm(place[a] - place[b])) / length for a, b, length in ends if {a, b} <= place.keys()
    ]
    if ratios and max(ratios) < (1.0 + SAME) * min(ratios):
        yield float(np.median(ratios)), 0.0
    turned = (part.poses for part in block.pose_observations if part.rotation_sigma is not None)
    for given in (poses, *turned):
        yield from _by_rays(block, given)


def _by_rays(block: Block, poses: Poses) -> Iterator[tuple[float, float]]:
    """The scale of the control points to where their rays meet, if a similarity takes these to them."""
    measures = functools.reduce(ImagePoints.joined, (part.measures for part in block.sets))
    rays = measures.of_points(block.control.names)
    known = np.array([image in poses for image in rays.image_names], dtype=bool)
    if not known.any():
        return
    rays = rays.rows(known[rays.image])
    at = poses.select(rays.image_names)
    met = intersect(rays, at, [block.cameras[block.camera_of[image]] for image in at.images])
    given = block.control.select(met.names).coordinates
    scale = _similar(met.coordinates[met.is_placed], given[met.is_placed])
    if scale is not None:
        yield scale


def _similar(source: FloatArray, target: FloatArray) -> tuple[float, float] | None:
    """The scale of the similarity between points, four or more, and its relative precision.

    None where it is not known to a tenth: they are not similar at all.
    """
    if len(source) < 4:
        return None
    try:
        scale, motion = similarity(source, target)
    except InputError:
        return None
    off = motion.centre + scale * source @ motion.rotation.T - target
    size = float(np.linalg.norm(target - target.mean(axis=0)))
    spread = float(np.linalg.norm(off)) / size / math.sqrt(3 * len(source) - 7)
    return (scale, spread) if spread < KNOWN else None
