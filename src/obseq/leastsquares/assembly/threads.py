"""Assembly and evaluation by several threads.

Each thread takes a share of the observations of every batch: consecutive ones, in whole tiles. All shares
add to the same store. A small block that an earlier share adds to as well is diverted: the later share has a
copy of its own of that block behind the store, and the copies are added to the blocks at the end, share by
share. So no two threads write to one place, nothing is locked, and the sums are the same at each run with the
same number of threads. Observations listed by station or by image have few such blocks; in any order, the
copies of a share are at most one more store.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from obseq.arrays import ByteArray, IntArray, IntRows, PositionArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.kernels.layout import LANES
from obseq.leastsquares.assembly.store import StoreLayout
from obseq.leastsquares.loops.loop_arguments import BlockTable, Span
from obseq.leastsquares.problem.arguments import whole
from obseq.pools import thread_pool

Result = TypeVar("Result")


LEAST_SHARE = 8192
"""Observations of a share: a millisecond of work, ten times what it costs to start a thread."""

MOST_THREADS = 64

MOVES_AT_ONCE = 4096
"""Moves that are noted in one go."""


@dataclass(frozen=True)
class Shares:
    """What each thread does, and what is added up afterwards.

    Attributes:
        bounds: (n_shares + 1, n_batches) first observation of each share in each batch; the ends.
        moves: (n_moves, 4) place of a block, place of its copy, number of doubles, and height of its first
            column where it is a pair of threes in the matrix, else 0; in the order of the shares.
        size: doubles of the store with all copies.
    """

    bounds: IntArray
    moves: IntArray
    size: int

    def __len__(self) -> int:
        return len(self.bounds) - 1


def checked_threads(threads: int) -> int:
    """The number of threads, if it is one.

    Raises:
        InputError: it is not from 1 to 64.
    """
    if not 1 <= whole(threads, "threads") <= MOST_THREADS:
        raise InputError(f"{threads} threads: give a number from 1 to {MOST_THREADS}")
    return threads


def share_count(n: int, threads: int) -> int:
    """How many share n observations."""
    return max(1, min(threads, n // LEAST_SHARE))


def share_bounds(counts: Sequence[int], threads: int) -> IntArray:
    """(n_shares + 1, n_batches) where shares of batches of so many observations begin, and the ends.

    There are as many shares as threads, fewer when each would have less than `LEAST_SHARE` observations.
    """
    shares = share_count(sum(counts), threads)
    if shares == 1:
        return np.array([[0] * len(counts), counts], dtype=np.int64)
    n = np.array(counts, dtype=np.int64)
    tiles = -(-n // LANES)
    return np.asarray(np.minimum(np.arange(shares + 1)[:, None] * tiles // shares * LANES, n))


def column_bounds(columns: IntArray, shares: int) -> IntArray:
    """(shares + 1,) bounds of about equal parts of sorted columns (n,), none in two parts."""
    n = len(columns)
    if not n:
        return np.zeros(2, dtype=np.int64)
    inner = np.arange(1, shares) * n // shares
    return np.concatenate([[0], np.searchsorted(columns, columns[inner]), [n]])


def share_out(layout: StoreLayout, counts: Sequence[int], threads: int) -> Shares:
    """Divides the observations of all batches; diverts positions, in place, where shares would meet.

    Args:
        layout: where the batches scatter to; its positions and heights are changed.
        counts: observations of each batch.
        threads: shares wanted.

    Raises:
        InputError: the store with its copies is too large.
    """
    bounds = share_bounds(counts, threads)
    if len(bounds) == 2:
        return Shares(bounds, np.zeros((0, 4), dtype=np.int64), layout.size)
    owner = np.zeros(layout.size, dtype=np.uint8)
    copy = np.zeros(layout.size, dtype=np.uint32)
    found, end = [], -(-layout.size // 8) * 8
    for share in range(len(bounds) - 1):
        copy[:] = 0
        for table, first, last in zip(layout.batches, bounds[share], bounds[share + 1], strict=True):
            span = Span(int(first), int(last))
            moves, end = _diverted(table, span, share, layout.spare, owner, copy, end)
            found.append(moves)
        if end > np.iinfo(np.uint32).max:
            raise InputError("the normal matrix has more than 4e9 numbers: use fewer threads, or one")
    return Shares(bounds, np.concatenate(found), end)


def _diverted(
    table: BlockTable,
    span: Span,
    share: int,
    spare: IntArray,
    owner: ByteArray,
    copy: PositionArray,
    end: int,
) -> tuple[IntRows, int]:
    """The moves of one share of a batch, (n, 4), and the new end; arguments as `divert` takes them."""
    from obseq.leastsquares.loops.shares import divert

    found, state = [np.empty((0, 4), dtype=np.int64)], np.array([0, 0, 0, end])
    while state[0] < len(table.pairs):
        state[2] = 0
        moves = np.empty((MOVES_AT_ONCE, 4), dtype=np.int64)
        divert(table, span, share, spare, owner, copy, moves, state)
        found.append(moves[: state[2]])
    return np.concatenate(found), int(state[3])


def in_threads(work: Callable[[int], Result], n: int) -> list[Result]:
    """Results of work(0), ..., work(n - 1), each in a thread of its own; one alone is done by the caller."""
    if n == 1:
        return [work(0)]
    with thread_pool(n) as pool:
        return list(pool.map(work, range(n)))
