"""The groups of eliminated blocks, as the loops take them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from obseq.arrays import IntArray, IntRows


class Groups(NamedTuple):
    """The groups of eliminated blocks and the blocks that each of them meets.

    Attributes:
        blocks: (n_blocks,) the eliminated blocks, group by group.
        block_bounds: (n + 1,) where the blocks of each group begin.
        inner: (n_inner, 3) place in the store, row block, column block of the pairs within a group.
        inner_bounds: (n + 1,) where those of each group begin.
        neighbours: (n_neighbours,) the blocks that are met, ascending within each group.
        bounds: (n + 1,) where the neighbours of each group begin.
        links: (n_links, 5) place in the store, neighbour (as place in `neighbours`), neighbour block,
            eliminated block, and 1 where the eliminated block is the column part.
        link_bounds: (n + 1,) where the links of each group begin.
        local: (n_scalars,) number of each eliminated unknown within its group; -1 for all others.
        part: (n_neighbours,) where each neighbour begins in the rows of its group, in fours.
        most: unknowns of the largest group, at least one.
        widest: length of the longest rows of a group, at least four.
    """

    blocks: IntArray
    block_bounds: IntArray
    inner: IntRows
    inner_bounds: IntArray
    neighbours: IntArray
    bounds: IntArray
    links: IntRows
    link_bounds: IntArray
    local: IntArray
    part: IntArray
    most: int
    widest: int
