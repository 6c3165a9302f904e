"""A block of another program, whose frame is its own, brought into the frame of control points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from obseq.errors import InputError
from obseq.images.initial.growth import similarity
from obseq.images.poses import Poses

if TYPE_CHECKING:
    from obseq.images.bundle import BundleAdjustment

PARAMETERS = 7
"""Of a similarity: shift, rotation, scale."""
LEVEL = 1e-3
"""Chance that points of one frame look as if they were of two."""


def bring_to_control(block: BundleAdjustment) -> None:
    """Moves poses and points of a block to its control points, where both have points in common.

    The block moves where a similarity fits common points significantly better than their coordinates as they
    are (F test of its seven parameters), and a note says it. All that moves are first values. Where less than
    three points are common, or these are on a line, nothing moves.
    """
    names = block.control.names
    known = np.flatnonzero(np.isfinite(block.control.sigmas).all(axis=1)).tolist()
    rows = [row for row in known if names[row] in block.approximations]
    own = np.array([block.approximations[names[row]] for row in rows]).reshape(-1, 3)
    target = block.control.coordinates[rows]
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
    points = np.array([block.approximations[name] for name in others])
    block.add_approximations(others, scale * points @ motion.rotation.T + motion.centre)
    poses = block.poses
    centres = scale * poses.centres @ motion.rotation.T + motion.centre
    block.poses = Poses.of(poses.images, centres, motion.rotation @ poses.rotations, cameras=poses.cameras)
    spread = np.sqrt(after / len(rows))
    block.notes.append(
        f"{len(poses)} poses and {len(others)} points are moved to the control points, which are in another "
        f"frame: scale {scale:.6g}; {len(rows)} points are common, {spread:.3g} apart then (rms)"
    )
