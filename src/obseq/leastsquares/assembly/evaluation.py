"""Residuals and derivatives of a batch at the current values, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.leastsquares.assembly.at_once import (
    batch_members,
    evaluate_at_once,
    is_short,
    plan_of,
    present_values,
)
from obseq.leastsquares.assembly.threads import in_threads, share_bounds, share_count
from obseq.leastsquares.loops.loop_arguments import BatchArrays, BatchMembers, Present, Span
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.padding import padded_length
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.shapes import Shape
from obseq.leastsquares.problem.unknowns import UnknownTable


def batch_arrays(batch: Batch) -> BatchArrays:
    """A batch as the loops take it; no weights where clusters are added otherwise."""
    shape = batch.shape
    return BatchArrays(shape.n_unknowns, shape.n_residuals, shape.first_row, *batch_members(batch))


def used_blocks(table: UnknownTable, batches: Sequence[Batch], priors: Sequence[Prior]) -> BoolArray:
    """(n_blocks,) True for the blocks that an active observation or a prior touches."""
    used = np.zeros(len(table), dtype=bool)
    for batch in batches:
        is_whole = np.count_nonzero(batch.active) == batch.n
        used[batch.blocks if is_whole else batch.blocks[:, batch.active]] = True
    for prior in priors:
        used[prior.ids] = True
    return used


def raw_residuals(
    table: UnknownTable, batch: Batch, threads: int = 1, tile: Callable[[int], FloatArray] | None = None
) -> FloatArray:
    """(n, n_residuals) computed minus observed, at the current values, in their units.

    Args:
        table: the unknowns.
        batch: the observations.
        threads: how many share them.
        tile: gives each share a tile of the formula to work in; they are made anew when None.
    """
    return np.ascontiguousarray(residual_rows(table, batch, threads, tile).T)


def residual_rows(
    table: UnknownTable, batch: Batch, threads: int = 1, tile: Callable[[int], FloatArray] | None = None
) -> FloatArray:
    """(n_residuals, n) the same; arguments as of `raw_residuals`."""
    return _evaluated(table, batch, batch.shape.value_kernel(), batch.shape.n_residuals, threads, tile)


def whitened(batch: Batch, raw: FloatArray) -> FloatArray:
    """(n, n_residuals) what the sigmas stand for: `raw_residuals`, whitened where they are correlated."""
    if not has_whitening(batch):
        return raw
    return np.ascontiguousarray(whitened_residual_rows(batch, raw.T).T)


def has_whitening(batch: Batch) -> bool:
    """Whether its sigmas stand for other residuals than the raw ones."""
    return batch.is_correlated or batch.clusters is not None


def jacobian_rows(table: UnknownTable, batch: Batch) -> FloatArray:
    """(n_residuals + n_residuals * n_unknowns, n) residuals, then derivatives residual by residual.

    They are whitened where the residuals are correlated.
    """
    m, count = batch.shape.n_residuals, batch.shape.n_unknowns
    rows = _evaluated(table, batch, batch.shape.kernel(), m * (1 + count))
    if not batch.roots.size:
        return rows
    derivatives = batch.whitened(rows[m:].reshape(m, count, -1)).reshape(m * count, -1)
    return np.concatenate([batch.whitened(rows[:m, None])[:, 0], derivatives])


def whitened_residual_rows(batch: Batch, rows: FloatArray) -> FloatArray:
    """(n_residuals, n) what the sigmas stand for, of `residual_rows`."""
    return batch.whitened(rows[:, None])[:, 0] if has_whitening(batch) else rows


def _evaluated(
    table: UnknownTable,
    batch: Batch,
    kernel: int,
    rows: int,
    threads: int = 1,
    tile: Callable[[int], FloatArray] | None = None,
) -> FloatArray:
    shape, members, present = batch.shape, batch_members(batch), present_values(table)
    results = np.empty((rows, padded_length(batch.n)))
    bounds = share_bounds([batch.n], threads)[:, 0].tolist() if share_count(batch.n, threads) > 1 else []

    def evaluate_share(share: int) -> None:
        from obseq.leastsquares.loops.accumulation import evaluate

        arrays, span = batch_arrays(batch), Span(bounds[share], bounds[share + 1])
        evaluate(kernel, room(share), arrays, span, present, rows, results)

    def room(share: int) -> FloatArray:
        return tile(share) if tile else shape.new_tile()

    if bounds:
        in_threads(evaluate_share, len(bounds) - 1)
    else:
        evaluate_members(members, shape, kernel, batch.n, room(0), present, results)
    return results[:, : batch.n]


def evaluate_members(
    members: BatchMembers,
    shape: Shape,
    kernel: int,
    n: int,
    tile: FloatArray,
    present: Present,
    results: FloatArray,
) -> None:
    """Writes residuals, and more, of n observations to `results` (rows, n padded)."""
    plan = plan_of(shape, kernel, n)
    if is_short(n) and evaluate_at_once(plan, tile, members, present, results):
        return
    from obseq.leastsquares.loops.accumulation import evaluate

    arrays = BatchArrays(shape.n_unknowns, shape.n_residuals, shape.first_row, *members)
    evaluate(kernel, tile, arrays, Span(0, n), present, len(results), results)


def why_not_finite(table: UnknownTable, batches: Sequence[Batch]) -> str:
    """What to tell of equations that are not finite: the first observation without a number."""
    for batch in batches:
        rows = jacobian_rows(table, batch)
        wrong = np.flatnonzero(~np.isfinite(rows).all(axis=0) & batch.active)
        if wrong.size:
            more = f" ({wrong.size} observations of the batch are so)" if wrong.size > 1 else ""
            return (
                f"{batch.label(wrong[0])}: the residual or its derivatives are not finite{more}. "
                "The equation is undefined there: correct the initial values, or remove the observation"
            )
    return "the normal equations overflow: check the sigmas and the units of the observations"
