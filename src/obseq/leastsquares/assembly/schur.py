"""Temporaries: blocks of unknowns eliminated before the matrix is formed, found again afterwards.

A block such as a tie point meets only the blocks that observe it; so does a group of blocks that
observations join, such as the pose of a sub-network. The unknowns t of a group are eliminated exactly
(Schur):

    N <- N - N_kt N_tt^-1 N_tk,   g <- g - N_kt N_tt^-1 g_t,   t = -N_tt^-1 (g_t + N_tk k)

for the other unknowns k, group by group, so that only these enter the matrix that the solver factors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.loops.tables import Groups

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, IntArray, PositionArray
    from obseq.leastsquares.assembly.pattern import BlockPairs
    from obseq.leastsquares.problem.unknowns import UnknownTable


LARGEST = 1000
"""Unknowns of one group: beyond, a dense elimination takes longer than the sparse matrix would."""

PORTION = 4_000_000
"""Pairs of neighbours that are looked at together: 32 MB."""


def _pair_keys(groups: Groups, n: int) -> Iterator[IntArray]:
    """Keys low * n + high of all pairs of neighbours, in the order of elimination, in portions."""
    if not len(groups.blocks):
        return
    from obseq.leastsquares.loops.schur_complement import neighbour_pairs

    met = np.diff(groups.bounds)
    total = np.concatenate([[0], np.cumsum(met * (met - 1) // 2)])
    first = 0
    while first < len(met):
        last = max(first + 1, int(np.searchsorted(total, total[first] + PORTION, side="right")) - 1)
        keys = np.empty(total[last] - total[first], dtype=np.int64)
        neighbour_pairs(groups.bounds, groups.neighbours, first, last, n, keys)
        yield keys
        first = last


def fill_keys(groups: Groups, n: int) -> IntArray:
    """The distinct keys of pairs of neighbours, ascending."""
    distinct = np.zeros(0, dtype=np.int64)
    for keys in _pair_keys(groups, n):
        distinct = np.union1d(distinct, keys)
    return distinct


def fill_offsets(groups: Groups, n: int, distinct: IntArray, offsets: IntArray) -> PositionArray:
    """(n_pairs,) offset of each pair of neighbours, from those of the distinct keys."""
    found = [offsets[np.searchsorted(distinct, keys)].astype(np.uint32) for keys in _pair_keys(groups, n)]
    return np.concatenate(found) if found else np.zeros(0, dtype=np.uint32)


def placed(groups: Groups, places: IntArray, free: IntArray) -> Groups:
    """The same with the places of the pairs instead of their numbers, and the rows of each group laid out.

    Args:
        groups: the groups.
        places: (n_pairs,) places in the store.
        free: (n_blocks,) free unknowns of each block.
    """
    if not len(groups.blocks):
        return groups
    links, inner = groups.links.copy(), groups.inner.copy()
    links[:, 0] = places[links[:, 0]]
    inner[:, 0] = places[inner[:, 0]]
    widths = (free[groups.neighbours] + 3) // 4 * 4
    ends = np.concatenate([[0], np.cumsum(widths)])
    part = ends[:-1] - np.repeat(ends[groups.bounds[:-1]], np.diff(groups.bounds))
    widest = int(np.max(np.diff(ends[groups.bounds]), initial=4))
    return groups._replace(links=links, inner=inner, part=part, widest=widest)


def elimination_groups(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> Groups:
    """Groups of the eliminated blocks (n_blocks,) that are in use; places are numbers of pairs as yet.

    Raises:
        InputError: observations join too many eliminated blocks to one another.
    """
    if not eliminated.any():
        return _no_groups(table.n_scalars)
    of_row, of_column = eliminated[pairs.rows], eliminated[pairs.columns]
    within = np.flatnonzero(of_row & of_column)
    group = _connected(eliminated, pairs.rows[within], pairs.columns[within])
    blocks = np.flatnonzero(eliminated)
    blocks = blocks[np.argsort(group[blocks], kind="stable")]
    steps = np.arange(int(group.max(initial=-1)) + 2)
    block_bounds = np.searchsorted(group[blocks], steps)
    local = _numbered_within(table, blocks, group[blocks])
    _refuse_large(table, blocks, block_bounds, local)
    within = within[np.argsort(group[pairs.rows[within]], kind="stable")]
    inner = np.column_stack([within, pairs.rows[within], pairs.columns[within]])
    inner_bounds = np.searchsorted(group[pairs.rows[within]], steps)
    neighbours, bounds, links, link_bounds = _met(pairs, of_row ^ of_column, of_column, group, steps)
    most = int(local.max(initial=0)) + 1
    met = (neighbours, bounds, links, link_bounds)
    return Groups(blocks, block_bounds, inner, inner_bounds, *met, local, np.zeros_like(neighbours), most, 4)


def _no_groups(n_scalars: int) -> Groups:
    none, start = np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
    pairs, links, local = none.reshape(0, 3), none.reshape(0, 5), np.full(n_scalars, -1)
    return Groups(none, start, pairs, start, none, start, links, start, local, none, 1, 4)


def _connected(eliminated: BoolArray, rows: IntArray, columns: IntArray) -> IntArray:
    """(n_blocks,) group of each eliminated block, -1 for the others."""
    group = np.where(eliminated, np.cumsum(eliminated) - 1, -1)
    if len(rows):
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = int(np.count_nonzero(eliminated))
        joined = coo_array((np.ones(len(rows)), (group[rows], group[columns])), shape=(n, n))
        _, labels = connected_components(joined, directed=False)
        group[eliminated] = labels
    return group.astype(np.int64)


def _numbered_within(table: UnknownTable, blocks: IntArray, group: IntArray) -> IntArray:
    """(n_scalars,) number of each free unknown of the blocks within its group."""
    local = np.full(table.n_scalars, -1, dtype=np.int64)
    if not len(blocks):
        return local
    size = table.size[blocks]
    offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    scalars = np.repeat(table.start[blocks], size) + offset
    of_group = np.repeat(group, size)
    free = ~table.frozen[scalars]
    scalars, of_group = scalars[free], of_group[free]
    local[scalars] = np.arange(len(scalars)) - np.searchsorted(of_group, of_group)
    return local


def _refuse_large(table: UnknownTable, blocks: IntArray, bounds: IntArray, local: IntArray) -> None:
    if not len(blocks) or local.max(initial=0) < LARGEST:
        return
    largest = int(np.argmax(np.diff(bounds)))
    some = ", ".join(table.names[block] for block in blocks[bounds[largest] : bounds[largest] + 3])
    raise InputError(
        f"eliminate: observations join {np.diff(bounds)[largest]} of the eliminated blocks ({some}, ...) "
        f"to one another; a group may have {LARGEST} unknowns. Eliminate blocks that meet others only"
    )


def _met(
    pairs: BlockPairs, joining: BoolArray, turned: BoolArray, group: IntArray, steps: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Neighbours and links of all groups, with their bounds."""
    chosen = np.flatnonzero(joining)
    swapped = turned[chosen]
    block = np.where(swapped, pairs.columns[chosen], pairs.rows[chosen])
    other = np.where(swapped, pairs.rows[chosen], pairs.columns[chosen])
    order = np.lexsort((other, group[block]))
    chosen, swapped, block, other = chosen[order], swapped[order], block[order], other[order]
    of_group = group[block]
    new = np.ones(len(chosen), dtype=bool)
    new[1:] = (np.diff(of_group) != 0) | (np.diff(other) != 0)
    links = np.column_stack([chosen, np.cumsum(new) - 1, other, block, swapped])
    bounds = np.searchsorted(of_group[new], steps)
    return other[new], bounds, links, np.searchsorted(of_group, steps)
