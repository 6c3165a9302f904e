"""What assembly must know of a formula: its blocks, its rows of a tile, its kernels, what moves what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import FormulaError, InputError
from obseq.kernels.loading import Kernel
from obseq.leastsquares.problem.manifolds import Manifold
from obseq.leastsquares.problem.padding import fill_padded, padded_length
from obseq.leastsquares.problem.unknowns import UnknownTable


@dataclass(frozen=True)
class Role:
    """One block of a formula, as a batch sees it.

    Attributes:
        name: argument of the formula (`station.centre`).
        kind: name of the kind of block the formula wants (`Point3`).
        row: first row of its unknowns in a tile.
        size: number of its unknowns.
        context_row: first row of its context in a tile, -1 without context.
        context_size: number of its context values.
        transposed: True when the formula reads the transposed rotation matrix.
    """

    name: str
    kind: str
    row: int
    size: int
    context_row: int = -1
    context_size: int = 0
    transposed: bool = False

    def takes(self, manifold: Manifold) -> bool:
        """Whether blocks of a kind of unknown can stand for it."""
        context = manifold.context_size - (manifold.transposed_at if self.transposed else 0)
        return self.kind in (manifold.label, *manifold.stands_for) and context >= self.context_size


@dataclass(frozen=True)
class Column:
    """One argument of a formula that is given with each observation.

    Attributes:
        name: argument of the formula (`hz`).
        first: place of its first number among those given per observation.
        shape: shape that it has for one observation: () for a number, (3,) for a vector, (3, 3) for a matrix.
    """

    name: str
    first: int
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of its numbers."""
        return int(np.prod(self.shape))


@dataclass(frozen=True)
class Shape:
    """What the loops must know of a formula.

    Attributes:
        name: name of the formula, for messages.
        roles: its blocks.
        columns: what is given with each observation, by name; empty for linear rows.
        observation_rows: (m,) rows of a tile that hold what the user gives per observation.
        n_unknowns: unknowns of one equation.
        n_residuals: residuals of one equation.
        first_row: row of the first residual.
        formula: the loaded formula; None for linear rows.
    """

    name: str
    roles: tuple[Role, ...]
    columns: tuple[Column, ...]
    observation_rows: tuple[int, ...]
    n_unknowns: int
    n_residuals: int
    first_row: int
    formula: Kernel | None

    @property
    def is_linear(self) -> bool:
        """Whether its observations are coefficients and a right-hand side."""
        return self.formula is None

    @cached_property
    def role_rows(self) -> IntArray:
        """(n_roles, 4) row, size, row and size of the context of each block."""
        rows = [(role.row, role.size, role.context_row, role.context_size) for role in self.roles]
        return np.array(rows, dtype=np.int64)

    @cached_property
    def transposed(self) -> BoolArray:
        """(n_roles, 1) True for the blocks whose transposed rotation matrix the formula reads."""
        return np.array([role.transposed for role in self.roles])[:, None]

    @cached_property
    def observation_places(self) -> IntArray:
        """(m,) `observation_rows`, for the loops."""
        return np.array(self.observation_rows, dtype=np.int64)

    def kernel(self) -> int:
        """Address of the kernel of values and derivatives, compiled when needed; 0 for linear rows."""
        return 0 if self.formula is None else self.formula.value_and_jacobian_address

    def value_kernel(self) -> int:
        """The same for values alone."""
        return 0 if self.formula is None else self.formula.value_address

    def new_tile(self) -> FloatArray:
        """A tile that either kernel can work in."""
        from obseq.kernels.tiles import aligned_tiles

        if self.formula is None:
            return aligned_tiles(self.first_row + 1 + self.n_unknowns, 1)
        return aligned_tiles(self.formula.rows, 1, self.formula.constant_rows)


def formula_shape(formula: str | Kernel) -> Shape:
    """The shape of a generated formula; its kernels are compiled or read from the cache on first use.

    Raises:
        FormulaError: there is no such formula, or it is no formula.
    """
    from obseq.kernels.loading import Kernel, load

    kernel = load(formula) if isinstance(formula, str) else formula
    if not isinstance(kernel, Kernel):
        raise FormulaError(f"a formula is given by its name or as a compiled formula, not by {formula!r}")
    kept = _KEPT.get(kernel.name)
    if kept is None or kept.formula is not kernel:
        kept = _KEPT[kernel.name] = _shape_of(kernel)
    return kept


_KEPT: dict[str, Shape] = {}
"""The shape of each formula asked for last by that name."""


def _shape_of(kernel: Kernel) -> Shape:
    n_unknowns = len(kernel.unknowns)
    roles = tuple(
        Role(
            block.name,
            block.kind,
            block.start,
            block.size,
            n_unknowns + block.context[0] if block.context else -1,
            block.context[1] - block.context[0] if block.context else 0,
            block.transposed,
        )
        for block in kernel.blocks
    )
    return Shape(
        kernel.name,
        roles,
        _columns(kernel),
        tuple(n_unknowns + row for row in kernel.measured),
        n_unknowns,
        len(kernel.residuals),
        kernel.first_result,
        kernel,
    )


def _columns(kernel: Kernel) -> tuple[Column, ...]:
    shapes = {"Scalar": (), "Matrix3": (3, 3)}
    return tuple(
        Column(given.name, kernel.measured.index(given.start), shapes.get(given.kind, (given.size,)))
        for given in kernel.inputs
    )


def linear_shape(table: UnknownTable, columns: Sequence[IntArray], is_tangent: bool = False) -> Shape:
    """The shape of plain linear rows over blocks: their coefficients and value are the observations.

    Args:
        table: the unknowns.
        columns: for each place in the rows, the ids of the blocks that stand there.
        is_tangent: whether curved blocks may be among them, with coefficients of their small steps.
    """
    roles, row = [], 0
    for number, ids in enumerate(columns):
        _, manifold, size = table.uniform(ids, f"linear rows, block {number}")
        if not (manifold.is_flat or is_tangent):
            name = table.names[ids[0]]
            raise InputError(f"linear rows: {name!r} is a {manifold.label}, not a linear unknown")
        roles.append(Role(str(number), manifold.label, row, size))
        row += size
    return Shape("linear", tuple(roles), (), tuple(range(row, 2 * row + 1)), row, 1, 2 * row + 1, None)


class Move(NamedTuple):
    """What a block of three of an equation does to another, or to the residuals.

    A plumb line, say, that turns with its point.

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
    counts = [3 if move.moved is None else 9 for move in moves]
    starts = np.cumsum([0, *counts]).tolist()
    first = [role.row for role in shape.roles]
    places = [
        (first[move.moving], -1 if move.moved is None else first[move.moved], start)
        for move, start in zip(moves, starts, strict=False)
    ]
    numbers = np.empty((starts[-1], padded_length(n)))
    for move, start, count in zip(moves, starts, counts, strict=False):
        fill_padded(numbers[start : start + count], move.how.reshape(n, -1).T)
    return np.array(places, np.int64).reshape(-1, 3), numbers
