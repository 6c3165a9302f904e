"""What observations and soft constraints have in common: standard deviations, and weights made of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.sparse import Sparse


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


@dataclass(frozen=True, eq=False)
class Weighing:
    """What the residuals of a batch are weighed by at one time; later weights are another one's.

    Attributes:
        sigmas: (n, n_residuals) standard deviations.
        active: (n,) False for observations without influence.
        roots: (m (m + 1) / 2, padded n) upper triangles that whiten correlated residuals; empty without.
        whitening: (n m, n m) whitens residuals that are correlated across observations; None without.
        robust: (n,) what a loss makes of the weights: 1 full, 0 none; None without a loss.
    """

    sigmas: FloatArray
    active: BoolArray
    roots: FloatArray
    whitening: Sparse | None
    robust: FloatArray | None = None

    @property
    def is_white(self) -> bool:
        """Whether the sigmas are those of the raw residuals, of which none are correlated."""
        return self.whitening is None and not self.roots.size

    def whitened(self, rows: FloatArray, chosen: IntArray | slice | None = None) -> FloatArray:
        """(m, k, n) residual rows times the roots of the inverse covariances; as they are without any.

        Args:
            rows: (m, k, n) for each residual, k values of each observation.
            chosen: observations that the last axis stands for, not of clusters; all when None.
        """
        if self.whitening is not None:
            flat = rows.transpose(2, 0, 1).reshape(-1, rows.shape[1])
            whole = (self.whitening @ flat).reshape(len(self.sigmas), -1, rows.shape[1])
            return np.asarray(whole.transpose(1, 2, 0))
        if not self.roots.size:
            return rows
        m = self.sigmas.shape[1]
        roots = np.zeros((m, m, rows.shape[2]))
        roots[np.triu_indices(m)] = self.roots[:, slice(len(self.sigmas)) if chosen is None else chosen]
        return np.asarray(np.einsum("rsn,skn->rkn", roots, rows))

    def whitened_residuals(self, raw: FloatArray) -> FloatArray:
        """(n, n_residuals) what the sigmas stand for, of residuals in their units."""
        return raw if self.is_white else np.ascontiguousarray(self.whitened(raw.T[:, None])[:, 0].T)

    def robust_weights(self) -> FloatArray:
        """(n,) what a loss makes of the weight of each observation: 1 full, 0 none; 0 where inactive."""
        return self.active.astype(np.float64) if self.robust is None else self.robust

    def is_like(self, other: Weighing) -> bool:
        """Whether sigmas, but for rounding, and activity are the same."""
        if self.sigmas is other.sigmas and self.active is other.active:
            return True
        same = self.sigmas.shape == other.sigmas.shape and np.array_equal(self.active, other.active)
        return same and np.allclose(self.sigmas, other.sigmas, rtol=1e-6, atol=0.0)


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
