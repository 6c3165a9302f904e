"""The priors of a set of equations, one after the other, as the loops take them."""

from __future__ import annotations

from collections.abc import Sequence
from operator import is_not

import numpy as np

from obseq.arrays import FloatArray
from obseq.leastsquares.loops.loop_arguments import PriorArrays
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.priors import Prior


class PriorRows:
    """The rows of some priors; false without any.

    Args:
        priors: the priors; their values and sigmas may change.
        free: the numbering of the matrix.
    """

    def __init__(self, priors: Sequence[Prior], free: FreeUnknowns) -> None:
        self._priors = priors
        whole, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        scalars = np.concatenate([whole, *(prior.scalars for prior in priors)])
        number = np.arange(len(priors)).repeat([len(prior.scalars) for prior in priors])
        self._arrays = PriorArrays(scalars, free.number[scalars], real, real, number)
        self._taken: list[FloatArray] = []

    def __bool__(self) -> bool:
        return len(self._priors) > 0

    def arrays(self) -> PriorArrays:
        """With the values and weights that they have now."""
        values, weights = [prior.values for prior in self._priors], [prior.weights for prior in self._priors]
        now = values + weights
        if len(self._taken) != len(now) or any(map(is_not, now, self._taken)):
            joined = [np.concatenate([np.zeros(0), *parts]) for parts in (values, weights)]
            self._arrays = self._arrays._replace(values=joined[0], weights=joined[1])
            self._taken = now
        return self._arrays
