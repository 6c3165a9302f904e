"""Places for points from rough poses, where rays miss each other by far and may even meet behind a camera.

Such points tell nothing of where they are but that they are about as far as others; from there, damped steps
find them. To leave them out would be to throw away good measures because of poor first values.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.geometry import sums_by_owner
from obseq.images.initial.intersection import Intersection
from obseq.images.measures import ImagePoints
from obseq.images.poses import Poses

ROUGH = 10.0
"""Pixels: where half of the rays miss their points by more, the poses are rough."""
FAR = 3.0
"""Times the usual distance of an image to its points, beyond which a rough point is lost."""
HORIZON = 100.0
"""Times the usual distance at which points start that show no parallax, or less than none."""


def misfit(found: Intersection) -> float:
    """Median length of the residuals of intersected points, pixels; 0 without any."""
    norms = np.linalg.norm(found.residuals, axis=1)
    known = norms[np.isfinite(norms)]
    return float(np.median(known)) if known.size else 0.0


def usual_places(measures: ImagePoints, poses: Poses, found: Intersection) -> tuple[FloatArray, BoolArray]:
    """Points at the usual distance on their rays, and which of the points need them: lost, or far off.

    Args:
        measures: of the points that were intersected.
        poses: of their images, in their order.
        found: the intersections.

    Returns:
        (n, 3) the means of the places on the rays, and (n,) whether a point has no better one.
    """
    centres, directions = poses.centres[measures.image], found.directions
    reach = np.linalg.norm(found.coordinates[measures.point] - centres, axis=1)
    usual = _medians(reach, measures.image, len(poses))[measures.image]
    n = len(measures.point_names)
    formed = np.isfinite(directions).all(axis=1) & np.isfinite(usual)
    counts = np.bincount(measures.point[formed], minlength=n)
    places = centres[formed] + usual[formed, None] * directions[formed]
    means = sums_by_owner(places, measures.point[formed], n) / np.maximum(counts, 1)[:, None]
    far = np.zeros(n, dtype=bool)
    far[measures.point[reach > FAR * usual]] = True
    return means, (far | ~found.is_placed) & (counts > 1)


def distant_places(
    measures: ImagePoints, poses: Poses, focals: FloatArray, found: Intersection
) -> tuple[FloatArray, BoolArray]:
    """Points far away in the mean direction of their rays, and which of those that were not placed fit there.

    Their rays are parallel but for what poses and measures are off by.

    Args:
        measures: of the points that were intersected.
        poses: of their images, in their order.
        focals: (k,) focal length of each image, pixels.
        found: the intersections.

    Returns:
        (n, 3) the places, and (n,) whether a point is taken to be there.
    """
    n, point, image = len(measures.point_names), measures.point, measures.image
    formed = np.isfinite(found.directions).all(axis=1) & ~found.is_placed[point]
    if not formed.any():
        return found.coordinates, np.zeros(n, dtype=bool)
    point, image, directions = point[formed], image[formed], found.directions[formed]
    counts = np.bincount(point, minlength=n)
    middles = sums_by_owner(poses.centres[image], point, n) / np.maximum(counts, 1)[:, None]
    means = sums_by_owner(directions, point, n)
    means /= np.maximum(np.linalg.norm(means, axis=1), np.finfo(float).tiny)[:, None]
    off = focals[image] * np.linalg.norm(directions - means[point], axis=1)
    squares = np.bincount(point, off**2, n) / np.maximum(counts, 1)
    reach = np.linalg.norm(found.coordinates[measures.point] - poses.centres[measures.image], axis=1)
    known = reach[np.isfinite(reach)]
    usual = float(np.median(known) if known.size else np.ptp(poses.centres, axis=0).max())
    fits = (counts > 1) & (np.sqrt(squares) <= max(ROUGH, FAR * misfit(found))) & (usual > 0.0)
    return middles + HORIZON * usual * means, fits


def _medians(values: FloatArray, owner: np.ndarray, n: int) -> FloatArray:
    """(n,) medians of the finite values of each owner; that of all where it has none."""
    finite = np.isfinite(values)
    whole = float(np.median(values[finite])) if finite.any() else np.nan
    found, known, owner = np.full(n, whole), values[finite], owner[finite]
    known = known[np.lexsort((known, owner))]
    counts = np.bincount(owner, minlength=n)
    there, first = counts > 0, np.cumsum(counts) - counts
    low, high = first + (counts - 1) // 2, first + counts // 2
    found[there] = 0.5 * (known[low[there]] + known[high[there]])
    return found
