"""The largest standardised residuals of a block, of all kinds together, and the one that is suspected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.images.adjustment.quality import EquationNames
from obseq.images.causes.comparison import has_robust_weights
from obseq.leastsquares.statistics.hypothesis_tests import (
    limit_by_others,
    limit_by_spread,
    robust_spread,
    scaled_by_others,
)
from obseq.records.record import Record

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.equations import MeasureBatch
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.leastsquares import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
    from obseq.leastsquares.statistics.reliability import Reliability

    Tested = ObservationReliability[Batch | Prior]

LISTED, MOST = 20, 1000
"""Equations that are listed by name; more where more are suspected."""
LEVEL = 0.001
"""Probability that anything is suspected where nothing is wrong."""
APART = 2.0 * np.log(1.0 / LEVEL)
"""Difference of the squares of two tests from which one explains the residuals so much better than the other.

Half of it is the logarithm of the ratio of their likelihoods.
"""


class StandardisedRecord(Record, frozen=True, omit_defaults=False):
    """The test of one equation: a coordinate of an image point or of a control point, a length, ...

    Attributes:
        w: standardised residual, the given sigmas being right; with robust weights that against all others.
        scaled: the same over sigma0 of all the others, where that is above 1.
        blunder: estimate of its error, too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
        weight: what a robust weight leaves of it.
        row: of an image point, in the residuals of the record; None for the others, and in older files.
        follows: whether it is an image point of a control point whose coordinate stands before it.
    """

    name: str
    w: float
    scaled: float
    blunder: float | None
    unit: str
    weight: float = 1.0
    row: int | None = None
    follows: bool = False

    @property
    def text(self) -> str:
        """Name, error and test in words."""
        size = "" if self.blunder is None else f", off by {self.blunder:+.3g} {self.unit}".rstrip()
        return f"{self.name}{size}, w {abs(self.w):.1f}"


class LargestTestsRecord(Record, frozen=True, omit_defaults=False):
    """Which observations are suspected to be gross errors.

    A gross error that has its full weight spoils the tests of others: the largest alone is suspected then.
    Robust weights hold it down, and each equation is tested against what all the others say at their final
    weights: all that are beyond the limit, times the spread of most of the tests, are suspected; but image
    points of a control point whose coordinate is suspected before follow from that.

    Attributes:
        level: probability of a suspect where nothing is wrong.
        tested: equations, which share that level.
        limit: of the scaled test of each.
        largest: the largest tests of all kinds of observation.
        alike: where the first is suspected, how many others explain the residuals about as well: chance, at
            this level, may make one larger than the other.
        robust: whether robust weights were used.
        beyond: equations whose scaled test is beyond the limit.
        spread: standard deviation of most of the tests, 1 when the sigmas are right; None in
            older files.
    """

    level: float
    tested: int
    limit: float
    largest: tuple[StandardisedRecord, ...]
    alike: int
    robust: bool

    beyond: int = 0
    spread: float | None = None

    @property
    def suspects(self) -> tuple[StandardisedRecord, ...]:
        """The gross errors that are listed, the largest first; one at most without robust weights."""
        found = tuple(item for item in self.largest if item.scaled > self.limit and not item.follows)
        return found if self.robust else found[:1]

    @property
    def n_suspects(self) -> int:
        """How many there are, listed or not."""
        if not self.robust:
            return len(self.suspects)
        return self.beyond - sum(item.follows and item.scaled > self.limit for item in self.largest)


def largest_tests(solution: BundleSolution, whole: Reliability) -> LargestTestsRecord:
    """The largest tests of a solution, from the reliability of its system."""
    robust, level = has_robust_weights(solution), LEVEL / max(whole.n_tests, 1)
    if robust:
        w = _held_down(whole, solution.residuals.weights)
        spread = robust_spread(w[w > 0.0])
        scaled, limit = w / max(spread, 1.0), limit_by_spread(spread, whole.redundancy, level)
    else:
        w = np.concatenate([np.abs(np.nan_to_num(part.w)).ravel() for part in whole.all])
        spread, squares = robust_spread(w[w > 0.0]), (whole.sigma0 or 0.0) ** 2 * whole.redundancy
        scaled = scaled_by_others(w, squares, whole.redundancy)
        limit = limit_by_others(w.max(initial=0.0), squares, whole.redundancy, level)
    beyond, tests = int(np.count_nonzero(scaled > limit)), _Tests(solution)
    listed = _largest(w, min(max(LISTED, beyond if robust else 0), MOST))
    return LargestTestsRecord(
        LEVEL,
        whole.n_tests,
        limit,
        tuple(tests.record(*_place(whole, int(row)), float(w[row]), float(scaled[row])) for row in listed),
        _alike(w, scaled) if beyond else 0,
        robust,
        beyond,
        spread,
    )


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


def _alike(w: FloatArray, scaled: FloatArray) -> int:
    """Tests that the redundancy does not tell apart from the largest, in the scale of that."""
    if not w.size:
        return 0
    first = int(np.argmax(w))
    squares = np.square(w * scaled[first] / max(w[first], 1e-300))
    return int(np.count_nonzero(squares > squares[first] - APART)) - 1


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
    """Records of tests, in the order of their size."""

    def __init__(self, solution: BundleSolution) -> None:
        self._names = EquationNames(solution.equations, solution.surveys)
        self._suspected: set[int] = set()

    def record(self, part: Tested, row: int, component: int, w: float, scaled: float) -> StandardisedRecord:
        """The test of one equation."""
        error = -float(part.left_out_residuals[row, component])
        name, size, unit = self._names.of(part.source, row, component, error)
        item, point = self._names.measures.get(id(part.source)), self._names.point_of(part.source, row)
        weight = 1.0 if item is None else float(item.batch.robust_weights()[row])
        place = None if item is None else self._row(item, row)
        signed = float(np.copysign(w, part.w[row, component]))
        follows = item is not None and point in self._suspected
        if item is None and point is not None:
            self._suspected.add(point)
        return StandardisedRecord(name, signed, scaled, size, unit, weight, place, follows)

    def _row(self, item: MeasureBatch, row: int) -> int:
        """Where the residuals of the solution, which are those of active measures, hold one of them."""
        parts = list(self._names.measures.values())
        before = sum(int(np.count_nonzero(part.batch.active)) for part in parts[: parts.index(item)])
        return before + int(np.count_nonzero(item.batch.active[:row]))
