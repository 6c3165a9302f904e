"""The numbering of the unknowns that are solved for."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.problem.unknowns import UnknownTable


@dataclass(frozen=True)
class FreeUnknowns:
    """The numbering of the matrix: free unknowns that some equation touches, in the order of the table.

    Attributes:
        number: (n_scalars,) number of each unknown in the matrix, -1 where frozen or without equation.
        scalars: (n_free,) position among all unknowns of each row of the matrix.
        first: (n_blocks,) number of the first free unknown of each block.
        count: (n_blocks,) number of free unknowns of each block; those of one block are consecutive.
    """

    number: IntArray
    scalars: IntArray
    first: IntArray
    count: IntArray


def free_unknowns(table: UnknownTable, used: BoolArray) -> FreeUnknowns:
    """Numbers the free unknowns of the blocks in use (n_blocks,)."""
    taken = ~table.frozen & np.repeat(used, table.size)
    scalars = np.flatnonzero(taken)
    number = np.full(table.n_scalars, -1, dtype=np.int64)
    number[scalars] = np.arange(len(scalars))
    count = np.add.reduceat(taken, table.start, dtype=np.int64) if len(table) else table.size
    return FreeUnknowns(number, scalars, count.cumsum() - count, count)
