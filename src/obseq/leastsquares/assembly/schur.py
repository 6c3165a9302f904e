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

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.loops.loop_arguments import Groups

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, IntArray
    from obseq.leastsquares.assembly.pattern import BlockPairs
    from obseq.leastsquares.problem.unknowns import UnknownTable


LARGEST = 1000
"""Unknowns of one group: beyond, a dense elimination takes longer than the sparse matrix would."""


@dataclass(frozen=True)
class Met:
    """The blocks that each group meets.

    Attributes:
        blocks: (n_met,) the blocks, ascending within each group.
        bounds: (n_groups + 1,) where those of each group begin.
        of_link: (n_links,) which of them a link leads to.
    """

    blocks: IntArray
    bounds: IntArray
    of_link: IntArray


def elimination_groups(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> tuple[Groups, Met]:
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
    turned = of_column | _are_threes(table, pairs)
    met, links, link_bounds = _met(pairs, of_row ^ of_column, turned, of_column, group, steps)
    threes = np.zeros(len(block_bounds) - 1, dtype=np.int64)
    groups = Groups(
        blocks, block_bounds, inner, inner_bounds, links, link_bounds, threes, local, _most(local)
    )
    return groups, met


def is_turned(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> BoolArray:
    """(n_pairs,) True for pairs of threes to be stored transposed, the eliminated block as column part."""
    joining = eliminated[pairs.rows] & ~eliminated[pairs.columns]
    return np.asarray(joining & _are_threes(table, pairs))


def _are_threes(table: UnknownTable, pairs: BlockPairs) -> BoolArray:
    return np.asarray((table.size[pairs.rows] == 3) & (table.size[pairs.columns] == 3))


def _no_groups(n_scalars: int) -> tuple[Groups, Met]:
    none, start = np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
    pairs, links, local = none.reshape(0, 3), none.reshape(0, 5), np.full(n_scalars, -1)
    return Groups(none, start, pairs, start, links, start, none, local, 1), Met(none, start, none)


def _most(local: IntArray) -> int:
    return int(local.max(initial=0)) + 1


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
    pairs: BlockPairs,
    joining: BoolArray,
    turned: BoolArray,
    is_column: BoolArray,
    group: IntArray,
    steps: IntArray,
) -> tuple[Met, IntArray, IntArray]:
    """What the groups meet, and their links with their bounds; arguments (n_pairs,) but for the last two."""
    chosen = np.flatnonzero(joining)
    swapped, is_last = turned[chosen], is_column[chosen]
    block = np.where(is_last, pairs.columns[chosen], pairs.rows[chosen])
    other = np.where(is_last, pairs.rows[chosen], pairs.columns[chosen])
    order = np.lexsort((other, group[block]))
    chosen, swapped, block, other = chosen[order], swapped[order], block[order], other[order]
    of_group = group[block]
    new = np.ones(len(chosen), dtype=bool)
    new[1:] = (np.diff(of_group) != 0) | (np.diff(other) != 0)
    links = np.column_stack([chosen, np.zeros_like(chosen), other, block, swapped])
    met = Met(other[new], np.searchsorted(of_group[new], steps), np.cumsum(new) - 1)
    return met, links, np.searchsorted(of_group, steps)
