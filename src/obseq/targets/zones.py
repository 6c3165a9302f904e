"""The parts of a target: quadrants of its figure, the ring around it, and its bits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from obseq.arrays import FloatRows, IntArray
    from obseq.targets.fits import Fit
    from obseq.targets.specification import Specification

FEWEST = 3
"""Pixels of a part whose mean says something."""
QUADRANTS = 4


def zones_of(spec: Specification, places: FloatRows) -> IntArray:
    """(n,) the part that each place (n, 2) of the drawing belongs to: bits first, quadrants, ring around."""
    geometry = spec.geometry
    begin, _, _, half_width = geometry.radii
    x, y = places.T
    radius = np.hypot(x, y)
    turn = np.arctan2(y, x) - geometry.angle
    quadrant = np.floor(turn / (0.5 * math.pi)).astype(np.int64) % QUADRANTS
    found = spec.bits + quadrant + QUADRANTS * (radius > 1.0)
    if geometry.in_rows:
        half = spec.bits // 2
        column = np.clip(np.floor((x + half_width) / (2.0 * half_width) * half).astype(np.int64), 0, half - 1)
        second = y > half_width * (1.0 + math.sqrt(2.0) / 4.0) if geometry.at_top else y > 0.0
        in_row = (y > half_width) | ((not geometry.at_top) & (y < -half_width))
        return np.asarray(np.where(in_row, column + half * second, found))
    bit = np.floor(spec.bits * (turn if geometry.grows else -turn) / (2.0 * math.pi)).astype(np.int64)
    return np.asarray(np.where(radius > begin, bit % spec.bits, found))


def worst_zone(spec: Specification, fit: Fit) -> float:
    """The largest mean difference of a part from the drawing, in contrasts."""
    zones = zones_of(spec, fit.places)
    n = spec.bits + 2 * QUADRANTS
    counts = np.bincount(zones, minlength=n)
    sums = np.bincount(zones, weights=fit.residuals, minlength=n)
    means = np.abs(sums) / np.maximum(counts, 1)
    return float(means[counts >= FEWEST].max(initial=0.0))
