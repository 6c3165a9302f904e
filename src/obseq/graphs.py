"""Graphs of points, unknowns or rows, by SciPy: what hangs together, and what lies how near."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_array

    from obseq.arrays import IndexArray, IntArray


def parts(n: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> IndexArray:
    """(n,) number of the part of each node, from 0; joins (m,) lead from the first to the second."""
    from scipy.sparse.csgraph import connected_components

    labels: IndexArray = connected_components(_graph(n, first, second), directed=False)[1]
    return labels


def outwards(
    n: int, first: NDArray[np.integer], second: NDArray[np.integer], starts: ArrayLike
) -> tuple[IntArray, IntArray]:
    """Nodes that joins (m,) lead to from some, the nearest first, and the one before each (n,) on the way."""
    from scipy.sparse.csgraph import breadth_first_order

    some = np.atleast_1d(starts)
    ends = np.append(first, np.full(len(some), n)), np.append(second, some)  # one more leads to all of them
    order, before = breadth_first_order(_graph(n + 1, *ends), n, directed=False)
    return np.asarray(order[1:], np.int64), np.asarray(before[:n], np.int64)


def _graph(n: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> csr_array:
    from scipy.sparse import coo_array

    return coo_array((np.ones(len(first), np.bool_), (first, second)), shape=(n, n)).tocsr()
