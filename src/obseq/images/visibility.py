"""Which points are where the projection of their camera is defined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.images.camera import Camera
    from obseq.images.poses import Poses


def are_in_front(
    cameras: Sequence[Camera], poses: Poses, image: IntArray, coordinates: FloatArray, point: IntArray
) -> BoolArray:
    """(n,) whether points are where the projection of their camera is defined.

    Args:
        cameras: camera of each image.
        poses: of the images.
        image: (n,) image of each measure.
        coordinates: (k, 3) of the points, in the world.
        point: (n,) point of each measure.
    """
    axes = poses.rotations[:, :, 2]
    depths = np.negative(np.einsum("ki,ki->k", poses.centres, axes)).take(image)
    for k in range(3):
        depths += coordinates[:, k].take(point) * axes[:, k].take(image)
    seen = depths > 0.0
    for row in np.flatnonzero(~seen):  # in front, every projection is defined; behind, some are
        local = (coordinates[point[row]] - poses.centres[image[row]]) @ poses.rotations[image[row]]
        seen[row] = cameras[image[row]].is_in_front(local[None])[0]
    return np.asarray(seen)
