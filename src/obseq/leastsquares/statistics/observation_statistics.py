"""The numbers that judge single observations, from their leverages; formulas are in docs/statistics.md."""

from __future__ import annotations

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.dataclass import dataclass

UNCONTROLLED = 1e-6
"""Redundancy number below which an observation is not controlled: a blunder of 4000 sigmas would not show."""


@dataclass(frozen=True)
class Numbers:
    """What follows from the leverages of some observations, all arrays (n, n_residuals).

    Attributes:
        redundancy: diagonal of the matrix that maps errors of the observations to residuals.
        controlled: True where other observations control this one.
        left_out: residual if this scalar observation alone were left out; NaN where uncontrolled.
        spread: its standard deviation.
        effect: length sqrt(dx' N dx) of what a bias of one unit does to the unknowns.
    """

    redundancy: FloatArray
    controlled: BoolArray
    left_out: FloatArray
    spread: FloatArray
    effect: FloatArray


def independent_numbers(
    residuals: FloatArray, sigmas: FloatArray, leverages: FloatArray, weights: FloatArray
) -> Numbers:
    """The numbers of uncorrelated observations.

    Args:
        residuals: (n, n_residuals).
        sigmas: (n, n_residuals).
        leverages: (n, n_residuals) a Q a', a being divided by the sigma.
        weights: (n, n_residuals) robust weights.
    """
    redundancy = 1.0 - weights * leverages
    controlled = redundancy > UNCONTROLLED
    known = np.where(controlled, redundancy, np.nan)
    spread = sigmas * np.sqrt(1.0 + leverages / known)
    effect = weights * np.sqrt(np.clip(leverages, 0.0, None)) / sigmas
    return Numbers(redundancy, controlled, residuals / known, spread, effect)


def correlated_numbers(
    residuals: FloatArray, roots: FloatArray, leverages: FloatArray, weights: FloatArray
) -> Numbers:
    """The numbers of observations whose residuals are correlated within each observation.

    A bias of residual i is the direction u_i, column i of U, of the whitened residuals.

    Args:
        residuals: (n, m).
        roots: (n, m, m) U, with U' U the inverse of the covariance.
        leverages: (n, m, m) G = U A Q A' U'.
        weights: (n,) robust weights g.
    """
    remaining = np.eye(roots.shape[1]) - weights[:, None, None] * leverages
    redundancy = np.diagonal(np.linalg.solve(roots, remaining @ roots), axis1=1, axis2=2)
    size, kept = _forms(roots, np.eye(roots.shape[1])), _forms(roots, remaining)
    controlled = kept > UNCONTROLLED * size
    known = np.where(controlled, kept, np.nan)
    variance = _forms(roots, residual_cofactors(leverages, weights))
    left_out = np.einsum("nki,nkj,nj->ni", roots, roots, residuals) / known
    effect = weights[:, None] * np.sqrt(np.clip(_forms(roots, leverages), 0.0, None))
    deviation = np.sqrt(np.clip(variance, 0.0, None)) / known
    return Numbers(np.asarray(redundancy), controlled, left_out, deviation, effect)


def residual_cofactors(leverages: FloatArray, weights: FloatArray) -> FloatArray:
    """(n, m, m) cofactors of whitened residuals, for leverages (n, m, m) and robust weights (n,)."""
    remaining = np.eye(leverages.shape[1]) - weights[:, None, None] * leverages
    return np.asarray((remaining + leverages) @ np.swapaxes(remaining, 1, 2))


def _forms(directions: FloatArray, matrices: FloatArray) -> FloatArray:
    """(n, m) u_i' M u_i for the columns u_i of each matrix of directions (n, m, m)."""
    return np.asarray(np.einsum("nki,nki->ni", directions, matrices @ directions))
