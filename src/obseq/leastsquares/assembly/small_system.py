"""Small systems: an iteration costs what Python does between loops; from blocks to step there is but one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from obseq.leastsquares.assembly.evaluation import present_values
from obseq.leastsquares.solvers.rank import CLEAR, SUSPICIOUS

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.compilation.loops import QuickLoop
    from obseq.leastsquares.assembly.prior_rows import PriorRows
    from obseq.leastsquares.assembly.small_loops import Outcome
    from obseq.leastsquares.assembly.store import StoreLayout
    from obseq.leastsquares.problem.unknowns import UnknownTable

MOST_UNKNOWNS = 64
"""Unknowns of a small matrix: beyond, LAPACK is faster than plain loops."""


class SmallSystem:
    """The equations of a system without eliminated blocks, clusters or viscosities, solved where it is small.

    Args:
        table: the unknowns.
        priors: the priors.
        layout: where the store has their blocks.
    """

    def __init__(self, table: UnknownTable, priors: PriorRows, layout: StoreLayout) -> None:
        from obseq.leastsquares.assembly.small_loops import MatrixRoom, find_step

        self._find_step = cast("QuickLoop", find_step).builtin
        self._table, self._priors, self._layout = table, priors, layout
        n, pattern = layout.matrix.n, layout.matrix
        places = pattern.columns() * n + pattern.indices
        self._matrix = MatrixRoom(layout.diagonal, layout.stored, places, np.zeros(n * n), np.zeros(n))
        self._tolerance = np.array([SUSPICIOUS])

    def iterate(self, store: FloatArray, squares: FloatArray) -> Outcome | None:
        """The normal equations at the current values, and their Gauss-Newton step.

        Args:
            store: the small blocks; the matrix afterwards.
            squares: (n_priors,) zeros; the sums of weighted squared residuals of the priors.

        Returns:
            None where numbers are not finite, or the matrix is not clearly regular.
        """
        from obseq.leastsquares.assembly.small_loops import Outcome

        layout, n, table = self._layout, self._layout.matrix.n, self._table
        step, weights = np.zeros((2, table.n_scalars))
        found = Outcome(np.zeros(n), np.empty((1, n)), step, weights, np.empty(2))
        done = self._find_step(
            store,
            *self._matrix,
            *layout.unknowns,
            *self._priors.arrays(),
            *present_values(table),
            layout.free.scalars,
            self._tolerance,
            squares,
            *found,
        )
        is_clear = done is found.numbers and found.numbers[0] > CLEAR
        return found if is_clear and math.isfinite(found.numbers[1]) else None
