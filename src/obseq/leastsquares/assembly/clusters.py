"""Observations that are correlated with one another: their rows, and their share of the normal equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from scipy.sparse import csr_array

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.numbering import FreeUnknowns
    from obseq.leastsquares.problem.unknowns import UnknownTable
    from obseq.leastsquares.solvers import SymmetricPattern


def cluster_keys(batches: Sequence[Batch], live: BoolArray, n: int) -> Iterator[IntArray]:
    """Keys low * n + high of the pairs of different live blocks (n_blocks,) that clusters join."""
    for batch in batches:
        for members in batch.clusters.members if batch.clusters is not None else ():
            blocks = np.unique(batch.blocks[:, members // batch.shape.n_residuals])
            blocks = blocks[live[blocks]]
            low, high = np.triu_indices(len(blocks), 1)
            yield blocks[low] * n + blocks[high]


def whitened_rows(table: UnknownTable, free: FreeUnknowns, batch: Batch, raw: FloatArray) -> csr_array:
    """(n n_residuals, n_free) derivatives, observation by observation, whitened and over their sigmas.

    Args:
        table: the unknowns.
        free: their numbering.
        batch: observations with clusters.
        raw: (n_residuals + n_residuals n_unknowns, n) residuals, then derivatives, as they are.
    """
    from scipy.sparse import coo_array, csr_array

    m, u = batch.shape.n_residuals, batch.shape.n_unknowns
    starts = table.start[batch.blocks]
    columns = np.concatenate(
        [
            free.number[start + np.arange(role.size)[:, None]]
            for start, role in zip(starts, batch.shape.roles, strict=True)
        ]
    )
    rows = np.arange(m)[:, None, None] + m * np.arange(batch.n)
    row, column = np.broadcast_arrays(rows, columns[None])
    value = raw[m:].reshape(m, u, batch.n)
    kept = (column >= 0) & batch.active
    entries = (value[kept], (row[kept], column[kept]))
    plain = coo_array(entries, shape=(m * batch.n, len(free.scalars))).tocsr()
    return csr_array(batch.whitening_matrix() @ plain)


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
    from scipy.sparse import tril

    product = tril(rows.T @ rows).tocoo()
    keys = pattern.columns() * pattern.n + pattern.indices
    np.add.at(
        values, np.searchsorted(keys, product.col.astype(np.int64) * pattern.n + product.row), product.data
    )
    gradient += rows.T @ residuals
    return float(residuals @ residuals)
