"""The quadrants of a figure and of what is around it: whether one of them differs from the drawing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.targets.finding.fits import Fit
    from obseq.targets.specification import Specification

FEWEST = 3
"""Pixels of a part whose mean says something."""
QUADRANTS = 4


def worst_quadrant(spec: Specification, fit: Fit) -> float:
    """The largest mean difference of a quadrant from the drawing, in contrasts."""
    x, y = fit.places.T
    radius = np.hypot(x, y)
    quadrant = np.floor((np.arctan2(y, x) - spec.geometry.angle) / (0.5 * math.pi)).astype(np.int64)
    zones = quadrant % QUADRANTS + QUADRANTS * (radius > 1.0)
    is_near = radius < spec.geometry.radii[0]
    counts = np.bincount(zones[is_near], minlength=2 * QUADRANTS)
    sums = np.bincount(zones[is_near], weights=fit.residuals[is_near], minlength=2 * QUADRANTS)
    means = np.abs(sums) / np.maximum(counts, 1)
    return float(means[counts >= FEWEST].max(initial=0.0))
