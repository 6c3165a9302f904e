"""Points that are so far that their rays do not tell how far: only where they are seen is determined."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.geometry import sums_by_owner

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.images.adjustment.start import Start

SIGMAS = 3.0
"""Standard deviations of an inverse distance within which it may be zero."""


def viewpoints(start: Start, centres: FloatArray) -> FloatArray:
    """(n, 3) the middle of the places (k, 3) from where the points of a block are seen."""
    image, point = rays_of(start)
    counts = np.maximum(np.bincount(point, minlength=len(start.points)), 1)
    return np.asarray(sums_by_owner(centres[image], point, len(start.points)) / counts[:, None])


def rays_of(start: Start) -> tuple[IntArray, IntArray]:
    """(m,) images and (m,) points of the measures that take part at first."""
    images = [part.image[part.rows] for part in start.sets]
    points = [part.point[part.rows] for part in start.sets]
    return np.concatenate(images), np.concatenate(points)


def are_far(start: Start, centres: FloatArray, coordinates: FloatArray, covariances: FloatArray) -> BoolArray:
    """(n,) points of which infinity is within the precision of their distance, known points aside.

    The inverse of a distance has the relative standard deviation of the distance.

    Args:
        start: of the block.
        centres: (k, 3) adjusted.
        coordinates: (n, 3) adjusted.
        covariances: (n, 3, 3) of these.
    """
    arms = coordinates - viewpoints(start, centres)
    squares = np.einsum("ij,ij->i", arms, arms)
    along = np.einsum("ij,ijk,ik->i", arms, covariances, arms)
    return np.asarray(start.is_free.all(axis=1) & (SIGMAS**2 * along > squares**2))
