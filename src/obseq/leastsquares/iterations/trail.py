"""Where restrained steps in a row have led, and when to leap as far again (Hooke and Jeeves, 1961)."""

from __future__ import annotations

from obseq.arrays import FloatArray

FIRST_LEAP, LATEST_LEAP = 16, 32
"""Restrained steps in a row that prompt a leap: the first one, and after leaps in vain."""

NEXT_LEAP = 2
"""The same after a leap that led on: twice as far next time."""


class Trail:
    """The steps since they began to be held back, or since the last leap that led on, with that leap.

    Along a bent valley a radius allows steps of one length only, hundreds of them where the valley is long.
    """

    def __init__(self) -> None:
        self._way: FloatArray | None = None
        self._count, self._prompt = 0, FIRST_LEAP

    @property
    def prompts(self) -> bool:
        """Whether it is long enough for a leap."""
        return self._way is not None and self._count >= self._prompt

    def follow(self, move: FloatArray, is_full: bool) -> None:
        """Adds a step (n_scalars,) that was taken; a full one ends the trail."""
        if is_full:
            self._way, self._count = None, 0
        else:
            self._way = move if self._way is None else self._way + move
            self._count += 1

    def taken(self) -> FloatArray:
        """All of it (n_scalars,), to leap as far again; the trail is empty then."""
        assert self._way is not None
        way, self._way, self._count = self._way, None, 0
        self._prompt = min(2 * self._prompt, LATEST_LEAP)
        return way

    def lead_on(self, way: FloatArray) -> None:
        """The leap, of this way (n_scalars,) with the steps after it, was worth it."""
        self._way, self._prompt = way, NEXT_LEAP
