"""Derivatives by what moves more than itself: a point whose plumb line turns with it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.leastsquares.problem.padding import padded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.problem.shapes import Shape


class Move(NamedTuple):
    """What a block of three of an equation does to another, or to the residuals.

    Attributes:
        moving: its place among the arguments of the formula.
        moved: that of the block that it moves; None for the residuals themselves.
        how: (n, 3, 3) the movement of that block by its own; (n, 3) derivatives of the residual.
    """

    moving: int
    moved: int | None
    how: FloatArray


def carried_of(shape: Shape, moves: Sequence[Move], n: int) -> tuple[IntArray, FloatArray]:
    """(k, 3) places of n equations' derivatives, and (rows, n padded) numbers, as `BatchArrays` has them.

    Derivatives are read before anything is added to them: what moves others comes before what moves itself,
    and that before what moves residuals.
    """
    moves = sorted(moves, key=lambda move: (move.moved is None, move.moving == move.moved))
    rows = [move.how.reshape(n, -1).T for move in moves]
    starts = np.cumsum([0, *map(len, rows)]).tolist()
    first = [role.row for role in shape.roles]
    places = [
        (first[move.moving], -1 if move.moved is None else first[move.moved], start)
        for move, start in zip(moves, starts, strict=False)
    ]
    numbers = np.concatenate([np.zeros((0, n)), *rows])
    return np.array(places, np.int64).reshape(-1, 3), padded(numbers, np.float64)
