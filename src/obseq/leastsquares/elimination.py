"""Temporaries: blocks of unknowns eliminated before the matrix is formed, found again afterwards.

A block such as a tie point meets only the blocks that observe it. Its unknowns t are eliminated exactly
(Schur):

    N <- N - N_kt N_tt^-1 N_tk,   g <- g - N_kt N_tt^-1 g_t,   t = -N_tt^-1 (g_t + N_tk k)

for the other unknowns k, block by block, so that only these enter the matrix that the solver factors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from obseq.leastsquares.pattern import BlockPairs
    from obseq.leastsquares.unknowns import UnknownTable

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]
    BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Groups:
    """The eliminated blocks and the blocks that each of them meets.

    Attributes:
        blocks: (n,) the eliminated blocks.
        bounds: (n + 1,) where the neighbours of each begin in `neighbours`.
        neighbours: (n_neighbours,) the blocks met, ascending within each group.
        links: (n_links, 4) place of a pair in the store, neighbour (place in `neighbours`), neighbour
            block, 1 where the eliminated block is the column part; in the order of the groups.
        link_bounds: (n + 1,) where the links of each group begin.
    """

    blocks: IntArray
    bounds: IntArray
    neighbours: IntArray
    links: IntArray
    link_bounds: IntArray

    def pairs(self) -> tuple[IntArray, IntArray]:
        """Low and high block of all pairs of neighbours of a group, in the order of elimination."""
        if not len(self.blocks):
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        from obseq.leastsquares.elimination_loops import neighbour_pairs

        count = np.diff(self.bounds)
        low = np.empty(int(np.sum(count * (count - 1) // 2)), dtype=np.int64)
        high = np.empty_like(low)
        neighbour_pairs(self.bounds, self.neighbours, low, high)
        return low, high

    def placed(self, places: IntArray) -> Groups:
        """The same with the places of the pairs (n_pairs,) instead of their numbers."""
        links = self.links.copy()
        links[:, 0] = places[links[:, 0]]
        return Groups(self.blocks, self.bounds, self.neighbours, links, self.link_bounds)


def elimination_groups(table: UnknownTable, pairs: BlockPairs, eliminated: BoolArray) -> Groups:
    """Groups of the eliminated blocks (n_blocks,) that are in use; `links[:, 0]` are numbers of pairs.

    Raises:
        InputError: an observation joins two eliminated blocks.
    """
    blocks = np.flatnonzero(eliminated)
    of_row, of_column = eliminated[pairs.rows], eliminated[pairs.columns]
    both = np.flatnonzero(of_row & of_column)
    if both.size:
        one, other = table.names[pairs.rows[both[0]]], table.names[pairs.columns[both[0]]]
        raise InputError(f"eliminate: an observation joins {one!r} and {other!r}; only one of them can be")
    chosen = np.flatnonzero(of_row | of_column)
    turned = of_column[chosen]
    block = np.where(turned, pairs.columns[chosen], pairs.rows[chosen])
    other = np.where(turned, pairs.rows[chosen], pairs.columns[chosen])
    group = np.searchsorted(blocks, block)
    order = np.lexsort((other, group))
    chosen, turned, other, group = chosen[order], turned[order], other[order], group[order]
    new = np.ones(len(chosen), dtype=bool)
    new[1:] = (np.diff(group) != 0) | (np.diff(other) != 0)
    links = np.column_stack([chosen, np.cumsum(new) - 1, other, turned])
    steps = np.arange(len(blocks) + 1)
    bounds = np.searchsorted(group[new], steps)
    return Groups(blocks, bounds, other[new], links, np.searchsorted(group, steps))
