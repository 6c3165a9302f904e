"""Batches of equations: many observations of one formula, checked once and laid out for the drivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError
from obseq.kernels.layout import LANES, STRIDE
from obseq.leastsquares.problem.unknowns import Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.kernels.loading import Kernel
    from obseq.leastsquares.problem.losses import Loss
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


@dataclass(frozen=True)
class Shape:
    """What the drivers must know of a formula.

    Attributes:
        name: name of the formula, for messages.
        roles: its blocks.
        observation_rows: (m,) rows of a tile that hold what the user gives per observation.
        n_unknowns: unknowns of one equation.
        n_residuals: residuals of one equation.
        first_row: row of the first residual.
        kernel: address of the value-and-Jacobian kernel, called when needed; 0 for linear rows.
        value_kernel: the same for values alone.
        new_tile: makes a tile that either kernel can work in.
    """

    name: str
    roles: tuple[Role, ...]
    observation_rows: tuple[int, ...]
    n_unknowns: int
    n_residuals: int
    first_row: int
    kernel: Callable[[], int]
    value_kernel: Callable[[], int]
    new_tile: Callable[[], FloatArray]


def padded_length(n: int) -> int:
    """`n` rounded up to whole tiles."""
    return -(-n // LANES) * LANES


def _padded(rows: NDArray[Any], dtype: type) -> NDArray[Any]:
    """(k, n) rows repeated at their end to whole tiles, so that spare lanes compute what a real one does."""
    k, n = rows.shape
    result: NDArray[Any] = np.empty((k, padded_length(n)), dtype=dtype)
    result[:, :n] = rows
    if n:
        result[:, n:] = rows[:, n - 1 : n]
    return result


class Batch:
    """Observations of one formula: the blocks they join, what was measured, sigmas and labels.

    The measured values may be replaced between two iterations (`batch.observations = ...`), and so may
    `loss`, which gives robust weights (None: none). `is_constraint` says that its rows count as constraints.
    """

    def __init__(
        self,
        shape: Shape,
        table: UnknownTable,
        blocks: Mapping[str, ArrayLike],
        observations: ArrayLike | None,
        sigmas: ArrayLike,
        labels: Sequence[str] | None,
        group: str | None,
        active: ArrayLike | None,
    ) -> None:
        self.shape = shape
        self.group = group or shape.name
        self._table = table
        self.blocks = self._checked_blocks(blocks)
        self.n: int = self.blocks.shape[1]
        self._labels = labels
        if labels is not None and len(labels) != self.n:
            raise InputError(f"{shape.name}: {len(labels)} labels for {self.n} observations")
        self.observation_tiles = np.zeros((len(shape.observation_rows), padded_length(self.n)))
        self.observations = observations
        self.active = self._checked_active(active)
        self.loss: Loss | None = None
        self.is_constraint = False
        self.roots: FloatArray = np.zeros((0, 0))
        self.weights = np.zeros((shape.n_residuals, padded_length(self.n)))
        self.reweigh(sigmas)
        self._lay_out()

    def __len__(self) -> int:
        return self.n

    @property
    def name(self) -> str:
        """Name of the formula."""
        return self.shape.name

    @property
    def n_scalars(self) -> int:
        """Number of scalar equations that count: residuals of active observations."""
        return int(np.count_nonzero(self.active)) * self.shape.n_residuals

    @property
    def observations(self) -> FloatArray:
        """(n, m) what was measured; a copy."""
        return np.array(self.observation_tiles[:, : self.n].T, order="C")

    @observations.setter
    def observations(self, new: ArrayLike | None) -> None:
        width = len(self.shape.observation_rows)
        array = np.zeros((self.n, 0)) if new is None else np.asarray(new, dtype=np.float64)
        if array.shape != (self.n, width) and not (array.shape == (self.n,) and width == 1):
            raise InputError(
                f"{self.name}: observations have shape {array.shape}; expected ({self.n}, {width})"
            )
        array = array.reshape(self.n, width)
        wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if wrong.size:
            raise InputError(f"{self.label(wrong[0])}: the observation is not finite: {array[wrong[0]]}")
        self.observation_tiles[:] = _padded(array.T, np.float64)

    def reweigh(self, sigmas: ArrayLike) -> None:
        """Gives the observations other sigmas (number, (n,) or (n, n_residuals)), between two iterations."""
        self.sigmas = self._checked_sigmas(sigmas)
        self.weights[:, : self.n] = np.where(self.active, 1.0 / self.sigmas.T, 0.0)

    def reweight(self, residuals: FloatArray) -> None:
        """Sets the weights that the loss gives to residuals (n, n_residuals)."""
        if self.loss is not None:
            norm = np.linalg.norm(residuals / self.sigmas, axis=1)
            factor = np.sqrt(self.loss.weights(np.where(np.isfinite(norm), norm, 0.0)))[:, None]
            self.weights[:, : self.n] = np.where(self.active[:, None], factor / self.sigmas, 0.0).T

    def correlate(self, covariances: ArrayLike) -> None:
        """Gives the residuals of each observation a full covariance, (m, m) or (n, m, m), in their units.

        The equations are then whitened: multiplied by U, with U' U the inverse of the covariance; their
        sigmas are 1, and `whitened` gives the residuals that the adjustment sees.

        Raises:
            InputError: a matrix is not symmetric and positive definite; the observation is named.
        """
        m = self.shape.n_residuals
        given = np.asarray(covariances, dtype=np.float64)
        if given.shape not in ((m, m), (self.n, m, m)):
            raise InputError(f"{self.name}: covariances have shape {given.shape}; expected {(self.n, m, m)}")
        given = np.broadcast_to(given, (self.n, m, m))
        with np.errstate(invalid="ignore"):
            variances = (
                np.linalg.eigvalsh(given) if np.isfinite(given).all() else np.full((self.n, m), np.nan)
            )
            wrong = np.flatnonzero(
                ~(variances[:, 0] > 0.0) | (given != given.transpose(0, 2, 1)).any(axis=(1, 2))
            )
        if wrong.size:
            raise InputError(
                f"{self.label(wrong[0])}: the covariance is not symmetric and positive definite:\n"
                f"{given[wrong[0]]}"
            )
        roots = np.linalg.cholesky(np.linalg.inv(given)).transpose(0, 2, 1)
        rows, columns = np.triu_indices(m)
        self.roots = _padded(roots[:, rows, columns].T, np.float64)
        self.sigmas = np.ones((self.n, m))
        self.weights[:, : self.n] = np.where(self.active, 1.0, 0.0)

    def whitened(self, rows: FloatArray, chosen: ArrayLike | None = None) -> FloatArray:
        """(m, k, n) residual rows times the roots of the inverse covariances; as they are without any.

        Args:
            rows: (m, k, n) for each residual, k values of each observation.
            chosen: observations that the last axis stands for; all when None.
        """
        if not self.roots.size:
            return rows
        m = self.shape.n_residuals
        roots = np.zeros((m, m, rows.shape[2]))
        entries = self.roots[:, : self.n] if chosen is None else self.roots[:, np.asarray(chosen)]
        roots[np.triu_indices(m)] = entries
        return np.asarray(np.einsum("rsn,skn->rkn", roots, rows))

    def robust_weights(self) -> FloatArray:
        """(n,) what the loss makes of the weight of each observation: 1 full, 0 none."""
        return np.square(self.weights[0, : self.n] * self.sigmas[:, 0])

    def dimensions_of(self, first: int, last: int) -> IntArray:
        """What the drivers are told of the observations from `first` to before `last`."""
        return np.array([last, *self.dimensions[1:4], first])

    def label(self, row: int) -> str:
        """What to call one observation in a message: its label, or the blocks it joins."""
        if self._labels is not None:
            return f"{self.name} {self._labels[row]}"
        names = dict.fromkeys(self._table.names[block] for block in self.blocks[:, row])
        return f"{self.name} {' -> '.join(names)} (row {row})"

    def _checked_blocks(self, blocks: Mapping[str, ArrayLike]) -> IntArray:
        roles = self.shape.roles
        expected, given = {role.name for role in roles}, set(blocks)
        if expected != given:
            missing = ", ".join(sorted(expected - given)) or "none"
            unknown = ", ".join(sorted(given - expected)) or "none"
            raise InputError(
                f"{self.name}: block arguments missing: {missing}; not in the formula: {unknown}"
            )
        columns = [self._checked_role(role, blocks[role.name]) for role in roles]
        n = max(len(column) for column in columns)
        for role, column in zip(roles, columns, strict=True):
            if len(column) not in (1, n):
                raise InputError(f"{self.name}, {role.name}: {len(column)} ids; other arguments have {n}")
        return np.array([np.broadcast_to(column, n) for column in columns])

    def _checked_role(self, role: Role, ids: ArrayLike) -> IntArray:
        table, what = self._table, f"{self.name}, {role.name}"
        array = table.checked(ids, what)
        accepted = np.isin(table.kind[array], _accepted(role)) & (table.size[array] == role.size)
        wrong = np.flatnonzero(~accepted)
        if wrong.size:
            block = array[wrong[0]]
            kind = Kind(table.kind[block]).label
            raise InputError(
                f"{what}: row {wrong[0]} gives {table.names[block]!r}, a {kind} of {table.size[block]}; "
                f"the formula wants a {role.kind} of {role.size}"
            )
        return array

    def _checked_sigmas(self, sigmas: ArrayLike) -> FloatArray:
        shape = (self.n, self.shape.n_residuals)
        array = np.asarray(sigmas, dtype=np.float64)
        if array.ndim == 1 and array.shape == (self.n,):
            array = array[:, None]
        if array.ndim and array.shape not in (shape, (self.n, 1)):
            raise InputError(
                f"{self.name}: sigmas have shape {array.shape}; expected a number, ({self.n},) or {shape}"
            )
        array = np.broadcast_to(array, shape)
        wrong = np.flatnonzero(~(np.isfinite(array) & (array > 0.0)).all(axis=1))
        if wrong.size:
            row = wrong[0]
            raise InputError(f"{self.label(row)}: sigma must be positive and finite, not {array[row]}")
        return array

    def _checked_active(self, active: ArrayLike | None) -> BoolArray:
        array = np.ones(self.n, dtype=bool) if active is None else np.array(active, dtype=bool)
        if array.shape != (self.n,):
            raise InputError(f"{self.name}: active has shape {array.shape}; expected ({self.n},)")
        return array

    def _lay_out(self) -> None:
        """The arrays that the drivers take, in their order."""
        shape, table = self.shape, self._table
        contexts = table.context_start[self.blocks]
        for contexts_of_role, role in zip(contexts, shape.roles, strict=True):
            contexts_of_role += 9 if role.transposed else 0
        self.roles = np.array(
            [(role.row, role.size, role.context_row, role.context_size) for role in shape.roles],
            dtype=np.int64,
        )
        self.starts = _padded(table.start[self.blocks], np.uint32)
        self.contexts = _padded(contexts, np.uint32)
        self.observation_rows = np.array(shape.observation_rows, dtype=np.int64)
        self.dimensions = np.array(
            [self.n, shape.n_unknowns, shape.n_residuals, shape.first_row, 0], dtype=np.int64
        )


def _accepted(role: Role) -> tuple[Kind, ...]:
    """Kinds of blocks that may stand for a role; a vector of one is a scalar."""
    kind = next(kind for kind in Kind if kind.label == role.kind)
    return (Kind.VECTOR, Kind.SCALAR) if kind in (Kind.VECTOR, Kind.SCALAR) else (kind,)


def formula_shape(formula: str | Kernel) -> Shape:
    """The shape of a generated formula; its kernels are compiled or read from the cache on first use."""
    from obseq.kernels.loading import load
    from obseq.kernels.tiles import aligned_tiles

    kernel = load(formula) if isinstance(formula, str) else formula
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
        tuple(n_unknowns + row for row in kernel.measured),
        n_unknowns,
        len(kernel.residuals),
        kernel.first_result,
        lambda: kernel.value_and_jacobian_address,
        lambda: kernel.value_address,
        lambda: aligned_tiles(kernel.rows, 1, kernel.constant_rows),
    )


def linear_shape(table: UnknownTable, columns: Sequence[IntArray]) -> Shape:
    """The shape of plain linear rows over blocks: their coefficients and value are the observations."""
    roles, row = [], 0
    for number, ids in enumerate(columns):
        _, kind, size = table.uniform(ids, f"linear rows, block {number}")
        if kind not in (Kind.POINT3, Kind.POINT2, Kind.VECTOR, Kind.SCALAR):
            raise InputError(f"linear rows: {table.names[ids[0]]!r} is a {kind.label}, not a linear unknown")
        roles.append(Role(str(number), kind.label, row, size))
        row += size
    rows = 3 * row + 2
    return Shape(
        "linear",
        tuple(roles),
        tuple(range(row, 2 * row + 1)),
        row,
        1,
        2 * row + 1,
        lambda: 0,
        lambda: 0,
        lambda: aligned_zeros(rows * STRIDE),
    )


def aligned_zeros(n: int) -> FloatArray:
    """(n,) zeros at a 64-byte boundary."""
    buffer = np.zeros(n + 8)
    offset = (-buffer.ctypes.data % 64) // 8
    return buffer[offset : offset + n]
