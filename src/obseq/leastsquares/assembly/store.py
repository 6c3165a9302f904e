"""Where assembly puts things: the store of the normal equations, and the place of each small block in it.

The front of the store is the sparse normal matrix itself: the lower triangle of the free unknowns by
columns. Pairs of blocks of three free unknowns, the common case, are added there directly. Behind it come
blocks of their own: one per block of unknowns (its diagonal block, and its share of the gradient as one
more column), and one per other pair, whole whether or not some unknowns are frozen; these are added to
the matrix at the end. A spare block takes what concerns frozen blocks. All is worked out once per set of
equations and frozen unknowns, without loops over observations.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from obseq.arrays import (
    BoolArray,
    FloatArray,
    IndexArray,
    IndexRows,
    IntArray,
    IntRows,
    PositionArray,
)
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.kernels.layout import LANES, STRIDE
from obseq.leastsquares.assembly.bodies import Fill, fill_of
from obseq.leastsquares.assembly.pattern import BlockPairs, block_pairs, matrix_pattern, role_pairs
from obseq.leastsquares.assembly.schur import elimination_groups, is_turned
from obseq.leastsquares.loops.loop_arguments import BlockTable, Groups, UnknownPlaces
from obseq.leastsquares.loops.sorting import as_indices, sorted_by
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.numbering import FreeUnknowns, free_unknowns
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solvers import SymmetricPattern

STORED_HEIGHT = 5
"""Height of the first column of a pair of threes in a block of its own: its columns start at 0, 4 and 7."""

LARGE = 2 << 16
"""Doubles of a store, a megabyte, from which on what its layout took is given back before it is made."""

MOST_DOUBLES = 2**32 - 1
"""Places in the store are 32-bit numbers."""


@dataclass(frozen=True)
class StoreLayout:
    """Places of all blocks, for one set of equations and frozen unknowns.

    Attributes:
        free: the numbering of the matrix.
        matrix: its pattern.
        unknowns: the blocks of unknowns, for loops.
        size: number of doubles of the store.
        diagonal: (n_blocks,) place of each diagonal block in units of four doubles; 0 where it has none.
        stored: (n_stored, 4) pairs to be added to the matrix: place, row block, column block, offset in the
            block column; sorted by the block of the two that comes first, whose columns they go to.
        batches: one layout per batch.
        groups: the eliminated blocks.
        fill: what elimination adds to the matrix.
        summed: (n_fill, 5) pairs of blocks of the fill: as of `Fill`, and the offset in the block column.
        first_eliminated: where the blocks of eliminated unknowns begin; they last until the next assembly.
        spare: (2,) place and length of the spare block.
    """

    free: FreeUnknowns
    matrix: SymmetricPattern
    unknowns: UnknownPlaces
    size: int
    diagonal: IntArray
    stored: IntArray
    batches: tuple[BlockTable, ...]
    groups: Groups
    fill: Fill
    summed: IntRows
    first_eliminated: int
    spare: IntArray


@dataclass(frozen=True)
class _Places:
    """Where blocks of their own begin (0 where a block has none), in doubles, and how long the store is."""

    pair: IntArray
    diagonal: IntArray
    spare: int
    spare_length: int
    first_eliminated: int
    size: int


@dataclass(frozen=True)
class _Addresses:
    """Where the loops find each block and each distinct pair, and as last entry the spare block; in doubles.

    Attributes:
        position: (n_pairs + 1,) place of each pair.
        height: (n_pairs + 1,) as of `BlockTable`.
        own: (n_blocks + 1,) place of each diagonal block.
        has_spare: whether any block has its place in the spare block.
    """

    position: PositionArray
    height: PositionArray
    own: PositionArray
    has_spare: bool


def store_layout(
    table: UnknownTable, batches: Sequence[Batch], used: BoolArray, eliminated: BoolArray | None = None
) -> StoreLayout:
    """Works out the layout.

    Args:
        table: unknowns.
        batches: equations.
        used: (n_blocks,) True for the blocks that some equation or prior touches.
        eliminated: (n_blocks,) True for the blocks to be eliminated before the matrix is formed; none when
            None.

    Raises:
        InputError: an observation joins two eliminated blocks, or the matrix is too large.
    """
    layout = _laid_out(table, batches, used, eliminated)
    if layout.size >= LARGE:
        _give_back()
    return layout


def _give_back() -> None:
    """Gives memory of arrays that are gone back to the system, where the C library keeps it for others."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


def _laid_out(
    table: UnknownTable, batches: Sequence[Batch], used: BoolArray, eliminated: BoolArray | None
) -> StoreLayout:
    eliminated = np.zeros(len(used), dtype=bool) if eliminated is None else eliminated
    free = free_unknowns(table, used & ~eliminated)
    loose = _with_free_unknowns(table, used & eliminated)
    pairs = block_pairs(batches, (free.count > 0) | loose)
    groups, met = elimination_groups(table, pairs, loose)
    groups, fill = fill_of(table, groups, met, free.count)
    has_loose = bool(len(groups.blocks))
    kept = ~(loose[pairs.rows] | loose[pairs.columns])
    matrix, offsets, of_fill = _pattern(free, pairs, fill, kept)
    direct = _direct(table.size, free, pairs)
    places = _places(table, matrix, free, pairs, direct, loose, groups)
    addressed = _addresses(free, matrix, pairs, offsets, direct, places)
    if has_loose:
        addressed.height[:-1] += is_turned(table, pairs, loose)
        groups.links[:, 0] = places.pair[groups.links[:, 0]]
        groups.inner[:, 0] = places.pair[groups.inner[:, 0]]
    apart = (kept & ~direct).nonzero()[0]
    stored = np.array([places.pair, pairs.rows, pairs.columns, offsets]).T[apart]
    stored = stored[sorted_by(as_indices(pairs.low[apart]), len(used))[0]]
    return StoreLayout(
        free=free,
        matrix=matrix,
        unknowns=UnknownPlaces(table.start, table.size, free.number, free.first, free.count, matrix.indptr),
        size=places.size,
        diagonal=places.diagonal // 4,
        stored=np.ascontiguousarray(stored),
        batches=_batch_layouts(batches, addressed, pairs.occurrence),
        groups=groups,
        fill=fill,
        summed=np.column_stack([fill.summed, of_fill]) if has_loose else np.zeros((0, 5), dtype=np.int64),
        first_eliminated=places.first_eliminated,
        spare=np.array([places.spare, places.spare_length]),
    )


def _addresses(
    free: FreeUnknowns,
    matrix: SymmetricPattern,
    pairs: BlockPairs,
    offsets: IntArray,
    direct: BoolArray,
    places: _Places,
) -> _Addresses:
    """Where the loops find what they add to: pairs that are `direct` in the matrix, at their offsets."""
    position, height = np.full(
        (2, len(pairs.rows) + 1), [[places.spare], [2 * STORED_HEIGHT]], dtype=np.uint32
    )
    position[:-1] = places.pair
    among = direct.nonzero()[0]
    if len(among):
        column = free.first[pairs.low[among]]
        top = matrix.indptr[column]
        position[among] = top + offsets[among]
        height[among] = 2 * (matrix.indptr[column + 1] - top) + (pairs.rows < pairs.columns)[among]
    own = np.empty(len(places.diagonal) + 1, dtype=np.uint32)
    own[:-1], own[-1] = places.diagonal, 0
    none = own == 0
    own[none] = places.spare
    return _Addresses(position, height, own, bool(np.count_nonzero(none) > 1))


def _pattern(
    free: FreeUnknowns, pairs: BlockPairs, fill: Fill, kept: BoolArray
) -> tuple[SymmetricPattern, IntArray, IntArray]:
    """The matrix, and the offsets in its block columns of pairs (n_pairs,) and of the fill (n_fill,)."""
    low, high, joined = pairs.low, pairs.high, fill.low < fill.high
    offsets, of_fill = np.zeros(len(kept), dtype=np.int64), np.zeros(len(joined), dtype=np.int64)
    if not len(joined) and kept.all():
        return *matrix_pattern(free, low, high), of_fill
    low, high = np.append(low[kept], fill.low[joined]), np.append(high[kept], fill.high[joined])
    matrix, found = matrix_pattern(free, low, high)
    n_kept = np.count_nonzero(kept)
    offsets[kept], of_fill[joined] = found[:n_kept], found[n_kept:]
    return matrix, offsets, of_fill


def _with_free_unknowns(table: UnknownTable, blocks: BoolArray) -> BoolArray:
    """(n_blocks,) True for those of the blocks that have a free unknown."""
    if not blocks.any():
        return blocks
    taken = ~table.frozen & np.repeat(blocks, table.size)
    return np.asarray(np.add.reduceat(taken, table.start, dtype=np.int64) > 0)


def _places(
    table: UnknownTable,
    matrix: SymmetricPattern,
    free: FreeUnknowns,
    pairs: BlockPairs,
    direct: BoolArray,
    loose: BoolArray,
    groups: Groups,
) -> _Places:
    """Places behind the matrix: spare block, diagonal blocks, pairs; then the same for eliminated blocks."""
    spare, part = (matrix.nnz + 11) // 8 * 8, part_width(table.size)
    widths, width = part * (table.size + 1), part[pairs.rows] * table.size[pairs.columns]
    length = int(widths.max(initial=0))
    diagonal, end = _consecutive(widths, free.count > 0, spare + length)
    joining = loose[pairs.rows] | loose[pairs.columns]
    pair, middle = _consecutive(width, ~(direct | joining), end)
    end = middle
    if loose.any():
        loose_diagonal, end = _consecutive(widths, loose, middle)
        diagonal = diagonal + loose_diagonal
        # in the order of the links, so that one elimination reads one stretch of memory
        for joined in (groups.links[:, 0], groups.inner[:, 0]):
            every = np.ones(len(joined), dtype=bool)
            pair[joined], end = _consecutive(width[joined], every, end)
    if end > MOST_DOUBLES:
        raise InputError(
            "the normal matrix has more than 4e9 numbers: eliminate unknowns, or split the system"
        )
    return _Places(pair, diagonal, spare, length, middle, end)


def part_width(size: IntArray) -> IntArray:
    """Doubles of a record part: derivatives, residual, zeros up to a multiple of four."""
    return np.asarray((size + 4) // 4 * 4)


def _direct(size: IntArray, free: FreeUnknowns, pairs: BlockPairs) -> BoolArray:
    """(n_pairs,) True for pairs of two different blocks of three free unknowns."""
    whole = (size == 3) & (free.count == 3)
    return np.asarray(whole[pairs.rows] & whole[pairs.columns] & (pairs.rows != pairs.columns))


def _consecutive(widths: IntArray, present: BoolArray, first: int) -> tuple[IntArray, int]:
    """Consecutive places from `first` on for the blocks present (0 for the others), and the end."""
    taken = widths * present
    ends = first + taken.cumsum()
    return (ends - taken) * present, int(ends[-1]) if len(ends) else first


def _batch_layouts(
    batches: Sequence[Batch], places: _Addresses, occurrence: IndexArray
) -> tuple[BlockTable, ...]:
    result, first = [], 0
    for batch in batches:
        count = len(role_pairs(len(batch.blocks)))
        last = first + batch.n * count
        result.append(_batch_layout(batch, places, occurrence[first:last].reshape(count, batch.n)))
        first = last
    return tuple(result)


def _batch_layout(batch: Batch, places: _Addresses, occurrence: IndexRows) -> BlockTable:
    from obseq.leastsquares.loops.block_places import place_blocks

    shape, record = batch.shape, _record(tuple([(role.row, role.size) for role in batch.shape.roles]))
    pairs = record.pairs.copy()
    positions = np.empty((len(pairs), batch.n), dtype=np.uint32)
    heights = np.empty((record.n_threes, batch.n), dtype=np.uint32)
    addresses = places.own, places.position, places.height, places.has_spare
    kept = place_blocks(batch.blocks, occurrence, *addresses, pairs, positions, heights)
    pairs, width = pairs[:kept], len(record.rows)
    return BlockTable(
        record.rows,
        pairs,
        positions[:kept],
        heights[: np.count_nonzero(pairs[:, 4] >= 0)],
        shape.n_residuals * (LANES * width + STRIDE * (1 + shape.n_unknowns)) + STRIDE,
    )


class _Record(NamedTuple):
    """The parts of the records of a formula.

    Attributes:
        rows: as of `BlockTable.record_rows`.
        pairs: (n_roles + n_role_pairs, 6) as of `BlockTable`, of the roles, then of pairs of roles; 0 for
            whether blocks come in runs.
        n_threes: pairs of roles that have three unknowns both.
    """

    rows: IntArray
    pairs: IntRows
    n_threes: int


@lru_cache
def _record(roles: tuple[tuple[int, int], ...]) -> _Record:
    """The record of roles (row, size)."""
    sizes = np.array([size for _, size in roles], dtype=np.int64)
    widths = part_width(sizes)
    part = widths.cumsum() - widths
    rows = np.full(int(widths.sum()), -1, dtype=np.int64)
    for (row, size), first in zip(roles, part, strict=True):
        rows[first : first + size] = 1 + row + np.arange(size)
        rows[first + size] = 0
    p, q = np.array(role_pairs(len(roles)), dtype=np.int64).reshape(-1, 2).T
    threes, none = (sizes[p] == 3) & (sizes[q] == 3), np.zeros_like(sizes)
    own = np.array([part, part, widths // 4, sizes + 1, none - 1, none]).T
    number = np.where(threes, threes.cumsum(), 0) - 1
    joined = np.array([part[p], part[q], widths[p] // 4, sizes[q], number, none[p]]).T
    return _Record(rows, np.concatenate([own, joined]), int(np.count_nonzero(threes)))


def aligned_zeros(n: int) -> FloatArray:
    """(n,) zeros at a 64-byte boundary."""
    buffer = np.zeros(n + 8)
    offset = (-buffer.ctypes.data % 64) // 8
    return buffer[offset : offset + n]
