"""Arrays with room behind: rows of observations in whole tiles, tables to which rows are added."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from obseq.arrays import Array
from obseq.kernels.layout import LANES


def padded_length(n: int) -> int:
    """`n` rounded up to whole tiles."""
    return -(-n // LANES) * LANES


def padded(rows: Array, dtype: type) -> Array:
    """(k, n) rows repeated at their end to whole tiles, so that spare lanes compute what a real one does."""
    result: Array = np.empty((len(rows), padded_length(rows.shape[1])), dtype=dtype)
    fill_padded(result, rows)
    return result


def fill_padded(result: Array, rows: Array) -> None:
    """Writes rows (k, n) to (k, n padded)."""
    n = rows.shape[1]
    result[:, :n] = rows
    if n:
        result[:, n:] = rows[:, n - 1 : n]


PADDING = 4
"""Spare entries behind those present: gathers read four at a time."""

Entry = TypeVar("Entry", bound=np.generic)


class GrowingArray(Generic[Entry]):
    """A 1-D array that grows at its end in amortised constant time, with some spare room behind."""

    def __init__(self, dtype: type[Entry]) -> None:
        self._data: NDArray[Entry] = np.zeros(64, dtype=dtype)
        self._n = 0

    def __len__(self) -> int:
        return self._n

    @property
    def view(self) -> NDArray[Entry]:
        """The entries present; a view, to be read again after an extension."""
        return self._data[: self._n]

    @property
    def padded(self) -> NDArray[Entry]:
        """The same with at least PADDING readable entries behind."""
        return self._data

    def extend(self, values: ArrayLike) -> None:
        """Appends entries."""
        added = np.asarray(values, dtype=self._data.dtype).ravel()
        n = self._n + len(added)
        if n + PADDING > len(self._data):
            grown = np.zeros(2 * n + PADDING, dtype=self._data.dtype)
            grown[: self._n] = self._data[: self._n]
            self._data = grown
        self._data[self._n : n] = added
        self._n = n

    def cut(self, n: int) -> None:
        """Keeps the first n entries."""
        self._n = min(n, self._n)
