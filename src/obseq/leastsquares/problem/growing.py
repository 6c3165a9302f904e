"""Arrays that grow at their end, for tables to which rows are added."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

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
