"""Which observation one gross error is suspected in, when it explains what the sigmas do not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.leastsquares.statistics.hypothesis_tests import limit_by_others, scaled_by_others
from obseq.record_quality import KNOWN, SuspicionRecord
from obseq.survey.adjustment.known_coordinates import COMPONENTS
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.survey.adjustment.adjusted_quality import AdjustedQuality
    from obseq.survey.adjustment.known_coordinates import CoordinateResiduals
    from obseq.survey.model import FieldBook, Points

_LEVEL = 0.001
"""Probability that an observation is suspected where nothing is wrong."""
_SAME = 1e-6
"""Relative difference below which two standardised residuals cannot be told apart."""


def suspected(standardised: FloatArray, squares: float, redundancy: int) -> list[int]:
    """The observations one of which has a gross error: those of the largest |w|, if it is significant.

    All tests share the level (`scaled_by_others`, `limit_by_others`).

    Args:
        standardised: (n,) residuals over their own a priori standard deviations, NaN where not tested.
        squares: Weighted sum of squares of all residuals.
        redundancy: Its degrees of freedom.

    Returns:
        Rows; several where their |w| are the same, none where nothing is suspected.
    """
    sizes = np.abs(standardised[np.isfinite(standardised)])
    if not len(sizes) or redundancy < 2:
        return []
    worst = float(sizes.max())
    limit = limit_by_others(worst, squares, redundancy, _LEVEL / len(sizes))
    if scaled_by_others(worst, squares, redundancy) <= limit:
        return []
    return np.flatnonzero(np.abs(standardised) >= worst * (1.0 - _SAME)).tolist()


def suspicion(
    solution: LeastSquaresResult,
    quality: AdjustedQuality,
    book: FieldBook,
    points: Points,
    known: CoordinateResiduals,
) -> SuspicionRecord | None:
    """What one gross error is suspected in; None for nothing, or where reliability was not asked for."""
    judged = [part for part in (quality.observations, quality.known) if part is not None]
    if not judged or not solution.variance_factor:
        return None
    standardised = np.concatenate([part.standardised for part in judged])
    squares = solution.variance_factor * solution.redundancy
    rows = suspected(standardised, squares, solution.redundancy)
    if not rows:
        return None
    names = tuple(_name(row, book, points, known) for row in rows)
    first, biases = rows[0], np.concatenate([part.blunder for part in judged])
    unit = _unit(first, book)
    return SuspicionRecord(names, float(standardised[first]), float(biases[first]), unit)


def _name(row: int, book: FieldBook, points: Points, known: CoordinateResiduals) -> str:
    count = len(book.observations)
    if row < count:
        return book.label(row)
    k = row - count
    point, component = int(known.points[k]), COMPONENTS[int(known.components[k])]
    file = points.file_indices[point]
    place = f" ({points.files[file]}:{points.lines[point]})" if file >= 0 else ""
    return f"{KNOWN}{component} of {points.names[point]}{place}"


def _unit(row: int, book: FieldBook) -> str:
    return BY_CODE[int(book.observations.types[row])].unit if row < len(book.observations) else "m"
