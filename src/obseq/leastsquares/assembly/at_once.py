"""Loops over a short batch as Python's own builtins: a usual call takes longer than their work.

They keep Python's lock, a fraction of a millisecond.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from obseq.compilation.loops import HAS_BUILTINS
from obseq.leastsquares.loops.loop_arguments import BatchMembers, Present

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.compilation.loops import QuickLoop
    from obseq.leastsquares.assembly.small_loops import TableMembers
    from obseq.leastsquares.loops.loop_arguments import BlockTable
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.shapes import Shape
    from obseq.leastsquares.problem.unknowns import UnknownTable

MOST_OBSERVATIONS = 4096
"""Observations of a short batch."""


def is_short(n: int) -> bool:
    """Whether so many observations are treated at once."""
    return HAS_BUILTINS and n <= MOST_OBSERVATIONS


class _Kept(NamedTuple):
    """The arrays of a batch, and what they were made for."""

    weights: FloatArray
    roots: FloatArray
    members: BatchMembers


def batch_members(batch: Batch) -> BatchMembers:
    """The arrays of a batch, kept with it as long as its weights are; none of these where it has clusters."""
    kept = batch.kept
    if isinstance(kept, _Kept) and kept.weights is batch.weights and kept.roots is batch.roots:
        return kept.members
    members = BatchMembers(
        batch.roles,
        batch.starts,
        batch.contexts,
        batch.observation_tiles,
        batch.observation_rows,
        batch.weights if batch.clusters is None else np.zeros_like(batch.weights),
        batch.roots,
        batch.carried,
        batch.carriers,
    )
    batch.kept = _Kept(batch.weights, batch.roots, members)
    return members


def present_values(table: UnknownTable) -> Present:
    """The current values, as the loops take them."""
    return Present(table.padded_values, table.padded_context)


def plan_of(shape: Shape, kernel: int, n: int, number: int = 0) -> IntArray:
    """The numbers of a batch of n observations, as `add_batch` takes them."""
    plan = [kernel, shape.n_unknowns, shape.n_residuals, shape.first_row, n, number]
    return np.array(plan, dtype=np.int64)


def evaluate_at_once(
    plan: IntArray, tile: FloatArray, members: BatchMembers, present: Present, results: FloatArray
) -> bool:
    """Residuals, and more, of a short batch in `results` (rows, n padded); False when nothing was done."""
    return _evaluate_batch()(plan, tile, *members, *present, results) is results


@cache
def _evaluate_batch() -> Callable[..., object]:
    from obseq.leastsquares.assembly.small_loops import evaluate_batch

    return cast("QuickLoop", evaluate_batch).builtin


class _Given(NamedTuple):
    """What the loop is given of a batch besides its arrays."""

    plan: IntArray
    tile: FloatArray
    table: TableMembers
    scratch: FloatArray


class BatchesAtOnce:
    """Batches that are added to the store of normal equations.

    Args:
        table: the unknowns.
        batches: the observations, all of them short.
        layouts: where the store has their blocks.
        room: a tile and room for records for a batch.

    Attributes:
        n: number of batches.
    """

    def __init__(
        self,
        table: UnknownTable,
        batches: Sequence[Batch],
        layouts: Sequence[BlockTable],
        room: Callable[[Batch, BlockTable], tuple[FloatArray, FloatArray]],
    ) -> None:
        from obseq.leastsquares.assembly.small_loops import TableMembers, add_batch

        self._add_batch = cast("QuickLoop", add_batch).builtin
        self._table, self._batches = table, batches
        self._given, self.n = [], len(batches)
        for number, (batch, blocks) in enumerate(zip(batches, layouts, strict=True)):
            tile, scratch = room(batch, blocks)
            plan = plan_of(batch.shape, batch.shape.kernel(), batch.n, number)
            self._given.append(_Given(plan, tile, TableMembers(*blocks[:-1]), scratch))

    def add(self, store: FloatArray, squares: FloatArray) -> bool:
        """Adds all batches, at the current values.

        Args:
            store: zeros; the blocks of the normal equations afterwards.
            squares: (n_batches or more,) zeros; the sums of weighted squared residuals.

        Returns:
            Whether it was done.
        """
        present, add_batch = present_values(self._table), self._add_batch
        for batch, (plan, tile, table, scratch) in zip(self._batches, self._given, strict=True):
            members = batch_members(batch)
            done = add_batch(plan, tile, *members, *present, *table, scratch, store, squares)
            if done is not squares:
                return False
        return True
