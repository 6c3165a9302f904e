"""The compiled loops of shared assembly: which blocks need a copy, and adding the copies up."""

from __future__ import annotations

import numpy as np

from obseq.arrays import ByteArray, FloatArray, IntArray, IntRows, PositionArray
from obseq.compilation import compiled
from obseq.leastsquares.loops.loop_arguments import BlockTable, Span

STORED_HEIGHT = 5
"""Height of a pair of threes in a block of its own, as in `layout`."""

STORED_THREES = 12
"""Doubles of such a block."""


@compiled
def divert(
    table: BlockTable,
    span: Span,
    share: int,
    spare: IntArray,
    owner: ByteArray,
    copy: PositionArray,
    moves: IntRows,
    state: IntArray,
) -> None:
    """Sends one share of a batch to copies of the blocks that earlier shares own, as long as there is room.

    Args:
        table: of the batch; its positions and heights are changed.
        span: observations of the share.
        share: number of the share, from 0.
        spare: (2,) place and length of the block that takes what concerns frozen blocks.
        owner: (size,) one plus the share that owns the block at each place, 0 for none yet; changed.
        copy: (size,) place of this share's copy of the block at each place, 0 for none yet; changed.
        moves: (most, 4) as in `Shares`, written.
        state: (4,) pair and observation to go on from, moves written, where the next copy may begin; changed.
            All is done when the pair is the one behind the last.
    """
    positions, heights = table.positions, table.heights
    for pair in range(state[0], len(table.pairs)):
        threes = table.pairs[pair, 4]
        unit = 1 if threes >= 0 else 4
        length = STORED_THREES if threes >= 0 else 4 * table.pairs[pair, 2] * table.pairs[pair, 3]
        begin = max(span.first, state[1]) if pair == state[0] else span.first
        for k in range(begin, span.last):
            place = unit * np.int64(positions[pair, k])
            if owner[place] == 0:
                owner[place] = share + 1
            if owner[place] == share + 1:
                continue
            code = np.int64(heights[threes, k]) if threes >= 0 else 0
            is_direct = threes >= 0 and place < spare[0]
            if copy[place] == 0:
                n, end = state[2], state[3]
                if n == len(moves):
                    state[0], state[1] = pair, k
                    return
                moves[n, 0], moves[n, 1] = place, end
                moves[n, 2] = 0 if place == spare[0] else length
                moves[n, 3] = code >> 1 if is_direct else 0
                copy[place] = end
                state[2] = n + 1
                state[3] = end + (spare[1] if place == spare[0] else length)
            positions[pair, k] = copy[place] // unit
            if is_direct:
                heights[threes, k] = 2 * STORED_HEIGHT + (code & 1)
    state[0] = len(table.pairs)


@compiled
def add_copies(store: FloatArray, moves: IntRows) -> None:
    """Adds each copy to its block, and clears it; `moves` as in `Shares`."""
    for k in range(len(moves)):
        place, source, length, height = moves[k, 0], moves[k, 1], moves[k, 2], moves[k, 3]
        if height > 0:
            for j in range(3):
                target, column = place + j * height - j * (j + 1) // 2, source + j * (9 - j) // 2
                for i in range(3):
                    store[target + i] += store[column + i]
        else:
            for i in range(length):
                store[place + i] += store[source + i]
        store[source : source + length] = 0.0
