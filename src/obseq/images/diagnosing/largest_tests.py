"""The largest standardised residuals of a block, of all kinds together."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.images.adjustment.equations import MeasureBatch
from obseq.images.adjustment.quality import EquationNames
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.causes.comparison import has_robust_weights
from obseq.leastsquares import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.statistics.hypothesis_tests import robust_spread
from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
from obseq.leastsquares.statistics.reliability import Reliability
from obseq.records.record import Record

Tested = ObservationReliability[Batch | Prior]

LISTED = 20
"""Equations that are listed by name."""


class StandardisedRecord(Record, frozen=True, omit_defaults=False):
    """The test of one equation: a coordinate of an image point or of a control point, a length, ...

    Attributes:
        w: standardised residual, the given sigmas being right; with robust weights that against all others.
        blunder: estimate of its error, too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
        weight: what a robust weight leaves of it.
        row: of an image point, in the residuals of the record; None for the others.
    """

    name: str
    w: float
    blunder: float | None
    unit: str
    weight: float = 1.0
    row: int | None = None


class LargestTestsRecord(Record, frozen=True, omit_defaults=False):
    """The largest tests of all kinds of observation: what is wrong is said by the diagnosis.

    Attributes:
        largest: the largest first.
        robust: whether robust weights were used: each is tested against all others at their final weights.
        spread: standard deviation of most of the tests, 1 when the sigmas are right.
    """

    largest: tuple[StandardisedRecord, ...]
    robust: bool
    spread: float


def largest_tests(solution: BundleSolution, whole: Reliability) -> LargestTestsRecord:
    """The largest tests of a solution, from the reliability of its system."""
    w, robust = sizes_of_tests(solution, whole), has_robust_weights(solution)
    tests = _Tests(solution)
    listed = tuple(tests.record(*_place(whole, int(row)), float(w[row])) for row in _largest(w, LISTED))
    return LargestTestsRecord(listed, robust, robust_spread(w[w > 0.0]))


def sizes_of_tests(solution: BundleSolution, whole: Reliability) -> FloatArray:
    """Sizes of the tests of all equations; with robust weights those against all the others."""
    if has_robust_weights(solution):
        return _held_down(whole, solution.residuals.weights)
    return np.concatenate([np.abs(np.nan_to_num(part.w)).ravel() for part in whole.all])


def _held_down(whole: Reliability, weights: FloatArray) -> FloatArray:
    """Sizes of the residuals against all the others over their standard deviations, with robust weights.

    With h the cofactor of what the others say, that has the variance (1 + h) sigma^2 where their weights are
    those of their sigmas. Weights g below that, which follow from residuals, make h larger than the estimates
    are uncertain: by the sum of g over that of g^2, as a A'GA is to an A'GGA.
    """
    share = float(np.sum(weights**2) / max(np.sum(weights), 1e-300))
    parts = []
    for part in whole.all:
        own = np.square(part.left_out_residuals / part.sigmas)
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = own / np.square(part.w)
        parts.append(np.sqrt(np.nan_to_num(own / (1.0 + share * (spread - 1.0)))).ravel())
    return np.concatenate(parts)


def _largest(w: FloatArray, count: int) -> IntArray:
    """Positions of the largest tests, the largest first."""
    order = np.argpartition(-w, count)[:count] if w.size > count else np.arange(w.size)
    order = order[np.argsort(-w[order], kind="stable")]
    return np.asarray(order[w[order] > 0.0])


def _place(whole: Reliability, position: int) -> tuple[Tested, int, int]:
    """Batch or prior, row and component of a position in the tests of all."""
    for part in whole.all:
        if position < part.w.size:
            return part, *divmod(position, part.w.shape[1])
        position -= part.w.size
    raise IndexError(position)


class _Tests:
    """Records of tests."""

    def __init__(self, solution: BundleSolution) -> None:
        self._names = EquationNames(solution.equations, solution.surveys)

    def record(self, part: Tested, row: int, component: int, w: float) -> StandardisedRecord:
        """The test of one equation."""
        error = -float(part.left_out_residuals[row, component])
        name, size, unit = self._names.of(part.source, row, component, error)
        item = self._names.measures.get(id(part.source))
        weight = 1.0 if item is None else float(item.batch.robust_weights()[row])
        place = None if item is None else self._row(item, row)
        signed = float(np.copysign(w, part.w[row, component]))
        return StandardisedRecord(name, signed, size, unit, weight, place)

    def _row(self, item: MeasureBatch, row: int) -> int:
        """Where the residuals of the solution, which are those of active measures, hold one of them."""
        parts = list(self._names.measures.values())
        before = sum(int(np.count_nonzero(part.batch.active)) for part in parts[: parts.index(item)])
        return before + int(np.count_nonzero(item.batch.active[:row]))
