"""The pattern of the normal matrix: which blocks of unknowns meet, and where the lower triangle has them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.leastsquares.assembly.clusters import cluster_keys
from obseq.leastsquares.solvers import SymmetricPattern

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import BoolArray, IntArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.numbering import FreeUnknowns


FEW_KEYS = 1000
"""So many keys more than there are occurrences are listed rather than sorted."""


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
    occurrence: IntArray

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
    n = max(len(live), 1)
    joined = np.concatenate([_occurrences(batches, live), *cluster_keys(batches, live, n)])
    distinct, occurrence = _distinct(joined, n * n)
    if distinct.size and distinct[0] < 0:
        distinct, occurrence = distinct[1:], occurrence - 1
    return BlockPairs(distinct % n, distinct // n, occurrence)


def _occurrences(batches: Sequence[Batch], live: BoolArray) -> IntArray:
    """The keys of all occurrences; those of clusters come behind, which nothing is scattered to."""
    from obseq.leastsquares.loops.block_places import list_pairs

    counts = [batch.n * len(role_pairs(len(batch.blocks))) for batch in batches]
    keys, first = np.empty(sum(counts), dtype=np.int64), 0
    for batch, count in zip(batches, counts, strict=True):
        if count:
            list_pairs(batch.blocks, live, keys, first)
        first += count
    return keys


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
    distinct, inverse = _distinct(np.concatenate([live * (n + 1), low * n + high]), n * n)
    column, row = np.divmod(distinct, max(n, 1))
    nnz = int(count[row] @ count[column]) - int(count @ (count - 1)) // 2
    offsets, indptr = np.empty_like(row), np.empty(len(free.scalars) + 1, dtype=np.int64)
    indices = np.empty(nnz, dtype=np.int32)
    pattern_rows(column, row, count, free.first, offsets, indptr, indices)
    return SymmetricPattern(len(free.scalars), indptr, indices), offsets[inverse[len(live) :]]


def ranks(counts: IntArray) -> IntArray:
    """0, 1, ..., count - 1 for each count, one after the other."""
    return np.arange(counts.sum()) - (counts.cumsum() - counts).repeat(counts)


def _distinct(keys: IntArray, limit: int) -> tuple[IntArray, IntArray]:
    """The distinct ones of keys from -1 to before a limit, ascending, and which of them each key is."""
    if limit > FEW_KEYS + len(keys):
        return np.unique(keys, return_inverse=True)
    is_there = np.zeros(limit + 1, dtype=bool)
    is_there[keys + 1] = True
    rank = is_there.cumsum() - 1
    return is_there.nonzero()[0] - 1, rank[keys + 1]
