"""Observations that are correlated with one another: their rows, and their share of the normal equations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntRows
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import SymmetricPattern
from obseq.leastsquares.sparse import Sparse

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
) -> tuple[Sparse, FloatArray]:
    """Equations, observation by observation, whitened and over their sigmas.

    Args:
        table: the unknowns.
        free: their numbering.
        batch: observations, of clusters or not correlated.
        raw: (n_residuals + n_residuals n_unknowns, n) residuals, then derivatives, as they are.

    Returns:
        (n n_residuals, n_free) derivatives, and (n n_residuals,) residuals.
    """
    m, u = batch.shape.n_residuals, batch.shape.n_unknowns
    each = zip(batch.blocks, batch.shape.roles, strict=True)
    columns = np.hstack([free.number[table.consecutive(ids, role.size)] for ids, role in each])
    columns = columns.repeat(m, axis=0)
    kept = (columns >= 0) & batch.active.repeat(m)[:, None]
    value = raw[m:].reshape(m, u, batch.n).transpose(2, 0, 1).reshape(-1, u)[kept]
    ends = np.append(0, kept.sum(axis=1).cumsum())
    plain = Sparse(value, columns[kept], ends, len(free.scalars))
    whitening = whitening_of(batch)
    return whitening @ plain, whitening @ raw[:m].T.ravel()


def whitening_of(batch: Batch) -> Sparse:
    """(n m, n m) what whitens residuals, observation by observation: roots of covariances and weights."""
    if batch.clusters is not None:
        return batch.whitening_matrix()
    weights = batch.weights[:, : batch.n].T
    if batch.is_correlated:
        roots = batch.whitened(np.repeat(np.eye(weights.shape[1])[:, :, None], batch.n, axis=2))
        return Sparse.of_blocks(weights[:, :, None] * roots.transpose(2, 0, 1))
    return Sparse.of_diagonal(weights.ravel())


def are_few(rows: Sparse) -> bool:
    """Whether rows (n, n_free) and their normal matrix are small as dense ones."""
    return bool(max(rows.shape) * rows.shape[1] <= FEW)


def add_cluster(
    rows: Sparse,
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
    product = rows.T @ rows
    row = np.repeat(np.arange(pattern.n), product.counts)
    lower = row >= product.columns
    keys = pattern.columns() * pattern.n + pattern.indices
    found = product.columns[lower].astype(np.int64) * pattern.n + row[lower]
    values[np.searchsorted(keys, found)] += product.values[lower]
    gradient += rows.T @ residuals
    return float(residuals @ residuals)
