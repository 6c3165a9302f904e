"""The pattern of the normal matrix: which blocks of unknowns meet, and where the lower triangle has them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from obseq.arrays import BoolArray, IndexArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.leastsquares.assembly.clusters import cluster_pairs
from obseq.leastsquares.loops.sorting import as_indices, distinct_pairs
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.numbering import FreeUnknowns
from obseq.leastsquares.solvers import SymmetricPattern


@dataclass(frozen=True)
class BlockPairs:
    """Distinct ordered pairs of blocks that some observation joins, sorted by column, then row.

    Attributes:
        rows: (n_pairs,) block of the row part.
        columns: (n_pairs,) block of the column part.
        occurrence: (n_occurrences,) pair of each occurrence, by batch, pair of roles, observation; -1
            where a block is frozen.
    """

    rows: IntArray
    columns: IntArray
    occurrence: IndexArray

    @cached_property
    def low(self) -> IntArray:
        """(n_pairs,) the block of the two that comes first: its columns hold the pair."""
        return np.minimum(self.rows, self.columns)

    @cached_property
    def high(self) -> IntArray:
        """(n_pairs,) the block of the two that comes last."""
        return np.maximum(self.rows, self.columns)


@cache
def role_pairs(n_roles: int) -> tuple[tuple[int, int], ...]:
    """Pairs of roles of a formula, (row part, column part), in the order in which everything lists them."""
    return tuple((p, q) for p in range(n_roles) for q in range(p))


def block_pairs(batches: Sequence[Batch], live: BoolArray) -> BlockPairs:
    """Every pair of live blocks (n_blocks,) that some observation joins."""
    rows, columns, n_scattered = _occurrences(batches, live)
    found = distinct_pairs(columns, rows, len(live), len(live))
    return BlockPairs(found.second, found.first, found.number[:n_scattered])


def _occurrences(batches: Sequence[Batch], live: BoolArray) -> tuple[IndexArray, IndexArray, int]:
    """Row and column block of all occurrences, -1 where one of the two is not live, and how many there are.

    Those of clusters come behind, which nothing is scattered to.
    """
    from obseq.leastsquares.loops.block_places import list_pairs

    counts = [batch.n * len(role_pairs(len(batch.blocks))) for batch in batches]
    joined = [pairs for batch in batches for pairs in cluster_pairs(batch, live)]
    n_scattered = sum(counts)
    rows, columns = np.empty((2, n_scattered + sum(pairs.shape[1] for pairs in joined)), dtype=np.int32)
    first = 0
    for batch, count in zip(batches, counts, strict=True):
        if count:
            list_pairs(batch.blocks, live, rows, columns, first)
        first += count
    for pairs in joined:
        last = first + pairs.shape[1]
        columns[first:last], rows[first:last] = pairs
        first = last
    return rows, columns, n_scattered


def matrix_pattern(free: FreeUnknowns, low: IntArray, high: IntArray) -> tuple[SymmetricPattern, IntArray]:
    """Pattern of the lower triangle; offset (n_pairs,) of each pair below the top of its block column.

    Args:
        free: numbering.
        low: (n_pairs,) first block of each pair of different blocks that meet; pairs may come more than once.
        high: (n_pairs,) second block.
    """
    from obseq.leastsquares.loops.blocks_to_matrix import pattern_rows

    n, count = len(free.count), free.count
    live = count.nonzero()[0]
    found = distinct_pairs(
        as_indices(np.concatenate([live, low])), as_indices(np.concatenate([live, high])), n, n
    )
    column, row = found.first, found.second
    nnz = int(count[row] @ count[column]) - int(count @ (count - 1)) // 2
    offsets, indptr = np.empty_like(row), np.empty(len(free.scalars) + 1, dtype=np.int64)
    indices = np.empty(nnz, dtype=np.int32)
    pattern_rows(column, row, count, free.first, offsets, indptr, indices)
    return SymmetricPattern(len(free.scalars), indptr, indices), offsets[found.number[len(live) :]]


def ranks(counts: IntArray) -> IntArray:
    """0, 1, ..., count - 1 for each count, one after the other."""
    return np.arange(counts.sum()) - (counts.cumsum() - counts).repeat(counts)
