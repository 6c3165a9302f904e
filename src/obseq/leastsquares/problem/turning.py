"""Points that turn together: what of a step is a turn about their middle follows the circle, not its tangent.

A network that little keeps from turning takes steps of metres that way. Along the tangent they change all
lengths by half the square of the angle: residuals rise by thousands of sigmas where nothing but a turn is
meant, and damped steps go around the circle in tens of pieces. The turn that fits a step of all points best
is made as one, as those of instruments are; the rest of the step is added. To first order nothing changes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.geometry import exponential, skew

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Turning:
    """Points that turn together.

    Attributes:
        scalars: (n, 3) positions of their coordinates among all unknowns.
    """

    scalars: IntArray

    def along(self, values: FloatArray, step: FloatArray) -> FloatArray:
        """(n_scalars,) a step from these values, in which the points turn about their middle."""
        arms, steps = (part[self.scalars] - part[self.scalars].mean(axis=0) for part in (values, step))
        inertia = np.eye(3) * np.square(arms).sum() - arms.T @ arms
        turn = np.linalg.lstsq(inertia, np.cross(arms, steps).sum(axis=0))[0]
        shape = arms + steps - arms @ skew(turn).T
        found = step.copy()
        found[self.scalars] += shape @ exponential(turn).T - arms - steps
        return found
