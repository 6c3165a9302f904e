"""Observations that are correlated with one another: their rows, and their share of the normal equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from scipy.sparse import csr_array

    from obseq.arrays import BoolArray, FloatArray, IntRows
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.numbering import FreeUnknowns
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.solvers import SymmetricPattern


FEW = 20_000
"""Entries of a matrix up to which it is multiplied as a dense one: sparse products take longer to begin."""


def cluster_pairs(batch: Batch, live: BoolArray) -> Iterator[IntRows]:
    """(2, n_pairs) pairs of different live blocks (n_blocks,), ascending, that each cluster joins."""
    for members in batch.clusters.members if batch.clusters is not None else ():
        blocks = np.unique(batch.blocks[:, members // batch.shape.n_residuals])
        blocks = blocks[live[blocks]]
        yield blocks[np.array(np.triu_indices(len(blocks), 1))]


def whitened_rows(
    table: UnknownTable, free: FreeUnknowns, batch: Batch, raw: FloatArray
) -> tuple[csr_array, FloatArray]:
    """Equations, observation by observation, whitened and over their sigmas.

    Args:
        table: the unknowns.
        free: their numbering.
        batch: observations, of clusters or not correlated.
        raw: (n_residuals + n_residuals n_unknowns, n) residuals, then derivatives, as they are.

    Returns:
        (n n_residuals, n_free) derivatives, and (n n_residuals,) residuals.
    """
    from scipy.sparse import csr_array

    m, u = batch.shape.n_residuals, batch.shape.n_unknowns
    each = zip(batch.blocks, batch.shape.roles, strict=True)
    columns = np.hstack([free.number[table.consecutive(ids, role.size)] for ids, role in each])
    columns = columns.repeat(m, axis=0)
    kept = (columns >= 0) & batch.active.repeat(m)[:, None]
    value = raw[m:].reshape(m, u, batch.n).transpose(2, 0, 1).reshape(-1, u)[kept]
    ends = np.append(0, kept.sum(axis=1).cumsum())
    plain = csr_array((value, columns[kept], ends), shape=(m * batch.n, len(free.scalars)))
    whitening = whitening_of(batch)
    return whitening @ plain, whitening @ raw[:m].T.ravel()


def whitening_of(batch: Batch) -> csr_array:
    """(n m, n m) what whitens residuals, observation by observation: roots of covariances and weights."""
    from scipy.sparse import bsr_array, csr_array

    if batch.clusters is not None:
        return batch.whitening_matrix()
    weights = batch.weights[:, : batch.n].T
    if batch.is_correlated:
        roots = batch.whitened(np.repeat(np.eye(weights.shape[1])[:, :, None], batch.n, axis=2))
        each = np.arange(batch.n + 1)
        return csr_array(bsr_array((weights[:, :, None] * roots.transpose(2, 0, 1), each[:-1], each)))
    values = weights.ravel()
    each = np.arange(len(values) + 1)
    return csr_array((values, each[:-1], each), shape=(len(values), len(values)))


def are_few(rows: csr_array) -> bool:
    """Whether rows (n, n_free) and their normal matrix are small as dense ones."""
    return bool(max(rows.shape) * rows.shape[1] <= FEW)


def add_cluster(
    rows: csr_array,
    residuals: FloatArray,
    pattern: SymmetricPattern,
    values: FloatArray,
    gradient: FloatArray,
) -> float:
    """Adds J' J to the values of the matrix and J' r to the gradient; the sum of squares.

    Args:
        rows: J, whitened.
        residuals: (n,) r, whitened.
        pattern: of the matrix.
        values: its values.
        gradient: (n_free,).
    """
    if are_few(rows):
        dense = rows.toarray()
        values += (dense.T @ dense)[pattern.indices, pattern.columns()]
        gradient += residuals @ dense
        return float(residuals @ residuals)
    transposed = rows.T.tocsr()
    product = transposed @ rows
    row = np.repeat(np.arange(pattern.n), np.diff(product.indptr))
    lower = row >= product.indices
    keys = pattern.columns() * pattern.n + pattern.indices
    found = product.indices[lower].astype(np.int64) * pattern.n + row[lower]
    values[np.searchsorted(keys, found)] += product.data[lower]
    gradient += transposed @ residuals
    return float(residuals @ residuals)
