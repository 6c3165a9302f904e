"""How image measures weigh, in pixels, the way MMVII's bundle adjustment states it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.arguments import NUMBER, require
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.losses import Attenuated

if TYPE_CHECKING:
    from obseq.arrays import FloatArray


@dataclass(frozen=True)
class Weighting:
    """The weight of a measure with a residual of v pixels (both coordinates together).

        w = 0                                             where v > threshold
        w = 1 / sigma^2                                   without attenuation
        w = (1 / sigma^2) / (1 + (v / attenuation)^p)     with it; p is the exponent

    Attributes:
        sigma: pixels.
        attenuation: pixels, where the weight is one half; None for none.
        threshold: pixels; None for none.
        exponent: 1 tends to least absolute residuals, 2 is Cauchy's.

    Example:
        >>> Weighting(0.5, attenuation=1.0, exponent=2.0).weights([[2.0, 0.0]])
        array([0.8])
    """

    sigma: float
    attenuation: float | None = None
    threshold: float | None = None
    exponent: float = 1.0

    def __post_init__(self) -> None:
        require("weighting", "sigma", self.sigma, NUMBER)
        if not self.sigma > 0.0:
            raise InputError(f"weighting: sigma must be positive, not {self.sigma}")
        Attenuated(self.attenuation, self.threshold, self.exponent)  # which checks them

    @property
    def loss(self) -> Attenuated | None:
        """The same for residuals divided by sigma; None when no measure is weakened."""
        if self.attenuation is None and self.threshold is None:
            return None
        return Attenuated(self.attenuation, self.threshold, self.exponent).widened(1.0 / self.sigma)

    def weights(self, residuals: FloatArray) -> FloatArray:
        """(n,) weights of residuals (n, 2) pixels."""
        norms = np.linalg.norm(np.asarray(residuals, dtype=np.float64), axis=1) / self.sigma
        loss = self.loss
        shares = np.ones(len(norms)) if loss is None else loss.weights(norms)
        return np.asarray(shares / self.sigma**2)
