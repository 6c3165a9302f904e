"""What two full steps in a row tell of the curvature that their linearisations do not know."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray

SLOW = 0.3
"""Share of the step before it that a step must have to be one of a slow sequence, or..."""

STEADY = 0.03
"""...share that is enough when it does not fall from step to step: not to half of it."""

PARALLEL = 0.95
"""Cosine between steps that are of one direction."""

LONGEST, SHORTEST = 4.0, 0.25
"""Shares of a Gauss-Newton step that are taken."""


class Overshoot:
    """The share of a full step that ends where the full steps lead (Barzilai and Borwein, 1988).

    Where residuals are large, full steps shrink by a constant share q only, or swing with a negative one,
    along one direction. There the sum of squares has 1 - q times the curvature of its linearisation, and the
    step to its minimum is 1 / (1 - q) times the full one.
    """

    _last: FloatArray | None = None
    _share = 1.0
    _rate = np.inf

    def forget(self) -> None:
        """The last step was no full one, or too long to tell."""
        self._last, self._share, self._rate = None, 1.0, np.inf

    def share_of(self, step: FloatArray, weights: FloatArray) -> float:
        """Share of this full step to take after the last one, 1 where that tells nothing.

        Args:
            step: (n_scalars,) Gauss-Newton step.
            weights: (n_scalars,) diagonal of N: the metric in which steps are compared.
        """
        share = 1.0 if self._last is None else self._found(step, self._last, weights)
        self._last, self._share = step, share
        return share

    def _found(self, step: FloatArray, last: FloatArray, weights: FloatArray) -> float:
        pairs = ((step, last), (last, last), (step, step))
        both, before, now = (float((weights * a * b).sum()) for a, b in pairs)
        if both * both < PARALLEL**2 * before * now:
            return self._share if now <= SLOW**2 * before else 1.0
        rate, known = 1.0 - (1.0 - both / before) / self._share, self._rate
        self._rate = abs(rate)
        is_slow = abs(rate) >= SLOW or abs(rate) >= max(STEADY, 0.5 * known)
        return float(np.clip(1.0 / (1.0 - rate), SHORTEST, LONGEST)) if is_slow and rate < 1.0 else 1.0
