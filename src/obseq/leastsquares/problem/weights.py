"""Changing what observations weigh, between two solutions, without making the system anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.problem.batches import Batch

if TYPE_CHECKING:
    from collections.abc import Iterable

    from obseq.arrays import FloatArray
    from obseq.leastsquares.problem.priors import Prior


def set_active(batch: Batch, row: int, active: bool) -> None:
    """Takes an observation out of the adjustment, or back in; it keeps its place, sigma and residual."""
    batch.active[row] = active
    batch.weights[:, row] = 1.0 / batch.sigmas[row] if active else 0.0


def sigmas_of(source: Batch | Prior) -> FloatArray:
    """(n, n_residuals) given standard deviations; (n_scalars, 1) for a prior."""
    if isinstance(source, Batch):
        return np.array(source.sigmas)
    return np.asarray(1.0 / source.weights[:, None])


def set_sigmas(source: Batch | Prior, sigmas: FloatArray) -> None:
    """Gives observations new standard deviations, in the shape that `sigmas_of` returns."""
    if isinstance(source, Batch):
        source.sigmas = np.array(sigmas)
        source.weights[:, : source.n] = np.where(source.active, 1.0 / sigmas.T, 0.0)
    else:
        source.weights = 1.0 / sigmas[:, 0]


class Restorer:
    """Remembers the standard deviations of observations, to give them back."""

    def __init__(self, sources: Iterable[Batch | Prior]) -> None:
        self._sigmas = [(source, sigmas_of(source)) for source in sources]

    def restore(self) -> None:
        """Gives every observation the standard deviation it had."""
        for source, sigmas in self._sigmas:
            set_sigmas(source, sigmas)
