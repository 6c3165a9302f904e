"""Residuals and derivatives of a batch at the current values, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.leastsquares.assembly.threads import in_threads, share_bounds, share_count
from obseq.leastsquares.loops.loop_arguments import BatchArrays, Present, Span
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.padding import padded_length
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.unknowns import UnknownTable


class _Kept(NamedTuple):
    """The arrays of a batch, and the weights and roots that they were made for."""

    weights: FloatArray
    roots: FloatArray
    arrays: BatchArrays


def batch_arrays(batch: Batch) -> BatchArrays:
    """A batch as the loops take it, kept with it while its weights are; clusters have none."""
    kept, shape = batch.kept, batch.shape
    if isinstance(kept, _Kept) and kept.weights is batch.weights and kept.roots is batch.roots:
        return kept.arrays
    arrays = BatchArrays(
        shape.n_unknowns,
        shape.n_residuals,
        shape.first_row,
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
    batch.kept = _Kept(batch.weights, batch.roots, arrays)
    return arrays


def present_values(table: UnknownTable) -> Present:
    """The current values, as the loops take them."""
    return Present(table.padded_values, table.padded_context)


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
    from obseq.leastsquares.loops.accumulation import evaluate

    arrays, present = batch_arrays(batch), present_values(table)
    results = np.empty((rows, padded_length(batch.n)))
    is_shared = share_count(batch.n, threads) > 1
    bounds = share_bounds([batch.n], threads)[:, 0].tolist() if is_shared else [0, batch.n]

    def evaluate_share(share: int) -> None:
        room = tile(share) if tile else batch.shape.new_tile()
        evaluate(kernel, room, arrays, Span(bounds[share], bounds[share + 1]), present, rows, results)

    in_threads(evaluate_share, len(bounds) - 1)
    return results[:, : batch.n]


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
