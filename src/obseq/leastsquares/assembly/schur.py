"""Temporaries: blocks of unknowns eliminated before the matrix is formed, found again afterwards.

A block such as a tie point meets only the blocks that observe it; so does a group of blocks that
observations join, such as the pose of a sub-network. The unknowns t of a group are eliminated exactly
(Schur):

    N <- N - N_kt N_tt^-1 N_tk,   g <- g - N_kt N_tt^-1 g_t,   t = -N_tt^-1 (g_t + N_tk k)

for the other unknowns k, group by group, so that only these enter the matrix that the solver factors.
"""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, IndexArray, IntArray, PositionRows
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.graphs import parts
from obseq.leastsquares.assembly.pattern import BlockPairs
from obseq.leastsquares.loops.loop_arguments import Groups
from obseq.leastsquares.loops.sorting import distinct_pairs, sorted_by
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
    of_link: IndexArray


def elimination_groups(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> tuple[Groups, Met]:
    """Groups of the eliminated blocks (n_blocks,) that are in use; places are numbers of pairs as yet.

    Raises:
        InputError: observations join too many eliminated blocks to one another.
    """
    if not eliminated.any():
        return _no_groups(table.n_scalars)
    of_row, of_column = eliminated[pairs.rows], eliminated[pairs.columns]
    within = of_row & of_column
    group = _connected(eliminated, pairs.rows[within], pairs.columns[within])
    n_groups = int(group.max()) + 1
    blocks, block_bounds = sorted_by(group, n_groups)
    local = _numbered_within(table, blocks, group[blocks])
    _refuse_large(table, blocks, block_bounds, local)
    inner, inner_bounds = sorted_by(np.where(within, group[pairs.rows], -1), n_groups)
    inner_pairs = np.array([inner, pairs.rows[inner], pairs.columns[inner]]).T
    met, links, link_bounds = _met(table, pairs, group, n_groups)
    groups = Groups(
        blocks.astype(np.int64),
        block_bounds,
        np.ascontiguousarray(inner_pairs),
        inner_bounds,
        links,
        link_bounds,
        np.zeros(n_groups, dtype=np.int64),
        local,
        int(local.max(initial=0)) + 1,
    )
    return groups, met


def is_turned(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> BoolArray:
    """(n_pairs,) True for pairs of threes to be stored transposed, the eliminated block as column part."""
    joining = eliminated[pairs.rows] & ~eliminated[pairs.columns]
    return np.asarray(joining & (table.size[pairs.rows] == 3) & (table.size[pairs.columns] == 3))


def _no_groups(n_scalars: int) -> tuple[Groups, Met]:
    none, start = np.zeros(0, dtype=np.int64), np.zeros(1, dtype=np.int64)
    pairs, links, local = none.reshape(0, 3), none.reshape(0, 5).astype(np.uint32), np.full(n_scalars, -1)
    met = Met(none, start, none.astype(np.int32))
    return Groups(none, start, pairs, start, links, start, none, local, 1), met


def _connected(eliminated: BoolArray, rows: IntArray, columns: IntArray) -> IndexArray:
    """(n_blocks,) group of each eliminated block, -1 for the others."""
    group = np.where(eliminated, np.cumsum(eliminated, dtype=np.int32) - 1, -1).astype(np.int32)
    if len(rows):
        group[eliminated] = parts(int(np.count_nonzero(eliminated)), group[rows], group[columns])
    return group


def _numbered_within(table: UnknownTable, blocks: IndexArray, group: IndexArray) -> IntArray:
    """(n_scalars,) number of each free unknown of the blocks, group by group, within its group."""
    local = np.full(table.n_scalars, -1, dtype=np.int64)
    size = table.size[blocks]
    offset = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
    scalars = np.repeat(table.start[blocks], size) + offset
    of_group = np.repeat(group, size)
    free = ~table.frozen[scalars]
    scalars, of_group = scalars[free], of_group[free]
    local[scalars] = np.arange(len(scalars)) - np.searchsorted(of_group, of_group)
    return local


def _refuse_large(table: UnknownTable, blocks: IndexArray, bounds: IntArray, local: IntArray) -> None:
    if local.max(initial=0) < LARGEST:
        return
    largest = int(np.argmax(np.diff(bounds)))
    some = ", ".join(table.names[block] for block in blocks[bounds[largest] : bounds[largest] + 3])
    raise InputError(
        f"eliminate: observations join {np.diff(bounds)[largest]} of the eliminated blocks ({some}, ...) "
        f"to one another; a group may have {LARGEST} unknowns. Eliminate blocks that meet others only"
    )


def _met(
    table: UnknownTable, pairs: BlockPairs, group: IndexArray, n_groups: int
) -> tuple[Met, PositionRows, IntArray]:
    """What the groups meet, and their links with their bounds; `group` (n_blocks,) is -1 for other blocks."""
    from obseq.leastsquares.loops.neighbours import list_neighbours, write_links

    of_group, other = np.empty((2, len(pairs.rows)), dtype=np.int32)
    list_neighbours(pairs.rows, pairs.columns, group, of_group, other)
    found = distinct_pairs(of_group, other, n_groups, len(group))
    links = np.empty((len(found.order), 5), dtype=np.uint32)
    write_links(pairs.rows, pairs.columns, table.size, group, found.order, links)
    return Met(found.second, found.starts, found.number[found.order]), links, found.bounds
