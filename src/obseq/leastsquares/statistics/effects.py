"""What the detectable bias of each observation does to points: external reliability by coordinates."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.statistics.reliability import Reliability

BIASES_AT_A_TIME = 128
"""Observations that are solved for together: memory is this times the number of unknowns."""


@dataclass(frozen=True, eq=False)
class Effects:
    """The point that the bias of each observation moves most.

    Attributes:
        places: (n,) its place in the list of points.
        shifts: (n, k) how far it moves; NaN where nothing controls the observation, or it is not active.
    """

    places: IntArray
    shifts: FloatArray


def effects_of_biases(quality: Reliability, batch: Batch, points: ArrayLike) -> Effects:
    """What the detectable biases of observations of one residual each do to points.

    Args:
        quality: the reliability of a solved system.
        batch: the observations.
        points: (m,) the points, blocks of coordinates that are alike.
    """
    state = quality.state
    biases = quality.of(batch).detectable[:, 0]
    scalars = state.equations.table.scalars(points)
    numbers = state.equations.free.number[scalars]
    found = Effects(np.zeros(batch.n, np.int64), np.full((batch.n, numbers.shape[1]), np.nan))
    wanted = np.flatnonzero(np.isfinite(biases) & state.weighing(batch).active)
    for first in range(0, len(wanted), BIASES_AT_A_TIME):
        rows = wanted[first : first + BIASES_AT_A_TIME]
        changes = state.solve(np.ascontiguousarray(state.influences(batch, rows) * biases[rows]))
        shifts = np.where(numbers[:, :, None] >= 0, changes[np.maximum(numbers, 0)], 0.0)
        most = np.argmax(np.square(shifts).sum(axis=1), axis=0)
        found.places[rows] = most
        found.shifts[rows] = shifts[most, :, np.arange(len(rows))]
    return found
