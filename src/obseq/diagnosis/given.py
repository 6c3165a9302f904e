"""What hypotheses that are accepted leave to all others: with one more of them, or one less."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray

_TINY, _ROUNDING = 1e-300, 1e-9
"""Shares of the largest singular value below which one is none."""


@dataclass(frozen=True, eq=False)
class Given:
    """What accepted hypotheses leave to the columns.

    Attributes:
        basis: (s, k) B C.
        shown: (k,) u that is left.
        taken: (s,) B v0.
    """

    basis: FloatArray
    shown: FloatArray
    taken: FloatArray

    def with_more(self, across: FloatArray, own: IntArray, unseen: float) -> Given:
        """The same with more columns accepted, of which C' R C with all (q, k) is known."""
        is_first = not len(self.basis)  # of a large model each copy counts
        left = across if is_first else across - self.basis[:, own].T @ self.basis
        shares, axes = np.linalg.eigh(left[:, own])
        seen = shares > unseen
        half = axes[:, seen] / np.sqrt(shares[seen])
        basis, taken = half.T @ left, half.T @ self.shown[own]
        return Given(
            basis if is_first else np.concatenate([self.basis, basis]),
            self.shown - taken @ basis,
            np.append(self.taken, taken),
        )

    def with_less(self, rest: IntArray) -> Given:
        """The same with only some of the columns accepted: the directions that they do not take are free."""
        axes, sizes, _ = np.linalg.svd(self.basis[:, rest])
        free = axes[:, np.count_nonzero(sizes > _TINY + _ROUNDING * sizes.max(initial=0.0)) :]
        basis, taken = free.T @ self.basis, free.T @ self.taken
        return Given(self.basis - free @ basis, self.shown + taken @ basis, self.taken - free @ taken)
