"""From the small blocks of a small system to its step, as one compiled loop.

Python calls it as one of its own builtins: a usual call takes longer than its work.
"""

from __future__ import annotations

from typing import NamedTuple

from obseq.arrays import FloatArray, FloatRows, IntArray, IntRows
from obseq.compilation import compiled
from obseq.leastsquares.loops.blocks_to_matrix import add_diagonal_blocks, add_pairs, add_priors
from obseq.leastsquares.loops.loop_arguments import Present, PriorArrays, UnknownPlaces
from obseq.leastsquares.solvers.dense_loops import factor_columns, solve_columns


class MatrixRoom(NamedTuple):
    """Where blocks go, and room for the matrix.

    Attributes:
        diagonal: (n_blocks,) place of the diagonal blocks in the store, in units of four doubles.
        stored: (n, 4) pairs to be added to the matrix (see `StoreLayout`).
        places: (nnz,) where the entries of the pattern are in the dense matrix.
        columns: (n n,) its factor, by columns.
        pivots: (n,) its relative pivots.
    """

    diagonal: IntArray
    stored: IntRows
    places: IntArray
    columns: FloatArray
    pivots: FloatArray


class Outcome(NamedTuple):
    """What an iteration finds.

    Attributes:
        gradient: (n,) zeros; J' W r.
        solved: (1, n) the step of the matrix.
        step: (n_scalars,) zeros; the step of all unknowns.
        weights: (n_scalars,) zeros; the diagonal of the matrix.
        numbers: (2,) least relative pivot, -1 without finite numbers; square of the length of the step.
    """

    gradient: FloatArray
    solved: FloatRows
    step: FloatArray
    weights: FloatArray
    numbers: FloatArray


@compiled(at_once=True)
def find_step(
    store: FloatArray,
    room: MatrixRoom,
    unknowns: UnknownPlaces,
    priors: PriorArrays,
    present: Present,
    free: IntArray,
    tolerance: FloatArray,
    squares: FloatArray,
    found: Outcome,
) -> int:
    """Makes the normal equations of what the store holds, factors and solves them.

    `free` (n,): position of each unknown of the matrix among all. `tolerance` (1,): pivots below it are
    replaced. `squares`: those of each prior are added to its number.
    """
    n, values, numbers = len(free), store[: len(room.places)], found.numbers
    add_diagonal_blocks(store, room.diagonal, unknowns, found.gradient)
    add_pairs(store, room.stored, unknowns)
    add_priors(priors, present.values, unknowns.indptr, values, found.gradient, squares)
    numbers[0] = -1.0
    if not (are_finite(values) and are_finite(found.gradient)):
        return 0
    room.columns[:] = 0.0
    for k in range(len(room.places)):
        room.columns[room.places[k]] = values[k]
    for j in range(n):
        weight = values[unknowns.indptr[j]]
        found.weights[free[j]] = weight
        room.pivots[j] = weight
        found.solved[0, j] = -found.gradient[j]
    factor_columns(room.columns, 0, n, n, n, room.pivots, 0, tolerance[0])
    solve_columns(room.columns, n, found.solved)
    least, square = 1.0, 0.0
    for j in range(n):
        least = min(least, room.pivots[j])
        square -= found.solved[0, j] * found.gradient[j]
        found.step[free[j]] = found.solved[0, j]
    numbers[0], numbers[1] = least, square
    return 0


@compiled
def are_finite(numbers: FloatArray) -> bool:
    """Whether all numbers are finite."""
    total = 0.0
    for k in range(len(numbers)):
        total += 0.0 * numbers[k]
    return total == 0.0
