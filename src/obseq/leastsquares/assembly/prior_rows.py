"""The priors of a set of equations, one after the other, as the loops take them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.loops.loop_arguments import PriorArrays

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.problem.numbering import FreeUnknowns
    from obseq.leastsquares.problem.priors import Prior


class PriorRows:
    """The rows of some priors; false without any.

    Args:
        priors: the priors; their sigmas may change.
        free: the numbering of the matrix.
    """

    def __init__(self, priors: Sequence[Prior], free: FreeUnknowns) -> None:
        self._priors = priors
        whole, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        scalars = np.concatenate([whole, *(prior.scalars for prior in priors)])
        values = np.concatenate([real, *(prior.values for prior in priors)])
        number = np.arange(len(priors)).repeat([len(prior.scalars) for prior in priors])
        self._arrays = PriorArrays(scalars, free.number[scalars], values, real, number)
        self._weights: list[FloatArray] = []

    def __bool__(self) -> bool:
        return len(self._priors) > 0

    def arrays(self) -> PriorArrays:
        """With the weights that they have now."""
        weights = [prior.weights for prior in self._priors]
        if len(self._weights) != len(weights) or any(map(_differ, weights, self._weights)):
            self._arrays = self._arrays._replace(weights=np.concatenate([np.zeros(0), *weights]))
            self._weights = weights
        return self._arrays


def _differ(first: FloatArray, second: FloatArray) -> bool:
    return first is not second
