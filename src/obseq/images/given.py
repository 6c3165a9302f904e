"""What is given to make parts of a block: rows of numbers and their sigmas, never put into another shape."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import real

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray


def rows_of(given: ArrayLike, n: int, width: int, what: str) -> FloatArray:
    """Numbers as an array (n, width), one row for each of n things; a copy.

    Raises:
        InputError: they have another shape; rows that were given as columns are told as that.
    """
    array = real(given, what)
    if not array.size and not n:
        return np.zeros((0, width))
    if array.shape != (n, width):
        turned = ": transpose them" if array.shape == (width, n) else ""
        raise InputError(f"{what} have shape {array.shape}, not ({n}, {width}){turned}")
    return array


def sigmas_of(given: ArrayLike, n: int, width: int, what: str) -> FloatArray:
    """Sigmas as an array (n, width), of one for all, one for each of n things (n,), or (n, width); a copy.

    Raises:
        InputError: they have another shape.
    """
    array = real(given, what)
    if array.ndim and array.shape not in ((n,), (n, width)):
        raise InputError(f"{what} have shape {array.shape}; one number, ({n},) or ({n}, {width}) is wanted")
    return np.array(np.broadcast_to(array[:, None] if array.ndim == 1 else array, (n, width)))
