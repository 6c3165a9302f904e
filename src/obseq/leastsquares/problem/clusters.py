"""Covariances across the observations of a batch: clusters of residuals that are correlated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.errors import InputError
from obseq.leastsquares.problem.arguments import finite
from obseq.leastsquares.sparse import Sparse

Covariance: TypeAlias = Any
"""A matrix, dense or sparse, or a list of the dense ones of consecutive clusters."""

LARGEST = 5000
"""Residuals of one cluster: its inverse covariance is dense."""
_SMALL = 64
"""Size up to which factors are inverted all together."""


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

    def __init__(self, covariance: Covariance, n: int, what: str) -> None:
        self._n = n
        parts = _listed_parts(covariance, n, what) or _connected_parts(covariance, n, what)
        self.members = tuple(index for index, _ in parts)
        self._stacks = _stacked(parts)
        for index, matrices in self._stacks:
            _check(index, matrices, what)

    def variances(self) -> FloatArray:
        """(n,) diagonal of the covariance."""
        result = np.empty(self._n)
        for index, matrices in self._stacks:
            result[index] = np.diagonal(matrices, axis1=1, axis2=2)
        return result

    def norms(self, whitened: FloatArray) -> FloatArray:
        """(n,) root mean square of the whitened residuals (n,) of the cluster of each."""
        result = np.empty(self._n)
        for index, _ in self._stacks:
            result[index] = np.sqrt(np.mean(np.square(whitened[index]), axis=1, keepdims=True))
        return result

    def alike(self, active: BoolArray) -> Iterator[IntArray]:
        """Active residuals (k, m) of the clusters, those with equally many together."""
        for index, _ in self._stacks:
            count = active[index].sum(axis=1)
            for m in np.unique(count[count > 0]).tolist():
                chosen = index[count == m]
                yield chosen[active[chosen]].reshape(-1, m)

    def whitening(self, active: BoolArray) -> Sparse:
        """(n, n) W, with W' W the inverse covariance of the active residuals (n,); zero for the others."""
        entries = [_whitening_entries(index, matrices, active[index]) for index, matrices in self._stacks]
        rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
        return Sparse.of_entries(values, rows, columns, (self._n, self._n))


def _stacked(parts: list[tuple[IntArray, FloatArray]]) -> list[tuple[IntArray, FloatArray]]:
    """Clusters of one size together: (k, size) residuals and (k, size, size) covariances."""
    by_size: dict[int, list[tuple[IntArray, FloatArray]]] = {}
    for part in parts:
        by_size.setdefault(len(part[0]), []).append(part)
    return [
        (np.stack([index for index, _ in alike]), np.stack([matrix for _, matrix in alike]))
        for alike in by_size.values()
    ]


def _check(index: IntArray, matrices: FloatArray, what: str) -> None:
    """Raises InputError for the first cluster of a stack that is too large or is no covariance."""
    size = index.shape[1]
    if size > LARGEST:
        raise InputError(f"{what}: {size} residuals hang together; clusters have at most {LARGEST}")
    transposed = matrices.transpose(0, 2, 1)
    skew = np.flatnonzero(~np.isclose(matrices, transposed, rtol=1e-12, atol=0.0).all(axis=(1, 2)))
    if skew.size:
        raise InputError(f"{what}, cluster of residual {index[skew[0], 0]}: the covariance is not symmetric")
    try:
        np.linalg.cholesky(matrices)
    except np.linalg.LinAlgError:
        first = next(k for k in range(len(matrices)) if not _is_definite(matrices[k]))
        raise InputError(
            f"{what}, cluster of residual {index[first, 0]}: the covariance is not positive definite"
        ) from None


def _is_definite(matrix: FloatArray) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True


def _whitening_entries(
    index: IntArray, matrices: FloatArray, active: BoolArray
) -> tuple[IntArray, IntArray, FloatArray]:
    """Rows, columns and values of the inverse roots of a stack; inactive residuals (k, size) have none.

    With unit rows and columns in place of the inactive ones, the others are those of the rest alone.
    """
    both = active[:, :, None] & active[:, None, :]
    inverses = _inverse_roots(np.where(both, matrices, np.eye(index.shape[1])))
    kept = both & np.tri(index.shape[1], dtype=bool)
    rows, columns = np.broadcast_arrays(index[:, :, None], index[:, None, :])
    return rows[kept], columns[kept], inverses[kept]


def _inverse_roots(matrices: FloatArray) -> FloatArray:
    """(k, m, m) inverses of the lower Cholesky factors."""
    from scipy.linalg import solve_triangular

    roots, unit = np.linalg.cholesky(matrices), np.eye(matrices.shape[1])
    if matrices.shape[1] <= _SMALL:
        return np.asarray(np.linalg.inv(roots))
    return np.stack([solve_triangular(root, unit, lower=True) for root in roots])


def _listed_parts(covariance: Covariance, n: int, what: str) -> list[tuple[IntArray, FloatArray]]:
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


def _connected_parts(covariance: Covariance, n: int, what: str) -> list[tuple[IntArray, FloatArray]]:
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
