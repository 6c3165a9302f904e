"""Points that are seen from somewhere: a step changes the inverse of their distance, not the distance.

Rays that are nearly parallel tell the inverse of a distance with an error that is symmetric, zero and less
included: there the rays meet in front, nowhere, or behind. The distance itself goes to infinity on the way,
along a valley that bends and has no end (Montiel, Civera and Davison, Unified inverse depth parametrization
for monocular SLAM, 2006). A step d of a point X seen from C changes the inverse of its distance, to first
order, by the share s = d'(X - C) / |X - C|^2. Made in the inverse distance it leads to X + d / (1 - s): the
same step where it is short, a longer one towards infinity, and one beyond it where s is above one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray

FARTHEST = 1e-6
"""Least share of the inverse distance that a step leaves: infinity itself has no coordinates."""


@dataclass(frozen=True, eq=False)
class Perspective:
    """Points and from where they are seen.

    Attributes:
        scalars: (n, 3) positions of their coordinates among all unknowns.
        places: (n, 3) from where: about the middle of all places is enough.
    """

    scalars: IntArray
    places: FloatArray

    def stretched(self, values: FloatArray, step: FloatArray, frozen: BoolArray) -> FloatArray:
        """(n_scalars,) a step from these values in which these points change their inverse distances."""
        arms, steps = values[self.scalars] - self.places, step[self.scalars]
        squares = np.einsum("ij,ij->i", arms, arms)
        shares = np.einsum("ij,ij->i", arms, steps) / np.where(squares > 0.0, squares, np.inf)
        left = 1.0 - shares
        left = np.copysign(np.maximum(np.abs(left), FARTHEST), left)
        left[frozen[self.scalars].any(axis=1)] = 1.0
        found = step.copy()
        found[self.scalars] = steps / left[:, None]
        return found
