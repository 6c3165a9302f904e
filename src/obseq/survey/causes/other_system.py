"""Known points of another zone or system: observations place them turned, or larger."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.diagnosis.policy import POLICY
from obseq.errors import ObseqError
from obseq.geometry import closest_rotation
from obseq.survey.causes.cause import Rewritten
from obseq.survey.causes.notes import Notes
from obseq.survey.model import Points

_LEAST = 4
"""Known points from which they can be said to be wrong together."""
_SCALES = 0.5, 2.0
"""Of one map in another: Mercator's at 60 degrees is 2."""


def other_system(notes: Notes, known: IntArray) -> Iterator[Rewritten]:
    """The network on one known point, or on two neighbours: all others are where it places them.

    One is enough where there are vectors, which say how the network lies.

    Args:
        notes: The network.
        known: Its known points.
    """
    points = notes.points
    has_plan = ~points.is_free[known, :2].any(axis=1)
    known = known[has_plan & np.isfinite(points.coordinates[known]).all(axis=1)]
    if len(known) < _LEAST:
        return
    for count in (1, 2) if notes.is_vector.any() else (2,):
        what = f"coordinates of all {len(known)} known points"
        alone = _on_few(points, known, count)
        none = np.zeros(0, np.int64)

        def told(places: FloatArray) -> str | None:
            return _change(points.coordinates[known], places[known])

        yield Rewritten("S213", "", what, "another zone or system: ", none, known, alone, notes.book, told)


def _on_few(points: Points, known: IntArray, count: int) -> Points:
    """The points with all known ones but a few neighbours unknown."""
    places = points.coordinates[known]
    first = int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
    nearest = np.argsort(np.linalg.norm(places - places[first], axis=1), kind="stable")[:count]
    others = np.delete(known, nearest)
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    coordinates[others] = sigmas[others] = np.nan
    return replace(points, coordinates=coordinates, sigmas=sigmas, covariance=None)


def _change(given: FloatArray, found: FloatArray) -> str | None:
    """How known points (k, 3) are turned and scaled to where they are found; None where they are not."""
    is_there = np.isfinite(found).all(axis=1)
    if np.count_nonzero(is_there) < _LEAST:
        return None
    before, after = (one[is_there] - one[is_there].mean(axis=0) for one in (given, found))
    try:
        rotation = closest_rotation(after.T @ before)
    except ObseqError:
        return None
    turned = before @ rotation.T
    scale = float(np.sum(after * turned) / np.sum(before**2))
    is_alike = np.linalg.norm(after - scale * turned) <= POLICY.share * np.linalg.norm(after - before)
    if not is_alike or not _SCALES[0] < scale < _SCALES[1]:  # one point far off hides how the others lie
        return None
    turn = math.acos(min(max((float(np.trace(rotation)) - 1.0) / 2.0, -1.0), 1.0))
    return (
        f"what is observed agrees with itself, and places them turned by {math.degrees(turn):.4g} degrees "
        f"and {1e6 * (scale - 1.0):+z.0f} ppm larger"
    )
