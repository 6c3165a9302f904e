"""Statistics of residuals at control points: what a check of orientations reports."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray


class Extreme(NamedTuple):
    """An extreme residual of each coordinate.

    Attributes:
        values: (k,) one per coordinate.
        names: the point that carries each.
    """

    values: FloatArray
    names: tuple[str, ...]


class ResidualStatistics(NamedTuple):
    """Statistics of the coordinates of residuals; variances divide by their number.

    Attributes:
        minimum: smallest of each coordinate.
        maximum: largest of each coordinate.
        median: (k,).
        mean: (k,).
        variance: (k,).
        sigma: (k,) standard deviation.
    """

    minimum: Extreme
    maximum: Extreme
    median: FloatArray
    mean: FloatArray
    variance: FloatArray
    sigma: FloatArray


def residual_statistics(names: Sequence[str], residuals: FloatArray) -> ResidualStatistics:
    """Statistics of residuals (n, k) of named points; give absolute values for absolute statistics."""
    each = np.arange(residuals.shape[1])
    low, high = residuals.argmin(axis=0), residuals.argmax(axis=0)
    return ResidualStatistics(
        Extreme(residuals[low, each], tuple(names[row] for row in low)),
        Extreme(residuals[high, each], tuple(names[row] for row in high)),
        np.median(residuals, axis=0),
        residuals.mean(axis=0),
        residuals.var(axis=0),
        residuals.std(axis=0),
    )
