"""Known heights that GNSS vectors contradict together, along a slope: they are heights above the geoid.

Vectors give differences of heights above the ellipsoid. Those of levelled heights differ from them by the
slope of the geoid, some millimetres to a decimetre in a kilometre; and tens of metres of height change
lengths on the ground by some ppm: the plan is contradicted too. No single height is wrong, and no vector;
without all known heights the adjustment is accepted, and what these are off by lies on a plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.statistics.distributions import chi_square_tails
from obseq.printable import listed
from obseq.survey.screening.contradictions import independent, known_rows
from obseq.survey.screening.findings import Cause, GrossError

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.report.units import Units
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.screening.contradictions import Contradiction

_NAMED = 6
"""Known points that are listed."""
_LEAST, _PLANE = 2, 3
"""Known heights that may be wrong together, and those that define a plane."""
_LEVEL = 1e-4
"""Of the test of all heights together."""
_BETTER = 16.0
"""Weighted squares by which all heights must be better than one gross error."""
_SLOPES = 2e-6, 2e-4
"""Slopes of geoids; steeper ones are slips of heights."""
_SHARE, _WAVES = 0.3, 0.02
"""What a plane may leave of the heights, as a share and in metres: geoids are not planes."""
_UNSEEN = 1e-11
"""Share of the weight of a height below which it is rounding: what is common to all hardly shows."""
_LOWEST, _HIGHEST = 5.0, 150.0
"""Geoid heights (m) from which they show without a slope, and beyond which there are none."""


def heights_cause(found: Contradiction, units: Units) -> tuple[GrossError, ...]:
    """The known heights together, where a slope of theirs explains what vectors contradict; none else.

    Args:
        found: what contradicts.
        units: in which values are told.
    """
    adjustment, known = found.adjustment, found.adjustment.known
    mine = np.flatnonzero(known.components == 2)
    if len(mine) < _LEAST:
        return ()
    statistic, degrees, off = _tested(found, mine)
    if degrees < _LEAST or statistic < found.suspected + _BETTER:
        return ()
    if chi_square_tails(statistic, degrees)[1] > _LEVEL or not found.is_explained(statistic, degrees):
        return ()
    slope, left = _plane(adjustment.points.coordinates[known.points[mine]], off)
    spread = float(np.std(off))
    height = abs(float(off.mean()))
    shows = height > _LOWEST or (slope >= _SLOPES[0] and len(mine) >= _PLANE)
    if (
        not shows
        or height > _HIGHEST
        or slope > _SLOPES[1]
        or left > max(_SHARE * spread, min(_WAVES, 0.5 * spread))
    ):
        return ()
    return (_described(adjustment, mine, slope, off, statistic, units),)


def _tested(found: Contradiction, mine: IntArray) -> tuple[float, int, FloatArray]:
    """The test of known heights as one, its degrees of freedom, and what they are off by (m)."""
    if not np.isin(mine, independent(found)).all():
        return 0.0, 0, np.zeros(len(mine))
    normalised, rows = known_rows(found, mine)
    weight = np.eye(len(mine)) - rows @ found.state.solve(np.ascontiguousarray(rows.T))
    shares, axes = np.linalg.eigh(weight)
    kept = shares > _UNSEEN
    along = axes[:, kept].T @ normalised
    off = -found.adjustment.known.sigmas[mine] * (axes[:, kept] @ (along / shares[kept]))
    return float(np.sum(along**2 / shares[kept])), int(kept.sum()), off


def _plane(places: FloatArray, off: FloatArray) -> tuple[float, float]:
    """Slope of the plane through heights (n,) at places (n, 3), and what it leaves (root mean square, m)."""
    design = np.column_stack([np.ones(len(off)), places[:, :2] - places[:, :2].mean(axis=0)])
    found, _, rank, _ = np.linalg.lstsq(design, off, rcond=1e-9)
    slope = float(np.hypot(found[1], found[2])) if rank else 0.0
    return slope, float(np.sqrt(np.mean((off - design @ found) ** 2)))


def _described(
    adjustment: Adjustment, mine: IntArray, slope: float, off: FloatArray, statistic: float, units: Units
) -> GrossError:
    points = adjustment.points.points
    names = tuple(points.names[row] for row in adjustment.known.points[mine].tolist())
    text = (
        "without them the adjustment is accepted; against the heights that the vectors give they change by "
        f"{units.length.text(float(np.ptp(off)))}, along a slope of {1e6 * slope:.3g} mm/km"
        f"{_common(off, units)}: likely they are heights above "
        "the geoid (levelled), and vectors need heights above the ellipsoid: add the geoid heights, or name "
        "the vertical system in --points-crs (which needs its geoid grid)"
    )
    if len(names) < _PLANE:
        text += "; or the coordinates of one of the two are wrong, and nothing tells these apart"
    what = f"the heights of the {len(names)} known points together ({listed(names, _NAMED)})"
    return GrossError(what, Cause.COORDINATE_SYSTEM, text, statistic**0.5, (), names)


def _common(off: FloatArray, units: Units) -> str:
    """By about how much all heights are off, where lengths on the ground show it."""
    mean = float(off.mean())
    if abs(mean) < _LOWEST:
        return ""
    return f", and are all about {units.length.text(round(abs(mean)))} too {'low' if mean < 0.0 else 'high'}"
