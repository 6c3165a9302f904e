"""A block of another program, whose frame is its own, brought into the frame of what is known of it."""

from __future__ import annotations

import functools

import numpy as np
from scipy.special import fdtrc

from obseq.arrays import FloatArray
from obseq.errors import InputError
from obseq.images.bundle import BundleAdjustment
from obseq.images.initial.growth import similarity
from obseq.images.initial.intersection import intersect
from obseq.images.measures import ImagePoints
from obseq.images.names import are_among, index_of
from obseq.images.poses import Poses

PARAMETERS = 7
"""Of a similarity: shift, rotation, scale."""
LEVEL = 1e-3
"""Chance that points of one frame look as if they were of two."""


def bring_to_control(block: BundleAdjustment) -> None:
    """Moves poses and points of a block to its control points and observed positions.

    The block moves where a similarity fits common points significantly better than their coordinates as they
    are (F test of its seven parameters), and a note says it. All that moves are first values. Where less than
    three points are common, or these are on a line, nothing moves.
    """
    pairs = [_control(block), _positions(block)]
    own, target = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    try:
        scale, motion = similarity(own, target)
    except InputError:
        return
    moved = scale * own @ motion.rotation.T + motion.centre
    before, after = (float(np.sum((points - target) ** 2)) for points in (own, moved))
    freedom = target.size - PARAMETERS
    ratio = (before - after) / PARAMETERS / max(after / freedom, np.finfo(float).tiny)
    if not fdtrc(PARAMETERS, freedom, max(ratio, 0.0)) < LEVEL:
        return
    others = list(block.approximations)
    if others:
        points = np.array([block.approximations[name] for name in others])
        block.add_approximations(others, scale * points @ motion.rotation.T + motion.centre)
    poses = block.poses
    centres = scale * poses.centres @ motion.rotation.T + motion.centre
    block.poses = Poses.of(poses.images, centres, motion.rotation @ poses.rotations, cameras=poses.cameras)
    spread = np.sqrt(after / len(own))
    counts = zip(pairs, ("control points", "observed positions"), strict=True)
    said = " and ".join(f"{len(pair[0])} {what}" for pair, what in counts if len(pair[0]))
    block.notes.append(
        f"{len(poses)} poses and {len(others)} points are moved to the control points, which are in another "
        f"frame: scale {scale:.6g}; {said} are common, {spread:.3g} apart then (rms)"
    )


def _control(block: BundleAdjustment) -> tuple[FloatArray, FloatArray]:
    """(n, 3) places of control points in the frame of the block, and (n, 3) as they are known."""
    known = np.flatnonzero(np.isfinite(block.control.sigmas).all(axis=1))
    names = [block.control.names[row] for row in known.tolist()]
    places = block.approximations.of(names)
    unplaced = np.flatnonzero(np.isnan(places).any(axis=1)).tolist()
    if unplaced:
        places[unplaced] = _by_rays(block, [names[row] for row in unplaced])
    there = np.isfinite(places).all(axis=1)
    return places[there], block.control.coordinates[known][there]


def _by_rays(block: BundleAdjustment, names: list[str]) -> FloatArray:
    """(n, 3) where the rays of points meet at the poses of the block; NaN for those without two rays."""
    found = np.full((len(names), 3), np.nan)
    parts = [part.measures.of_points(names) for part in block.sets]
    rays = functools.reduce(ImagePoints.joined, parts, ImagePoints.of([], [], np.zeros((0, 2)), 1.0))
    rays = rays.rows(are_among(rays.image_names, block.poses.images)[rays.image]) if len(rays) else rays
    if not len(rays):
        return found
    poses = block.poses.select(rays.image_names)
    met = intersect(rays, poses, [block.cameras[block.camera_of[image]] for image in poses.images])
    rows = index_of(names, met.names, "control point")
    found[rows[met.is_placed]] = met.coordinates[met.is_placed]
    return found


def _positions(block: BundleAdjustment) -> tuple[FloatArray, FloatArray]:
    """(n, 3) centres in the frame of the block, and (n, 3) as they are observed, lever arms left aside."""
    own, target = [np.zeros((0, 3))], [np.zeros((0, 3))]
    parts = [(one.images, one.positions, one.sigmas) for one in block.antennas]
    parts += [(part.poses.images, part.poses.centres, part.centre_sigmas) for part in block.pose_observations]
    for images, places, sigmas in parts:
        kept = are_among(images, block.poses.images) & np.isfinite(sigmas).all(axis=1)
        names = [image for image, keep in zip(images, kept.tolist(), strict=True) if keep]
        own.append(block.poses.select(names).centres)
        target.append(places[kept])
    return np.concatenate(own), np.concatenate(target)
