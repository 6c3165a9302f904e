"""Known points that are much farther apart, or nearer, than a network of total stations places them.

A map of another system does that: a web map is 1.6 times too large at 50 degrees. The observations then tear
the network between the known points, and single ones of them would be blamed. So it is placed from one known
point alone, turned anyhow, and what it makes of the distances between known points is compared.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.errors import ObseqError
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.screening.distances import distances_of
from obseq.survey.screening.findings import Cause, GrossError
from obseq.survey.screening.offset_effects import zenith_angles
from obseq.survey.screening.robust import QUICK
from obseq.survey.screening.trials import estimated
from obseq.survey.screening.values import FEET

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.adjustment.point_system import PointSystem
    from obseq.survey.model import Points
    from obseq.survey.screening.robust import Estimate
    from obseq.survey.screening.trials import Trials

_SCALES = 1.08, 5.0
"""How many times too far apart, or too near, known points are in a wrong system."""
_FIT = 0.02
"""Differences of these ratios, of all pairs of known points, over their mean."""
_LEAST = 0.005
"""Precision (m) of points that the network rests on here, and least distance of known points."""
_MOST = 12
"""Known points that are compared."""


def known_scale_cause(trials: Trials, system: PointSystem) -> GrossError | None:
    """A wrong coordinate system of known points that are all too far apart, or too near, by one factor."""
    found = trials.found
    known = np.flatnonzero(~found.points.is_free[:, :2].any(axis=1))
    if system.system.kind is crs.Kind.LOCAL or len(known) < 2:
        return None
    points = _resting_on_one(found, known)
    ratio = None if points is None else _ratio(trials, points, known[:_MOST])
    if points is None or ratio is None:
        return None
    alone = estimated(trials.model, points, found.book, QUICK)
    agrees = alone is not None and (not alone.suspects.size or trials.explains(alone))
    return _described(found, system, known, ratio) if agrees else None


def _ratio(trials: Trials, points: Points, known: IntArray) -> float | None:
    """How many times too far apart known points are, the same for all, and no unit of length."""
    given = trials.found.points.coordinates[known, :2]
    try:
        placed = trials.model.initial(points, trials.found.book).coordinates[known, :2]
    except ObseqError:
        return None
    ratios = _apart(given) / np.maximum(_apart(placed), _LEAST)
    ratio = float(np.median(ratios))
    is_one = np.isfinite(ratios).all() and np.ptp(ratios) <= _FIT * ratio
    larger = max(ratio, 1.0 / ratio) if ratio > 0.0 else 0.0
    is_unit = abs(larger * FEET - 1.0) <= _FIT
    return ratio if is_one and not is_unit and _SCALES[0] <= larger <= _SCALES[1] else None


def _resting_on_one(found: Estimate, known: IntArray) -> Points | None:
    """The points with one that is known, and another north of it at a distance that was measured to it."""
    observations, distances = found.book.observations, distances_of(found.book)
    seen = distances[np.isin(observations.from_points[distances], known)]
    if not len(seen):
        return None
    row = int(seen[0])
    ends = int(observations.from_points[row]), int(observations.to_points[row])
    return _resting_on(found.points, *ends, *_flat_and_rise(found, row))


def _resting_on(points: Points, start: int, end: int, flat: float, rise: float) -> Points:
    """The points, all unknown but one, and another that lies north of it."""
    coordinates, sigmas = points.coordinates.copy(), points.sigmas.copy()
    here = coordinates[start].copy()
    coordinates[:] = sigmas[:] = np.nan
    coordinates[start], coordinates[end] = here, here + np.array([0.0, flat, rise])
    sigmas[[start, end]] = _LEAST
    return replace(points, coordinates=coordinates, sigmas=sigmas, covariance=None)


def _flat_and_rise(found: Estimate, row: int) -> tuple[float, float]:
    """Of the sight of a distance, by the zenith angle to the same target; level where there is none."""
    observations = found.book.observations
    value = float(observations.values[row])
    height = float(observations.from_heights[row] - observations.to_heights[row])
    same = observations.active & np.isin(observations.types, zenith_angles())
    for ends in (observations.from_points, observations.to_points):
        same &= ends == ends[row]
    zenith = float(observations.values[same][0]) if same.any() else 0.5 * math.pi
    if BY_CODE[int(observations.types[row])].horizontal is None:
        return value, value / math.tan(zenith) + height
    return value * math.sin(zenith), value * math.cos(zenith) + height


def _apart(places: FloatArray) -> FloatArray:
    """Distances between all pairs of places (k, 2)."""
    first, second = np.triu_indices(len(places), 1)
    return np.asarray(np.hypot(*(places[first] - places[second]).T))


def _described(found: Estimate, system: PointSystem, known: IntArray, ratio: float) -> GrossError:
    names = tuple(found.points.names[row] for row in known.tolist())
    what = f"{'both' if len(known) == 2 else f'all {len(known)}'} known points together"
    one = "; or the coordinates of one of them" if len(known) == 2 else ""
    text = (
        f"they are {ratio:.3g} times as far apart as the observations place them: likely the coordinate "
        f"system of the points ({system.system.definition}) is wrong: correct --points-crs{one}"
    )
    rows, size = tuple(found.suspects.tolist()), float(found.ratios.max())
    return GrossError(what, Cause.COORDINATE_SYSTEM, text, size, rows, names)
