"""Normal equations of a set of batches and priors: assembled at the current values, refilled in place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import ObseqError
from obseq.leastsquares.batches import aligned_zeros, padded_length
from obseq.leastsquares.layout import store_layout

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from obseq.leastsquares.batches import Batch
    from obseq.leastsquares.layout import BatchLayout
    from obseq.leastsquares.priors import Prior
    from obseq.leastsquares.unknowns import UnknownTable

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]
    BoolArray = NDArray[np.bool_]


class DivergenceError(ObseqError):
    """An equation, or a step, is no longer finite; the message names the first such observation."""


@dataclass(frozen=True)
class Linearisation:
    """The least squares problem around the current values.

    Attributes:
        values: (nnz,) lower triangle of N = J' W J in the order of the pattern.
        gradient: (n_free,) J' W r.
        squares: sum of weighted squared residuals by group.
    """

    values: FloatArray
    gradient: FloatArray
    squares: dict[str, float]

    @property
    def cost(self) -> float:
        """Sum of all weighted squared residuals."""
        return sum(self.squares.values())


class NormalEquations:
    """Assembles the equations of a table of unknowns; the pattern is that of its creation."""

    def __init__(self, table: UnknownTable, batches: Sequence[Batch], priors: Sequence[Prior]) -> None:
        self.table = table
        self.batches = tuple(batches)
        self.priors = tuple(priors)
        self.used = _used_blocks(table, batches, priors)
        self.layout = store_layout(table, self.batches, self.used)
        self.pattern = self.layout.matrix
        self.free = self.layout.free
        self._store = aligned_zeros(self.layout.size)  # behind the matrix, all zero between two assemblies

    @property
    def n_unknowns(self) -> int:
        """Number of free unknowns."""
        return self.pattern.n

    def assemble(self) -> Linearisation:
        """Normal matrix, gradient and sums of squares at the current values.

        The values are the same array at each call: they last until the next one.

        Raises:
            DivergenceError: a residual or a derivative is not finite.
        """
        squares: dict[str, float] = {}
        self._store[: self.pattern.nnz] = 0.0
        for batch, layout in zip(self.batches, self.layout.batches, strict=True):
            total = self._assemble_batch(batch, layout)
            if not np.isfinite(total):
                self._store[:] = 0.0
                raise DivergenceError(self._explain(batch))
            squares[batch.group] = squares.get(batch.group, 0.0) + total
        values, gradient = self._poured()
        self._add_priors(values, gradient, squares)
        if not (np.isfinite(gradient).all() and np.isfinite(values).all()):
            raise DivergenceError(self._explain(*self.batches))
        return Linearisation(values, gradient, squares)

    def sums_of_squares(self) -> dict[str, float]:
        """Sum of weighted squared residuals by group, from values alone."""
        squares: dict[str, float] = {}
        for batch in self.batches:
            scaled = residuals(self.table, batch).T * batch.weights[:, : batch.n]
            total = float(np.sum(np.square(scaled[:, batch.active])))
            if not np.isfinite(total):
                raise DivergenceError(self._explain(batch))
            squares[batch.group] = squares.get(batch.group, 0.0) + total
        for prior in self.priors:
            squares[prior.group] = squares.get(prior.group, 0.0) + prior.sum_of_squares(self.table.values)
        return squares

    def _assemble_batch(self, batch: Batch, layout: BatchLayout) -> float:
        from obseq.leastsquares.drivers import assemble

        return float(
            assemble(
                batch.shape.kernel(),
                batch.shape.new_tile(),
                batch.dimensions,
                batch.roles,
                batch.starts,
                batch.contexts,
                self.table.padded_values,
                self.table.padded_context,
                batch.observation_tiles,
                batch.observation_rows,
                batch.weights,
                layout.record_rows,
                layout.pairs,
                layout.positions,
                layout.heights,
                aligned_zeros(layout.scratch),
                self._store,
            )
        )

    def _poured(self) -> tuple[FloatArray, FloatArray]:
        from obseq.leastsquares.pouring import pour_diagonal, pour_pairs

        store, number, first = self._store, self.free.number, self.free.first
        start, size, indptr = self.table.start, self.table.size, self.pattern.indptr
        gradient = np.zeros(self.pattern.n)
        pour_diagonal(store, self.layout.diagonal, start, size, number, indptr, gradient)
        pour_pairs(store, self.layout.stored, start, size, number, first, indptr)
        return store[: self.pattern.nnz], gradient

    def _add_priors(self, values: FloatArray, gradient: FloatArray, squares: dict[str, float]) -> None:
        for prior in self.priors:
            squares[prior.group] = squares.get(prior.group, 0.0) + prior.sum_of_squares(self.table.values)
            row = self.free.number[prior.scalars]
            free = row >= 0
            weight = np.square(prior.weights[free])
            np.add.at(values, self.pattern.diagonal[row[free]], weight)
            np.add.at(gradient, row[free], weight * prior.residuals(self.table.values)[free])

    def _explain(self, *batches: Batch) -> str:
        for batch in batches:
            rows = jacobian_rows(self.table, batch)
            wrong = np.flatnonzero(~np.isfinite(rows).all(axis=0) & batch.active)
            if wrong.size:
                more = f" ({wrong.size} observations of the batch are so)" if wrong.size > 1 else ""
                return (
                    f"{batch.label(wrong[0])}: the residual or its derivatives are not finite{more}. "
                    "The equation is undefined there: correct the initial values, or remove the observation"
                )
        return "the normal equations overflow: check the sigmas and the units of the observations"


def _used_blocks(table: UnknownTable, batches: Sequence[Batch], priors: Sequence[Prior]) -> BoolArray:
    """(n_blocks,) True for the blocks that an active observation or a prior touches."""
    used = np.zeros(len(table), dtype=bool)
    for batch in batches:
        used[batch.blocks[:, batch.active]] = True
    for prior in priors:
        used[prior.ids] = True
    return used


def residuals(table: UnknownTable, batch: Batch) -> FloatArray:
    """(n, n_residuals) computed minus observed, at the current values, not divided by the sigmas."""
    rows = _evaluated(table, batch, batch.shape.value_kernel(), batch.shape.n_residuals)
    return np.ascontiguousarray(rows.T)


def jacobian_rows(table: UnknownTable, batch: Batch) -> FloatArray:
    """(n_residuals + n_residuals * n_unknowns, n) residuals, then derivatives residual by residual."""
    count = batch.shape.n_residuals * (1 + batch.shape.n_unknowns)
    return _evaluated(table, batch, batch.shape.kernel(), count)


def _evaluated(table: UnknownTable, batch: Batch, kernel: int, rows: int) -> FloatArray:
    from obseq.leastsquares.drivers import evaluate

    results = np.empty((rows, padded_length(batch.n)))
    evaluate(
        kernel,
        batch.shape.new_tile(),
        batch.dimensions,
        batch.roles,
        batch.starts,
        batch.contexts,
        table.padded_values,
        table.padded_context,
        batch.observation_tiles,
        batch.observation_rows,
        rows,
        results,
    )
    return results[:, : batch.n]
