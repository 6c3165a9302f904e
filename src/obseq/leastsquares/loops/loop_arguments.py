"""What loops are given: numbers and arrays that belong together, as NamedTuples."""

from __future__ import annotations

from typing import NamedTuple

from obseq.arrays import (
    FloatArray,
    FloatRows,
    IndexArray,
    IntArray,
    IntRows,
    PositionArray,
    PositionRows,
)


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
        carried: (k, 3) first derivative of what moves something, first derivative by that, or -1 where it is
            the residual itself, and first of the rows that say how.
        carriers: (n_rows, n) these rows: (3, 3) matrices row by row, or three numbers.
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
    carried: IntRows
    carriers: FloatRows


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


class PriorArrays(NamedTuple):
    """Unknowns observed directly.

    Attributes:
        scalars: (n,) positions among all unknowns.
        numbers: (n,) numbers in the matrix, -1 where frozen or eliminated.
        values: (n,) given values.
        weights: (n,) inverse sigmas.
        prior: (n,) which prior each of them belongs to.
    """

    scalars: IntArray
    numbers: IntArray
    values: FloatArray
    weights: FloatArray
    prior: IntArray


class Groups(NamedTuple):
    """The groups of eliminated blocks and the blocks that each of them meets.

    Attributes:
        blocks: (n_blocks,) the eliminated blocks, group by group.
        block_bounds: (n + 1,) where the blocks of each group begin.
        inner: (n_inner, 3) place in the store, row block, column block of the pairs within a group.
        inner_bounds: (n + 1,) where those of each group begin.
        links: (n_links, 5) place in the store, place in the rows of the group, neighbour block, eliminated
            block, and 1 where the eliminated block is the column part.
        link_bounds: (n + 1,) where the links of each group begin.
        threes: (n,) 1 for groups that are one block of three free unknowns, the column part of all links,
            and whose neighbours all have three, too.
        local: (n_scalars,) number of each eliminated unknown within its group; -1 for all others.
        most: unknowns of the largest group, at least one.
    """

    blocks: IntArray
    block_bounds: IntArray
    inner: IntRows
    inner_bounds: IntArray
    links: PositionRows
    link_bounds: IntArray
    threes: IntArray
    local: IntArray
    most: int


class Bodies(NamedTuple):
    """Neighbours of groups, side by side where they are met by the same groups, as the unknowns of an image.

    What elimination takes from the matrix is summed up by pairs of bodies, columns of the lower-numbered
    one, and subtracted at the end. In the rows of a group each block begins at a multiple of four.

    Attributes:
        slots: (n_slots,) the bodies that each group meets, ascending.
        bounds: (n_groups + 1,) where those of each group begin.
        part: (n_slots,) where each begins in the rows of its group.
        places: (n_pairs,) place of the sums of each pair of slots, in fours, in the order of elimination.
        columns: (n_columns,) place of each unknown within its body.
        column_bounds: (n_bodies + 1,) where those of each body begin.
        height: (n_bodies,) length of its part.
        pulls: (n_bodies,) where its share of the gradient is summed up.
        widest: length of the longest rows of a group, a part of four for its gradient included.
    """

    slots: IntArray
    bounds: IntArray
    part: IntArray
    places: PositionArray
    columns: IntArray
    column_bounds: IntArray
    height: IntArray
    pulls: IntArray
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
        three: (6,) what is needed of the factor of three unknowns: see `solve_three_rows`.
        record: (most widest,) its rows; nothing for the way back.
    """

    factor: FloatRows
    right: FloatArray
    three: FloatArray
    record: FloatArray


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
