"""Rows of numbers, one of each observation, laid out in whole tiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.kernels.layout import LANES

if TYPE_CHECKING:
    from obseq.arrays import Array


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
