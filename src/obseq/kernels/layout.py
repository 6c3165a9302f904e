"""The shape of what kernels read and write: tiles of records, and the unknown blocks of a formula."""

from typing import NamedTuple

LANES = 32
"""Observations in a tile: one per lane."""

STRIDE = 72
"""Doubles from one row of a tile to the next: LANES padded away from powers of two (cache conflicts).

Processors hold back a read whose address has the last twelve bits of what was just written. Lanes to come
have those of what is 43, 50 and 57 rows before, far enough; with 40 it was 13, 26 and 39, and small kernels
took up to 2.8 times as long, depending on where their tiles lay.
"""


class Block(NamedTuple):
    """One atomic block of unknowns of a formula.

    Attributes:
        name: Argument of the formula, with the part after a dot for composite blocks (`station.rotation`).
        kind: What the block is: `Point3`, `Point2`, `Rotation`, `Direction`, `Vector` or `Scalar`.
        start: Position of its first scalar among the unknowns.
        size: Number of its scalars.
        context: Half-open range of its context values among the observations, or None.
        transposed: True when the context matrix is the transpose of the block's matrix (both row by row).
        unit: Unit of its scalars.
    """

    name: str
    kind: str
    start: int
    size: int
    context: tuple[int, int] | None = None
    transposed: bool = False
    unit: str = ""


class Input(NamedTuple):
    """What is given with each observation of a formula: one argument, or one part of it.

    Attributes:
        name: Argument of the formula, with the part after a dot for composite ones.
        kind: What it is: a kind of block, or `Matrix3`.
        start: Position of its first scalar among the observations.
        size: Number of its scalars.
        unit: Unit of its scalars.
    """

    name: str
    kind: str
    start: int
    size: int
    unit: str = ""
