"""Covariances across the observations of a batch: clusters of residuals that are correlated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from obseq.arrays import BoolArray, FloatArray, IntArray

LARGEST = 5000
"""Residuals of one cluster: its inverse covariance is dense."""


class Clusters:
    """The covariance of all residuals of a batch, cluster by cluster.

    Args:
        covariance: (n, n) of the residuals, observation by observation, dense or sparse; or a list of the
            dense covariances of consecutive clusters.
        n: number of residuals.
        what: what it is called in messages.

    Raises:
        InputError: it does not fit, or a cluster is not symmetric and positive definite.
    """

    def __init__(self, covariance: Any, n: int, what: str) -> None:
        self._n = n
        self._what = what
        self._parts = _listed_parts(covariance, n, what) or _connected_parts(covariance, n, what)
        for index, part in self._parts:
            _root(part, f"{what}, cluster of residual {index[0]}")

    @property
    def members(self) -> tuple[IntArray, ...]:
        """The residuals of each cluster, by number."""
        return tuple(index for index, _ in self._parts)

    def variances(self) -> FloatArray:
        """(n,) diagonal of the covariance."""
        result = np.empty(self._n)
        for index, part in self._parts:
            result[index] = np.diagonal(part)
        return result

    def whitening(self, active: BoolArray) -> csr_array:
        """(n, n) W, with W' W the inverse covariance of the active residuals (n,); zero for the others."""
        from scipy.linalg import solve_triangular
        from scipy.sparse import coo_array

        rows, columns, values = [], [], []
        for index, part in self._parts:
            kept = index[active[index]]
            inner = np.flatnonzero(active[index])
            root = _root(part[np.ix_(inner, inner)], self._what)
            inverse = solve_triangular(root, np.eye(len(kept)), lower=True) if len(kept) else root
            below = np.tril_indices(len(kept))
            rows.append(kept[below[0]])
            columns.append(kept[below[1]])
            values.append(inverse[below])
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        return coo_array(entries, shape=(self._n, self._n)).tocsr()


def _listed_parts(covariance: Any, n: int, what: str) -> list[tuple[IntArray, FloatArray]]:
    """Consecutive clusters from the list of their covariances; empty when it is one matrix."""
    if not isinstance(covariance, list | tuple) or any(np.ndim(part) != 2 for part in covariance):
        return []
    sizes = [len(part) for part in covariance]
    if sum(sizes) != n:
        raise InputError(f"{what}: clusters of {sum(sizes)} residuals; there are {n}")
    ends = np.cumsum(sizes)
    return [
        (np.arange(end - size, end), finite(part, (size, size), what))
        for part, size, end in zip(covariance, sizes, ends, strict=True)
    ]


def _connected_parts(covariance: Any, n: int, what: str) -> list[tuple[IntArray, FloatArray]]:
    """The clusters that a matrix joins by entries that are not zero."""
    from scipy.sparse import csr_array, issparse
    from scipy.sparse.csgraph import connected_components

    if not issparse(covariance):
        covariance = finite(covariance, (n, n), what)
    matrix = csr_array(covariance)
    if matrix.shape != (n, n) or not np.isfinite(matrix.data).all():
        raise InputError(f"{what}: a finite matrix ({n}, {n}) is wanted, not {matrix.shape}")
    count, labels = connected_components(matrix, directed=False)
    order = np.argsort(labels, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(labels, minlength=count))[:-1])
    return [(index, np.asarray(matrix[index][:, index].toarray())) for index in members]


def _root(part: FloatArray, what: str) -> FloatArray:
    """Lower Cholesky factor of the covariance of a cluster."""
    if len(part) > LARGEST:
        raise InputError(f"{what}: {len(part)} residuals hang together; clusters have at most {LARGEST}")
    if not np.allclose(part, part.T, rtol=1e-12, atol=0.0):
        raise InputError(f"{what}: the covariance is not symmetric")
    try:
        return np.asarray(np.linalg.cholesky(part))
    except np.linalg.LinAlgError:
        raise InputError(f"{what}: the covariance is not positive definite") from None
