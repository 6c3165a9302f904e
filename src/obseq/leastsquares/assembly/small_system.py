"""Small systems: an iteration costs what Python does between the loops, and is one of two loops therefore."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from obseq.leastsquares.assembly.evaluation import batch_arrays, present_values
from obseq.leastsquares.solvers.rank import CLEAR, SUSPICIOUS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.compilation.loops import QuickLoop
    from obseq.leastsquares.assembly.prior_rows import PriorRows
    from obseq.leastsquares.assembly.small_loops import BatchMembers, Outcome, TableMembers
    from obseq.leastsquares.assembly.store import StoreLayout
    from obseq.leastsquares.loops.loop_arguments import BlockTable
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.unknowns import UnknownTable

MOST_UNKNOWNS = 64
"""Unknowns of a small matrix: beyond, LAPACK is faster than plain loops."""

MOST_OBSERVATIONS = 4096
"""Observations of a small system: their loops keep Python's lock, a fraction of a millisecond."""


class _Arguments(NamedTuple):
    """What the first loop is given of a batch."""

    plan: IntArray
    batch: BatchMembers
    table: TableMembers


class SmallSystem:
    """The equations of a system without eliminated blocks, clusters or viscosities, solved where it is small.

    Args:
        table: the unknowns.
        batches: the observations.
        priors: the priors.
        layout: where the store has their blocks.
        room: a tile and room for records for a batch.
    """

    def __init__(
        self,
        table: UnknownTable,
        batches: Sequence[Batch],
        priors: PriorRows,
        layout: StoreLayout,
        room: Callable[[Batch, BlockTable], tuple[FloatArray, FloatArray]],
    ) -> None:
        from obseq.leastsquares.assembly.small_loops import MatrixRoom, add_batch, find_step

        self._add_batch = cast("QuickLoop", add_batch).builtin
        self._find_step = cast("QuickLoop", find_step).builtin
        self._table, self._batches, self._priors, self._layout = table, batches, priors, layout
        n, pattern = layout.matrix.n, layout.matrix
        places = pattern.columns() * n + pattern.indices
        self._matrix = MatrixRoom(layout.diagonal, layout.stored, places, np.zeros(n * n), np.zeros(n))
        self._tolerance = np.array([SUSPICIOUS])
        self._rooms = [room(batch, blocks) for batch, blocks in zip(batches, layout.batches, strict=True)]
        self._kept: list[_Arguments | None] = [None] * len(batches)

    def iterate(self, store: FloatArray, squares: FloatArray) -> Outcome | None:
        """The normal equations at the current values, and their Gauss-Newton step.

        Args:
            store: zeros; the matrix afterwards.
            squares: (n_batches + n_priors,) zeros; the sums of weighted squared residuals.

        Returns:
            None where numbers are not finite, or the matrix is not clearly regular.
        """
        from obseq.leastsquares.assembly.small_loops import Outcome

        layout, n, table = self._layout, self._layout.matrix.n, self._table
        present = present_values(table)
        for number, batch in enumerate(self._batches):
            given, (tile, scratch) = self._arguments(number, batch), self._rooms[number]
            done = self._add_batch(
                given.plan, tile, *given.batch, *present, *given.table, scratch, store, squares
            )
            if done is not squares:
                return None
        step, weights = np.zeros((2, table.n_scalars))
        found = Outcome(np.zeros(n), np.empty((1, n)), step, weights, np.empty(2))
        rest = squares[len(self._batches) :]
        done = self._find_step(
            store,
            *self._matrix,
            *layout.unknowns,
            *self._priors.arrays(),
            *present,
            layout.free.scalars,
            self._tolerance,
            rest,
            *found,
        )
        is_clear = done is found.numbers and found.numbers[0] > CLEAR
        return found if is_clear and math.isfinite(found.numbers[1]) else None

    def _arguments(self, number: int, batch: Batch) -> _Arguments:
        """What the loop is given of a batch, kept as long as its weights are."""
        from obseq.leastsquares.assembly.small_loops import BatchMembers, TableMembers

        kept = self._kept[number]
        if kept is None or kept.batch.weights is not batch.weights or kept.batch.roots is not batch.roots:
            shape = batch.shape
            plan = [shape.kernel(), shape.n_unknowns, shape.n_residuals, shape.first_row, batch.n, number]
            arrays = batch_arrays(batch)
            kept = self._kept[number] = _Arguments(
                np.array(plan, dtype=np.int64),
                BatchMembers(*arrays[3:]),
                TableMembers(*self._layout.batches[number][:-1]),
            )
        return kept
