"""What hypotheses that are accepted leave to all others: with one more of them, or one less."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass

_TINY, _ROUNDING = 1e-300, 1e-9
"""Shares of the largest singular value below which one is none."""


@dataclass(frozen=True, eq=False)
class Given:
    """What accepted hypotheses leave to the columns.

    Attributes:
        whole: (s, k) B C, with directions that are free again.
        shown: (k,) u that is left.
        taken: (s,) B v0.
        squares: (k,) what the accepted ones take of M of each column.
        free: (r, s) the directions that are free.
        freed: (r, k) these of B C.
    """

    whole: FloatArray
    shown: FloatArray
    taken: FloatArray
    squares: FloatArray
    free: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    freed: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def nothing(cls, shown: FloatArray) -> Given:
        """Nothing is accepted."""
        return cls(np.zeros((0, len(shown))), shown, np.zeros(0), np.zeros(len(shown)))

    def basis(self, own: IntArray | slice = slice(None)) -> FloatArray:
        """(s, ...) B C of some columns."""
        if not len(self.free):
            return self.whole[:, own]
        return np.asarray(self.whole[:, own] - np.tensordot(self.free.T, self.freed[:, own], 1))

    def with_more(self, across: FloatArray, own: IntArray, unseen: float) -> Given:
        """The same with more columns accepted, of which C' R C with all (q, k) is known."""
        is_first = not len(self.whole)  # of a large model each copy counts
        before = self.basis()
        left = across if is_first else across - before[:, own].T @ before
        shares, axes = np.linalg.eigh(left[:, own])
        seen = shares > unseen
        half = axes[:, seen] / np.sqrt(shares[seen])
        basis, taken = half.T @ left, half.T @ self.shown[own]
        return Given(
            basis if is_first else np.concatenate([before, basis]),
            self.shown - taken @ basis,
            np.append(self.taken, taken),
            self.squares + np.einsum("ij,ij->j", basis, basis),
        )

    def with_less(self, rest: IntArray) -> Given:
        """The same with only some of the columns accepted: the directions that they do not take are free."""
        before = self.basis()
        axes, sizes, _ = np.linalg.svd(before[:, rest])
        free = axes[:, np.count_nonzero(sizes > _TINY + _ROUNDING * sizes.max(initial=0.0)) :].T
        freed, taken = free @ before, free @ self.taken
        shown, squares = self.shown + taken @ freed, self.squares - np.einsum("ij,ij->j", freed, freed)
        return Given(before, shown, self.taken - taken @ free, squares, free, freed)


@dataclass(frozen=True, eq=False)
class Tested:
    """T of all hypotheses.

    Attributes:
        statistic: (h,) T; 0 where nothing shows it.
        limit: (h,) K that it must exceed.
        noise: (h,) what it takes of the noise, on average.
    """

    statistic: FloatArray
    limit: FloatArray
    noise: FloatArray
