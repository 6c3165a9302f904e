"""Bodies: blocks that the same groups of eliminated blocks meet, treated as one by the elimination.

The centre, the rotation and the calibration of an image are three blocks, and every tie point that meets one
of them meets all: nine unknowns side by side are multiplied at once, and one place is found instead of nine.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import IndexArray, IntArray, IntRows, PositionArray
from obseq.dataclass import dataclass
from obseq.leastsquares.assembly.schur import Met
from obseq.leastsquares.loops.loop_arguments import Bodies, Groups
from obseq.leastsquares.loops.sorting import as_indices, distinct_pairs, sorted_by
from obseq.leastsquares.problem.unknowns import UnknownTable


@dataclass(frozen=True)
class Fill:
    """What elimination adds to the matrix: bodies, and the pairs of blocks that their sums consist of.

    Attributes:
        bodies: as the loops take them.
        size: doubles of the sums of all pairs of bodies.
        pulls: (n,) places of the unknowns of all bodies among the sums of the gradient.
        blocks: (n_members,) the blocks of all bodies, body by body: theirs are the unknowns of `pulls`.
        low: (n_pairs,) the first block of each pair of blocks, as the matrix has it; ascending.
        high: (n_pairs,) the other one, or the same.
        summed: (n_pairs, 4) place among the sums, distance of columns, row block, column block.
    """

    bodies: Bodies
    size: int
    pulls: IntArray
    blocks: IntArray
    low: IntArray
    high: IntArray
    summed: IntRows


@dataclass(frozen=True)
class _Members:
    """The blocks of the bodies.

    Attributes:
        blocks: (n_members,) body by body, ascending within each.
        bounds: (n_bodies + 1,) where those of each body begin.
        place: (n_members,) where each begins in the rows of its body.
        column: (n_members,) number of its first unknown within its body.
        count: (n_members,) number of its unknowns.
    """

    blocks: IntArray
    bounds: IntArray
    place: IntArray
    column: IntArray
    count: IntArray


def fill_of(table: UnknownTable, groups: Groups, met: Met, count: IntArray) -> tuple[Groups, Fill]:
    """The bodies that groups meet, and the groups with the places of their links in their rows.

    Args:
        table: the unknowns.
        groups: the groups.
        met: the blocks that they meet.
        count: (n_blocks,) unknowns of each block in the matrix.
    """
    if not len(met.blocks):
        return groups, _no_fill(len(met.bounds) - 1)
    body = _bodies(met, len(count))
    members = _members(body, count)
    heights = _padded(members, np.diff(members.bounds))
    group = np.repeat(np.arange(len(met.bounds) - 1), np.diff(met.bounds))
    found = distinct_pairs(as_indices(group), body[met.blocks], len(met.bounds) - 1, len(heights))
    slots, bounds = found.second, found.starts
    ends = np.concatenate([[0], np.cumsum(heights[slots])])
    part = ends[:-1] - np.repeat(ends[bounds[:-1]], np.diff(bounds))
    place = np.zeros(len(count), dtype=np.int64)
    place[members.blocks] = members.place
    groups.links[:, 1] = (part[found.number] + place[met.blocks])[met.of_link]
    width = np.add.reduceat(members.count, members.bounds[:-1])
    pairs, sums, places = _pairs(slots, bounds, found.first, heights, width)
    columns, column_bounds = _columns(members)
    pulls = np.cumsum(heights) - heights
    widest = int(np.max(np.diff(ends[bounds]), initial=0)) + 4
    bodies = Bodies(slots, bounds, part, places, columns, column_bounds, heights, pulls, widest)
    summed = _summed(members, pairs, heights, sums)
    order, _ = sorted_by(as_indices(summed[:, 2:].min(axis=1)), len(count))
    summed = summed[order]
    whole = np.repeat(pulls, np.diff(column_bounds)) + columns
    ends = summed[:, 2:]
    fill = Fill(bodies, int(sums[-1]), whole, members.blocks, ends.min(axis=1), ends.max(axis=1), summed)
    return groups._replace(threes=_threes(table, groups, met, count)), fill


def _no_fill(n_groups: int) -> Fill:
    none, bounds = np.zeros(0, dtype=np.int64), np.zeros(n_groups + 1, dtype=np.int64)
    bodies = Bodies(none, bounds, none, none.astype(np.uint32), none, bounds[:1], none, none, 4)
    return Fill(bodies, 0, none, none, none, none, none.reshape(0, 4))


def _bodies(met: Met, n_blocks: int) -> IndexArray:
    """(n_blocks,) body of each block, numbered by the lowest block of each; -1 where no group meets it."""
    order, bounds = sorted_by(as_indices(met.blocks), n_blocks)
    groups = np.repeat(np.arange(len(met.bounds) - 1), np.diff(met.bounds))[order]
    numbers: dict[bytes, int] = {}
    bodies = np.full(n_blocks, -1, dtype=np.int32)
    for block in np.diff(bounds).nonzero()[0].tolist():
        who = groups[bounds[block] : bounds[block + 1]].tobytes()
        bodies[block] = numbers.setdefault(who, len(numbers))
    return bodies


def _members(body: IndexArray, count: IntArray) -> _Members:
    blocks, bounds = sorted_by(body, int(body.max(initial=-1)) + 1)
    padded = (count[blocks] + 3) // 4 * 4
    return _Members(
        blocks.astype(np.int64),
        bounds,
        _from_first(padded, bounds),
        _from_first(count[blocks], bounds),
        count[blocks],
    )


def _from_first(sizes: IntArray, bounds: IntArray) -> IntArray:
    """Where each of consecutive parts begins, counted from the first one of its stretch."""
    ends = np.concatenate([[0], np.cumsum(sizes)])
    return np.asarray(ends[:-1] - np.repeat(ends[bounds[:-1]], np.diff(bounds)))


def _padded(members: _Members, lengths: IntArray) -> IntArray:
    """(n_bodies,) length of the rows of each body."""
    last = np.cumsum(lengths) - 1
    return np.asarray(members.place[last] + (members.count[last] + 3) // 4 * 4)


def _columns(members: _Members) -> tuple[IntArray, IntArray]:
    """Places of all unknowns within their bodies, and where those of each body begin."""
    within = _from_first(np.ones(members.count.sum(), dtype=np.int64), np.append(0, np.cumsum(members.count)))
    ends = np.concatenate([[0], np.cumsum(members.count)])
    return np.repeat(members.place, members.count) + within, ends[members.bounds]


def _pairs(
    slots: IntArray, bounds: IntArray, group: IntArray, heights: IntArray, width: IntArray
) -> tuple[IntRows, IntArray, PositionArray]:
    """Pairs of bodies (high, low) that groups meet, where their sums begin, and `places` as of `Bodies`.

    Args:
        slots: as of `Bodies`.
        bounds: the same.
        group: (n_slots,) group of each slot.
        heights: (n_bodies,) lengths of the rows of bodies.
        width: (n_bodies,) their unknowns.
    """
    from obseq.leastsquares.loops.neighbours import join_bodies, place_bodies

    n = len(heights)
    used_by = bounds, slots, group, *sorted_by(as_indices(slots), n)
    pairs = np.empty((0, 2), dtype=np.int64)
    pairs = np.empty((join_bodies(*used_by, np.full(n, -1), pairs), 2), dtype=np.int64)
    join_bodies(*used_by, np.full(n, -1), pairs)
    sums = np.concatenate([[0], np.cumsum(heights[pairs[:, 0]] * width[pairs[:, 1]])])
    met = np.diff(bounds)
    ends = np.cumsum(met * (met + 1) // 2)
    places = np.empty(ends[-1], dtype=np.uint32)
    place_bodies(*used_by, pairs, sums, np.empty(n, dtype=np.int64), ends - met * (met + 1) // 2, places)
    return pairs, sums, places


def _summed(members: _Members, pairs: IntRows, heights: IntArray, sums: IntArray) -> IntRows:
    """(n_pairs, 4) as of `Fill`: the pairs of blocks of all pairs of bodies, each once."""
    n, (high, low) = np.diff(members.bounds), pairs.T
    each = n[high] * n[low]
    pair = np.repeat(np.arange(len(high)), each)
    number = np.arange(len(pair)) - np.repeat(np.cumsum(each) - each, each)
    row = members.bounds[high[pair]] + number % n[high[pair]]
    column = members.bounds[low[pair]] + number // n[high[pair]]
    place = sums[pair] + members.column[column] * heights[high[pair]] + members.place[row]
    summed = np.column_stack([place, heights[high[pair]], members.blocks[row], members.blocks[column]])
    return np.asarray(summed[(high != low)[pair] | (row >= column)])


def _threes(table: UnknownTable, groups: Groups, met: Met, count: IntArray) -> IntArray:
    """(n_groups,) as of `Groups`."""
    n = len(groups.block_bounds) - 1
    first = groups.blocks[groups.block_bounds[:-1]]
    is_three = (np.diff(groups.block_bounds) == 1) & (table.size[first] == 3)
    is_three[is_three] = groups.local[table.start[first[is_three]] + 2] == 2
    is_linked_once = np.diff(groups.link_bounds) == np.diff(met.bounds)
    other = (count[met.blocks] != 3) | (table.size[met.blocks] != 3)
    of_met = np.repeat(np.arange(n), np.diff(met.bounds))
    meets_threes = np.bincount(of_met, other, minlength=n) == 0
    return np.asarray(is_three & is_linked_once & meets_threes, dtype=np.int64)
