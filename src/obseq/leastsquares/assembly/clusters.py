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
    from scipy.sparse import csr_array

    m, u = batch.shape.n_residuals, batch.shape.n_unknowns
    each = zip(batch.blocks, batch.shape.roles, strict=True)
    columns = np.hstack([free.number[table.consecutive(ids, role.size)] for ids, role in each])
    kept = (columns >= 0) & batch.active[:, None]
    value = raw[m:].reshape(m, u, batch.n).transpose(2, 0, 1)[np.repeat(kept[:, None], m, axis=1)]
    column = np.repeat(columns[:, None], m, axis=1)[np.repeat(kept[:, None], m, axis=1)]
    ends = np.append(0, np.cumsum(np.repeat(kept.sum(axis=1), m)))
    plain = csr_array((value, column, ends), shape=(m * batch.n, len(free.scalars)))
    return batch.whitening_matrix() @ plain


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
    transposed = rows.T.tocsr()
    product = transposed @ rows
    row = np.repeat(np.arange(pattern.n), np.diff(product.indptr))
    lower = row >= product.indices
    keys = pattern.columns() * pattern.n + pattern.indices
    found = product.indices[lower].astype(np.int64) * pattern.n + row[lower]
    values[np.searchsorted(keys, found)] += product.data[lower]
    gradient += transposed @ residuals
    return float(residuals @ residuals)
