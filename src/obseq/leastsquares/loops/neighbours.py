"""Which blocks, and which bodies of them, the groups of eliminated blocks meet: compiled loops."""

from __future__ import annotations

from obseq.arrays import IndexArray, IntArray, IntRows, PositionArray, PositionRows
from obseq.compilation import compiled


@compiled
def list_neighbours(
    rows: IntArray, columns: IntArray, group: IndexArray, of_group: IndexArray, other: IndexArray
) -> None:
    """Writes the group that each pair of blocks leads from, and the block that it leads to; -1 for others.

    `group` (n_blocks,) is -1 for blocks that are not eliminated.
    """
    for k in range(len(rows)):
        a, b = group[rows[k]], group[columns[k]]
        joins = (a < 0) != (b < 0)
        of_group[k] = max(a, b) if joins else -1
        other[k] = (rows[k] if a < 0 else columns[k]) if joins else -1


@compiled
def write_links(
    rows: IntArray,
    columns: IntArray,
    size: IntArray,
    group: IndexArray,
    order: IndexArray,
    links: PositionRows,
) -> None:
    """Writes the links that some pairs of blocks are, as of `Groups`; places are numbers of pairs as yet."""
    for k in range(len(order)):
        pair = order[k]
        row, column = rows[pair], columns[pair]
        is_column = group[column] >= 0
        links[k, 0], links[k, 1] = pair, 0
        links[k, 2] = row if is_column else column
        links[k, 3] = column if is_column else row
        links[k, 4] = is_column or (size[row] == 3 and size[column] == 3)


@compiled
def join_bodies(
    bounds: IntArray,
    slots: IntArray,
    group: IntArray,
    users: IndexArray,
    user_bounds: IntArray,
    seen: IntArray,
    pairs: IntRows,
) -> int:
    """Writes the pairs (high, low) of bodies that groups meet, the same twice too; how many there are.

    Args:
        bounds: as of `Bodies`.
        slots: the same.
        group: (n_slots,) group of each slot.
        users: (n_slots,) slots, body by body.
        user_bounds: (n_bodies + 1,) where those of each body begin.
        seen: (n_bodies,) room, -1 before.
        pairs: (n_pairs, 2); without room for any they are counted only.
    """
    count = 0
    for high in range(len(seen)):
        for slot in users[user_bounds[high] : user_bounds[high + 1]]:
            for k in range(bounds[group[slot]], slot + 1):
                low = slots[k]
                if seen[low] != high:
                    seen[low] = high
                    if len(pairs):
                        pairs[count, 0], pairs[count, 1] = high, low
                    count += 1
    return count


@compiled
def place_bodies(
    bounds: IntArray,
    slots: IntArray,
    group: IntArray,
    users: IndexArray,
    user_bounds: IntArray,
    pairs: IntRows,
    sums: IntArray,
    place: IntArray,
    first: IntArray,
    places: PositionArray,
) -> None:
    """Writes `places` as of `Bodies`, from where the `sums` of each of the `pairs` begin.

    `first` (n_groups,): where the pairs of each group begin in `places`. `place` (n_bodies,) is room.
    Others as in `join_bodies`.
    """
    at = 0
    for high in range(len(place)):
        while at < len(pairs) and pairs[at, 0] == high:
            place[pairs[at, 1]] = sums[at] // 4
            at += 1
        for slot in users[user_bounds[high] : user_bounds[high + 1]]:
            begin = bounds[group[slot]]
            a = slot - begin
            row = first[group[slot]] + a * (a + 1) // 2
            for b in range(a + 1):
                places[row + b] = place[slots[begin + b]]
