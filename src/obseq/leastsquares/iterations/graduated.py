"""Robust losses that begin wide and are narrowed from one iteration to the next."""

from __future__ import annotations

from collections.abc import Callable

from obseq.errors import InputError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.losses import Loss


def graduated(
    losses: dict[Batch, Loss], start: float = 64.0, ratio: float = 2.0
) -> Callable[[object, int], None]:
    """A `before_iteration` that narrows losses step by step: graduated non-convexity.

    The first iterations are nearly least squares, whatever the loss: a start that is far off does not
    decide by itself which observations are left out. To be used with a number of iterations above
    log(start) / log(ratio).

    Args:
        losses: the final loss of each batch.
        start: factor of the constants at the first iteration.
        ratio: what the factor is divided by from one iteration to the next, until it is 1.
    """
    if not (start >= 1.0 and ratio > 1.0):
        raise InputError(f"graduated: start {start} must be at least 1, and ratio {ratio} above 1")

    def narrow(_: object, iteration: int) -> None:
        factor = max(1.0, start / ratio**iteration)
        for batch, loss in losses.items():
            batch.loss = loss.widened(factor)

    return narrow
