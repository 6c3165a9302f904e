"""The largest standardised residuals of a block, of all kinds together, and the one that is suspected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.adjustment.equations import LENGTHS
from obseq.leastsquares.statistics.hypothesis_tests import (
    limit_by_others,
    limit_by_spread,
    robust_spread,
    scaled_by_others,
)
from obseq.survey.kinds.registry import BY_CODE

if TYPE_CHECKING:
    from obseq.arrays import FloatArray, IntArray
    from obseq.images.adjustment.equations import MeasureBatch
    from obseq.images.adjustment.solution import BundleSolution
    from obseq.leastsquares import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.statistics.reliability import ObservationReliability, Reliability
    from obseq.survey.model import FieldBook

    Tested = ObservationReliability[Batch | Prior]
    Named = tuple[str, float | None, str]

LISTED, MOST = 20, 1000
"""Equations that are listed by name; more where more are suspected."""
LEVEL = 0.001
"""Probability that anything is suspected where nothing is wrong."""
SAME = 1e-3
"""Relative difference of two tests that tell nothing apart."""


@dataclass(frozen=True, slots=True)
class StandardisedRecord:
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


@dataclass(frozen=True, slots=True)
class SuspicionRecord:
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
        alike: of all the others, those whose test is as large as the first.
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


def has_robust_weights(solution: BundleSolution) -> bool:
    """Whether a robust weight other than 1 took part."""
    weights = solution.residuals.weights
    return bool((np.abs(weights[np.isfinite(weights)] - 1.0) > 1e-12).any())


def suspicion_record(solution: BundleSolution, whole: Reliability) -> SuspicionRecord:
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
    beyond, names = int(np.count_nonzero(scaled > limit)), _Names(solution)
    listed = _largest(w, min(max(LISTED, beyond if robust else 0), MOST))
    return SuspicionRecord(
        LEVEL,
        whole.n_tests,
        limit,
        tuple(names.record(*_place(whole, int(row)), float(w[row]), float(scaled[row])) for row in listed),
        int(np.count_nonzero(w >= (1.0 - SAME) * w.max(initial=0.0))) - 1,
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


class _Names:
    """What to call the equations of a block, and the errors of what they observe."""

    def __init__(self, solution: BundleSolution) -> None:
        self._start, self._lengths = solution.start, solution.block.lengths
        self._suspected: set[int] = set()
        self._control, self._given = solution.equations.control
        self._measures = {id(item.batch): item for item in solution.equations.measures}
        self._surveys = {
            id(batch): (part.network.book, rows)
            for part in solution.surveys
            for rows, batch in part.equations.batches.values()
        }

    def record(self, part: Tested, row: int, component: int, w: float, scaled: float) -> StandardisedRecord:
        """The test of one equation."""
        blunder = -float(part.left_out_residuals[row, component])
        name, size, unit = self._named(part, row, component, blunder)
        item = self._measures.get(id(part.source))
        weight = 1.0 if item is None else float(item.batch.robust_weights()[row])
        place = None if item is None else self._row(item, row)
        signed = float(np.copysign(w, part.w[row, component]))
        follows = item is not None and self._point(item, row) in self._suspected
        return StandardisedRecord(name, signed, scaled, size, unit, weight, place, follows)

    def _point(self, item: MeasureBatch, row: int) -> int:
        return int(self._start.sets[item.part].point[item.rows[row]])

    def _row(self, item: MeasureBatch, row: int) -> int:
        """Where the residuals of the solution, which are those of active measures, hold one of them."""
        parts = list(self._measures.values())
        before = sum(int(np.count_nonzero(part.batch.active)) for part in parts[: parts.index(item)])
        return before + int(np.count_nonzero(item.batch.active[:row]))

    def _named(self, part: Tested, row: int, component: int, blunder: float) -> Named:
        key = id(part.source)
        if key in self._measures:
            return f"{self._measure(self._measures[key], row)} {'xy'[component]}", blunder, "px"
        if part.source is self._control:
            self._suspected.add(int(self._given[row, 0]))
            return self._control_point(int(self._given[row, 0]), int(self._given[row, 1]), blunder)
        if key in self._surveys:
            return self._survey(*self._surveys[key], row, blunder)
        if part.source.group == LENGTHS:
            return f"length {self._lengths.first[row]} to {self._lengths.second[row]}", blunder, ""
        return part.label(row), None, ""

    def _measure(self, item: MeasureBatch, row: int) -> str:
        return self._start.sets[item.part].given.measures.label(int(item.rows[row]))

    def _control_point(self, point: int, axis: int, blunder: float) -> Named:
        """Correlated coordinates are tested in mixtures, which have no errors of their own."""
        name, covariance = f"control point {self._start.points[point]}", self._start.covariances[point]
        if np.any(covariance[~np.eye(3, dtype=bool)]):
            return name, None, ""
        return f"{name} {'xyz'[axis]}", blunder * float(np.sqrt(covariance[axis, axis])), ""

    def _survey(self, book: FieldBook, rows: IntArray, row: int, blunder: float) -> Named:
        place = int(rows[row])
        is_angle = BY_CODE[int(book.observations.types[place])].is_angle
        return book.label(place), None if is_angle else blunder, "" if is_angle else "m"
