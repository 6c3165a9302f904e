"""What observations and soft constraints have in common: standard deviations that may be changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray


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

    def label(self, row: int) -> str:
        """What to call one equation in a message."""


class Restorer:
    """Remembers the standard deviations of observations, to give them back."""

    def __init__(self, sources: Iterable[Weighted]) -> None:
        self._sigmas = [(source, source.sigmas) for source in sources]

    def restore(self) -> None:
        """Gives every observation the standard deviation it had."""
        for source, sigmas in self._sigmas:
            source.sigmas = sigmas
