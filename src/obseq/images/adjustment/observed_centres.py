"""Images whose centres are observed start there, where they are given worse."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.images.block import Block
from obseq.images.names import index_of
from obseq.images.poses import Poses

FAR_OFF = 10.0
"""Sigmas by which a given centre may be off an observed one; it starts at the observation otherwise."""


def at_observed_centres(block: Block, poses: Poses) -> Poses:
    """The poses, with the centres that are observed much better than they are given; the same without any."""
    centres, moved = poses.centres.copy(), False
    for images, observed, sigmas in _observed_centres(block, poses):
        rows = index_of(poses.images, images, "observed poses: image")
        far = (np.abs(observed - centres[rows]) > FAR_OFF * sigmas).any(axis=1)
        far &= np.isfinite(sigmas).all(axis=1)
        centres[rows[far]], moved = observed[far], moved or bool(far.any())
    return poses if not moved else Poses(poses.images, centres, poses.rotations, poses.cameras)


def _observed_centres(block: Block, poses: Poses) -> Iterator[tuple[Sequence[str], FloatArray, FloatArray]]:
    """Images, their observed centres and the sigmas of these; none of an antenna whose place is unknown."""
    for part in block.pose_observations:
        yield part.poses.images, part.poses.centres, part.centre_sigmas
    for antenna in (one.of(poses.images) for one in block.antennas):
        if np.isfinite(antenna.lever_sigmas).all():
            turns = poses.select(antenna.images).rotations
            yield antenna.images, antenna.centres(turns), np.hypot(antenna.sigmas, antenna.lever_sigmas.max())
