"""A least squares problem around the current values of its unknowns."""

from __future__ import annotations

from dataclasses import field

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass


@dataclass(frozen=True)
class Linearisation:
    """The least squares problem around the current values.

    Attributes:
        values: (nnz,) lower triangle of N = J' W J in the order of the pattern.
        gradient: (n_free,) J' W r.
        squares: sum of weighted squared residuals by group.
        eliminated: sum of g_t' N_tt^-1 g_t over the eliminated blocks, whose share of matrix and gradient is
            already subtracted.
        damping: what was added to the diagonal of N, as a share of it.
        diagonal: (n_scalars,) diagonal of N before damping and elimination; 0 where frozen.
    """

    values: FloatArray
    gradient: FloatArray
    squares: dict[str, float]
    eliminated: float = 0.0
    damping: float = 0.0
    diagonal: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def cost(self) -> float:
        """Sum of all weighted squared residuals."""
        return sum(self.squares.values())


@dataclass(frozen=True)
class SolvedLinearisation(Linearisation):
    """A linearisation with its Gauss-Newton step (n_scalars,), and the length of that, sqrt(dx' N dx)."""

    step: FloatArray = field(default_factory=lambda: np.zeros(0))
    length: float = 0.0
