"""From the blocks that observations join to their places in the store: compiled loops over a batch."""

from __future__ import annotations

from obseq.arrays import BoolArray, IndexArray, IndexRows, IntRows, PositionArray, PositionRows
from obseq.compilation import compiled


@compiled
def list_pairs(blocks: IntRows, live: BoolArray, rows: IndexArray, columns: IndexArray, first: int) -> None:
    """Writes each pair of blocks that a batch joins, by pair of roles, observation, from the `first` on.

    `blocks` (n_roles, n). `live` (n_blocks,). Both of `rows` and `columns` are -1 where one is not live.
    """
    at = first
    for p in range(len(blocks)):
        for q in range(p):
            for k in range(blocks.shape[1]):
                row, column = blocks[p, k], blocks[q, k]
                is_live = live[row] and live[column]
                rows[at] = row if is_live else -1
                columns[at] = column if is_live else -1
                at += 1


@compiled
def place_blocks(
    blocks: IntRows,
    occurrence: IndexRows,
    own: PositionArray,
    position: PositionArray,
    height: PositionArray,
    has_spare: bool,
    pairs: IntRows,
    positions: PositionRows,
    heights: PositionRows,
) -> int:
    """Writes where the products of the derivatives of a batch are added; the number of pairs that are kept.

    Those of which every block has its place in the spare block are left out, where there are any such blocks.

    Args:
        blocks: (n_roles, n).
        occurrence: (n_role_pairs, n) number of each distinct pair, -1 where a block is not live.
        own: (n_blocks + 1,) place of each diagonal block, the spare one last.
        position: (n_pairs + 1,) the same for distinct pairs.
        height: (n_pairs + 1,) as of `BlockTable`.
        has_spare: whether any block has its place in the spare block.
        pairs: as of `BlockTable`, of all roles, then of all pairs of roles; those kept come first afterwards.
        positions: as of `BlockTable`.
        heights: as of `BlockTable`.
    """
    kept, n_threes, n, n_roles = 0, 0, blocks.shape[1], len(blocks)
    for k in range(len(pairs)):
        pair, places = pairs[k], positions[kept]
        if k < n_roles:
            is_used = take(own, blocks[k], places)
        else:
            is_used = take(position, occurrence[k - n_roles], places)
        if has_spare and not is_used:
            continue
        is_three = pair[4] >= 0
        for column in range(len(pair)):
            pairs[kept, column] = pair[column]
        if is_three:
            pairs[kept, 4] = n_threes
            take(height, occurrence[k - n_roles], heights[n_threes])
            n_threes += 1
        else:
            for row in range(n):
                places[row] //= 4
        pairs[kept, 5] = 2 * neighbours_alike(places) > n
        kept += 1
    return kept


@compiled
def take(places: PositionArray, numbers: IndexArray, taken: PositionArray) -> bool:
    """Writes the places of these numbers, the last one for -1; whether any is another than the last."""
    last = len(places) - 1
    is_used = False
    for k in range(len(numbers)):
        taken[k] = places[numbers[k] if numbers[k] >= 0 else last]
        is_used |= taken[k] != places[last]
    return is_used


@compiled
def neighbours_alike(places: PositionArray) -> int:
    """How many entries are as the one before them."""
    count = 0
    for k in range(1, len(places)):
        count += places[k] == places[k - 1]
    return count
