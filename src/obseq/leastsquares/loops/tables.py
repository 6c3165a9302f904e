"""What loops are given: numbers and arrays that belong together, as NamedTuples."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows, IndexArray, IntArray, IntRows, PositionRows


class BatchArrays(NamedTuple):
    """A batch of observations.

    Attributes:
        n_unknowns: unknowns of one equation.
        n_residuals: residuals of one equation.
        first_row: row of a tile that holds the first residual.
        blocks: (n_blocks, 4) first row of a tile, size, first row of the context or -1, size of the context.
        starts: (n_blocks, n) where the unknowns of each block of each observation are in the values.
        contexts: (n_blocks, n) the same for their context.
        observations: (n_rows, n) what was measured.
        observation_rows: (n_rows,) rows of a tile that hold it.
        weights: (n_residuals, n) what residuals are multiplied by; 0 for those without influence.
        roots: (m (m + 1) / 2, n) roots of the inverse covariances of correlated residuals; empty without.
    """

    n_unknowns: int
    n_residuals: int
    first_row: int
    blocks: IntRows
    starts: PositionRows
    contexts: PositionRows
    observations: FloatRows
    observation_rows: IntArray
    weights: FloatRows
    roots: FloatRows


class Span(NamedTuple):
    """Observations of a batch: from the first, a multiple of 32, to before the last."""

    first: int
    last: int


class Present(NamedTuple):
    """The current values of all unknowns, and the context of their blocks; four spare numbers behind each."""

    values: FloatArray
    context: FloatArray


class BlockTable(NamedTuple):
    """Where the products of the derivatives of a batch are added.

    Attributes:
        record_rows: (width,) scaled row of each place of a record; -1 for zeros.
        pairs: (n_pairs, 6) place of the row part, place of the column part, quads of rows, columns, -1 or,
            for two blocks of three, the row of `heights`, and 1 where neighbours mostly share their block.
        positions: (n_pairs, n) place of each small block in the store: in units of four doubles; in doubles
            for two blocks of three.
        heights: (n_threes, n) twice the height of the first column of the block, plus one when the parts
            change places.
        scratch: number of doubles for records and scaled rows.
    """

    record_rows: IntArray
    pairs: IntRows
    positions: PositionRows
    heights: PositionRows
    scratch: int


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


class UnknownPlaces(NamedTuple):
    """Where the blocks of unknowns are, among all unknowns and in the matrix.

    Attributes:
        start: (n_blocks,) first unknown of each block.
        size: (n_blocks,) number of its unknowns.
        number: (n_scalars,) number of each unknown in the matrix, or -1.
        first: (n_blocks,) number of the first free unknown of each block.
        n_free: (n_blocks,) number of its free unknowns.
        indptr: (n_free + 1,) where the columns of the matrix begin.
    """

    start: IntArray
    size: IntArray
    number: IntArray
    first: IntArray
    n_free: IntArray
    indptr: IntArray


class EliminationRoom(NamedTuple):
    """Room for the elimination of one group.

    Attributes:
        factor: (most, most) its factor.
        right: (most,) its gradient.
        record: (2 most widest,) its rows, and their opposites; nothing for the way back.
        columns: (widest,) the places of its neighbours' columns; nothing for the way back.
    """

    factor: FloatRows
    right: FloatArray
    record: FloatArray
    columns: IntArray


class EquationRows(NamedTuple):
    """Observations of one formula with their derivatives.

    Attributes:
        derivatives: (n_residuals n_unknowns, n) Jacobian, residual by residual.
        weights: (n_residuals, n) inverse sigmas; zero for those without influence.
        starts: (n_roles, n) first unknown of each block.
        roles: (n_roles, 2) first derivative and size of each block.
    """

    derivatives: FloatRows
    weights: FloatRows
    starts: PositionRows
    roles: IntRows


class SparseInverse(NamedTuple):
    """The inverse Q of the normal matrix N, on the pattern of N.

    Attributes:
        number: (n_scalars,) number of each unknown in the matrix, -1 where frozen.
        values: (nnz,) lower triangle of Q, by columns.
        indptr: where they begin.
        indices: (nnz,) rows.
    """

    number: IntArray
    values: FloatArray
    indptr: IntArray
    indices: IndexArray
