"""Graphs of points, unknowns or rows, by SciPy: what hangs together, and what lies how near."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from obseq.arrays import IndexArray, IntArray


def parts(n: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> IndexArray:
    """(n,) number of the part of each node, from 0; joins (m,) lead from the first to the second."""
    from scipy.sparse.csgraph import connected_components

    labels: IndexArray = connected_components(_graph(n, first, second), directed=False)[1]
    return labels


def outwards(
    n: int, first: NDArray[np.integer], second: NDArray[np.integer], start: int
) -> tuple[IntArray, IntArray]:
    """Nodes that joins (m,) lead to from one, the nearest first, and the node (n,) before each on the way."""
    from scipy.sparse.csgraph import breadth_first_order

    order, before = breadth_first_order(_graph(n, first, second), start, directed=False)
    return np.asarray(order, np.int64), np.asarray(before, np.int64)


def _graph(n: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> csr_array:
    from scipy.sparse import coo_array

    return coo_array((np.ones(len(first), np.bool_), (first, second)), shape=(n, n)).tocsr()
