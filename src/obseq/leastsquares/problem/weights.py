"""What observations and soft constraints have in common: standard deviations, and weights made of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

    from obseq.arrays import BoolArray, FloatArray


class Weighted(Protocol):
    """A batch or a prior: equations with standard deviations, of which weights are made in one place."""

    @property
    def name(self) -> str:
        """What it is called in messages."""

    @property
    def group(self) -> str:
        """Name under which sums of squares are kept."""

    @property
    def n_scalars(self) -> int:
        """Number of scalar equations that count."""

    @property
    def sigmas(self) -> FloatArray:
        """(n, n_residuals) given standard deviations; (n_scalars, 1) for a prior."""

    @sigmas.setter
    def sigmas(self, new: ArrayLike) -> None: ...

    @property
    def active(self) -> BoolArray:
        """(n,) False for equations that have residuals but no influence."""

    @property
    def is_correlated(self) -> bool:
        """Whether the residuals of one observation are correlated."""

    weights: FloatArray
    """What residuals are multiplied by, in the layout of the equations."""

    def times_weights(self, factors: FloatArray) -> FloatArray:
        """Factors (n, n_residuals) times the weights, in their layout."""

    def label(self, row: int) -> str:
        """What to call one equation in a message."""


def root_weights(sigmas: FloatArray, active: BoolArray, factors: FloatArray | float = 1.0) -> FloatArray:
    """(n, k) what residuals are multiplied by: factors over sigmas (n, k); 0 where not active (n,)."""
    weights = factors / sigmas
    return weights if np.count_nonzero(active) == len(active) else np.where(active[:, None], weights, 0.0)


class Restorer:
    """Remembers the standard deviations of observations, to give them back."""

    def __init__(self, sources: Iterable[Weighted]) -> None:
        self._sigmas = [(source, source.sigmas) for source in sources]

    def restore(self) -> None:
        """Gives every observation the standard deviation it had."""
        for source, sigmas in self._sigmas:
            source.sigmas = sigmas
