"""Rows of arguments that two threads evaluate together: one from the first row on, the other from the last.

They share a board, an array of whole numbers. Chunks of rows are taken by counting down how many are left, so
that each is taken once, by whoever comes first: a thread that wakes late, or not at all, holds nobody up.
What to evaluate is written on the board before the count is set, and read after something has been taken.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import Instruction, compiled
from obseq.kernels.tiles import evaluate_rows

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, FloatRows, IntArray

seen, show, add, rest, call, address_of, rows_at = (
    Instruction("obseq.kernels.sharing_instructions", name)
    for name in ("seen", "show", "add", "rest", "call", "address_of", "rows_at")
)
LINE = 8
"""Whole numbers of a line of the caches: what both threads change lies in lines of its own."""

LEFT, AT_WORK, AT_THE_END, JOB = 0, LINE, 2 * LINE, 3 * LINE
"""Places on the board: chunks left; whether the helper is at work; chunks before its last one; the work."""

GIVE_WAY = JOB + 16
"""Place of the address of the system's `sched_yield`, or 0."""

SIZE = JOB + 24
OFTEN = 64
"""After so many looks a thread lets others have its processor, who may be those that it waits for."""


def new_board(give_way: int) -> IntArray:
    """A board with nothing to do, on a boundary of the lines of the caches.

    Args:
        give_way: Address of the system's `sched_yield`, or 0 where there is none.
    """
    raw = np.zeros(SIZE + LINE, np.int64)
    board: IntArray = raw[(-raw.ctypes.data // LINE) % LINE :][:SIZE]
    board[GIVE_WAY] = give_way
    return board


@compiled
def share_rows(
    board: IntArray,
    chunk: int,
    patience: int,
    address: int,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
    tiles: FloatArray,
    rows: FloatRows,
    tiles_of_helper: FloatArray,
    rows_of_helper: FloatRows,
) -> None:
    """Evaluates rows of arguments from the first one on, until all have been taken.

    Args: those of `tiles.evaluate_rows`, with the scratch of each thread, and
        board: What both threads know.
        chunk: Rows that are taken at a time; they fill all tiles each time.
        patience: How often it is looked whether the helper has finished, too.
    """
    n = len(unknowns)
    offer(
        board,
        chunk,
        address,
        n_rows,
        unknowns,
        observations,
        values,
        derivatives,
        tiles_of_helper,
        rows_of_helper,
    )
    first = 0
    while add(board, LEFT, -1) > 0:
        last = min(n, first + chunk)
        evaluate_rows(address, tiles, n_rows, unknowns, observations, values, derivatives, first, last, rows)
        first = last
    for looked in range(patience):
        if seen(board, AT_WORK) == 0:
            break
        wait(board, looked)


@compiled
def wait(board: IntArray, looked: int) -> None:
    """Lets a moment pass before the next look; the number of looks says whether others have their turn."""
    rest()
    if looked % OFTEN == OFTEN - 1 and board[GIVE_WAY] != 0:
        call(board[GIVE_WAY])


@compiled
def offer(
    board: IntArray,
    chunk: int,
    address: int,
    n_rows: int,
    unknowns: FloatRows,
    observations: FloatRows,
    values: FloatRows,
    derivatives: FloatRows,
    tiles: FloatArray,
    rows: FloatRows,
) -> None:
    """Writes on the board what there is to evaluate, and with what scratch, then how many chunks."""
    n = len(unknowns)
    n_chunks = (n + chunk - 1) // chunk
    board[AT_THE_END] = n_chunks
    board[JOB], board[JOB + 1], board[JOB + 2], board[JOB + 3] = address, n_rows, n, chunk
    board[JOB + 4], board[JOB + 5] = address_of(unknowns), unknowns.shape[1]
    board[JOB + 6], board[JOB + 7] = address_of(observations), observations.shape[1]
    board[JOB + 8], board[JOB + 9] = address_of(values), values.shape[1]
    board[JOB + 10], board[JOB + 11] = address_of(derivatives), derivatives.shape[1]
    board[JOB + 12], board[JOB + 13] = address_of(tiles), len(tiles)
    board[JOB + 14], board[JOB + 15] = address_of(rows), len(rows)
    show(board, LEFT, n_chunks)


@compiled
def help_with_rows(board: IntArray, patience: int) -> int:
    """Evaluates what is on the board from the last row back; waits for more, looking so many times.

    Returns:
        How many chunks it has evaluated.
    """
    looked, done = 0, 0
    while looked < patience:
        looked += 1
        if seen(board, LEFT) > 0:
            add(board, AT_WORK, 1)
            while add(board, LEFT, -1) > 0:
                evaluate_last(board)
                done += 1
            add(board, AT_WORK, -1)
            looked = 0
        wait(board, looked)
    return done


@compiled
def evaluate_last(board: IntArray) -> None:
    """Evaluates the last chunk that the helper has not evaluated yet."""
    n, chunk, last = board[JOB + 2], board[JOB + 3], board[AT_THE_END] - 1
    board[AT_THE_END] = last
    evaluate_rows(
        board[JOB],
        rows_at(board[JOB + 12], 1, board[JOB + 13])[0],
        board[JOB + 1],
        rows_at(board[JOB + 4], n, board[JOB + 5]),
        rows_at(board[JOB + 6], n, board[JOB + 7]),
        rows_at(board[JOB + 8], n, board[JOB + 9]),
        rows_at(board[JOB + 10], n, board[JOB + 11]),
        last * chunk,
        min(n, (last + 1) * chunk),
        rows_at(board[JOB + 14], board[JOB + 15], board[JOB + 11]),
    )
