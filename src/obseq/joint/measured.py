"""What the residuals of a formula are residuals of: the number that was measured, and its unit."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.kernels.loading import load

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray
    from obseq.kernels.loading import Kernel
    from obseq.leastsquares import Batch, LeastSquares

STEP = 2.0**-20
"""By which a measured number is changed: a sum with it is exact for lengths and angles."""
SAME = 1e-6
"""Within which a slope is -1."""


class Column(NamedTuple):
    """A residual of a formula, and what was measured for it.

    Attributes:
        type: name of the formula; with that of the residual where it has several.
        residual: its number.
        values: (n,) what was measured; 0 where the residual is one of nothing measured.
        unit: of it; empty where it is not known.
    """

    type: str
    residual: int
    values: FloatArray
    unit: str


def columns_of(system: LeastSquares, batch: Batch, formula: str | Kernel) -> Iterator[Column]:
    """The residuals of a batch of a formula, each with the number whose error it shows as it is.

    That is the one of which it falls by 1 where the number grows by 1: computed minus observed.
    """
    kernel = load(formula) if isinstance(formula, str) else formula
    count = batch.shape.n_residuals
    named = [kernel.name] if count == 1 else [f"{kernel.name} {name}" for name in kernel.residuals]
    units = [unit for one in kernel.inputs for unit in [one.unit] * one.size]
    slopes = _slopes(system, batch, len(units))
    given = batch.observations
    for k, name in enumerate(named):
        own = [j for j in range(len(units)) if np.abs(slopes[j][:, k] + 1.0).max(initial=0.0) < SAME]
        if own:
            yield Column(name, k, given[:, own[0]].copy(), units[own[0]])
        else:
            yield Column(name, k, np.zeros(batch.n), "")


def _slopes(system: LeastSquares, batch: Batch, count: int) -> list[FloatArray]:
    """For each measured number, (n, n_residuals) by how much residuals change when it grows, for one."""
    given, before, found = batch.observations.copy(), system.residuals(batch), []
    trial = copy.copy(batch)
    trial.kept = None
    trial.observation_tiles = batch.observation_tiles.copy()
    for j in range(count):
        changed = given.copy()
        changed[:, j] += STEP
        trial.observations = changed
        found.append((system.residuals(trial) - before) / (changed[:, j] - given[:, j])[:, None])
    return found
