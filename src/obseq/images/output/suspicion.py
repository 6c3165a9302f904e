"""The largest standardised residuals of a block, of all kinds together, and the one that is suspected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.images.adjustment.equations import LENGTHS
from obseq.leastsquares.statistics.hypothesis_tests import limit_by_others, scaled_by_others
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

LISTED = 10
"""Equations that are listed by name."""
LEVEL = 0.001
"""Probability that anything is suspected where nothing is wrong."""
SAME = 1e-3
"""Relative difference of two tests that tell nothing apart."""


@dataclass(frozen=True, slots=True)
class StandardisedRecord:
    """The test of one equation: a coordinate of an image point or of a control point, a length, ...

    Attributes:
        w: standardised residual, the given sigmas being right.
        scaled: the same over sigma0 of all the others, where that is above 1.
        blunder: estimate of its error, too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
    """

    name: str
    w: float
    scaled: float
    blunder: float | None
    unit: str

    @property
    def text(self) -> str:
        """Name, error and test in words."""
        size = "" if self.blunder is None else f", off by {self.blunder:+.3g} {self.unit}".rstrip()
        return f"{self.name}{size}, w {abs(self.w):.1f}"


@dataclass(frozen=True, slots=True)
class SuspicionRecord:
    """Which observation is suspected to be a gross error.

    Attributes:
        level: probability of a suspect where nothing is wrong.
        tested: equations, which share that level.
        limit: of the scaled test of each.
        largest: the largest tests of all kinds of observation.
        alike: of all the others, those whose test is as large as the first.
        robust: whether robust weights, which make the tests no normal variables, were used: nothing is
            suspected then.
    """

    level: float
    tested: int
    limit: float
    largest: tuple[StandardisedRecord, ...]
    alike: int
    robust: bool

    @property
    def suspect(self) -> StandardisedRecord | None:
        """The gross error, if there is one."""
        is_beyond = not self.robust and bool(self.largest) and abs(self.largest[0].scaled) > self.limit
        return self.largest[0] if is_beyond else None


def has_robust_weights(solution: BundleSolution) -> bool:
    """Whether a robust weight other than 1 took part."""
    weights = solution.residuals.weights
    return bool((np.abs(weights[np.isfinite(weights)] - 1.0) > 1e-12).any())


def suspicion_record(solution: BundleSolution, whole: Reliability) -> SuspicionRecord:
    """The largest tests of a solution, from the reliability of its system."""
    w = np.concatenate([np.abs(np.nan_to_num(part.w)).ravel() for part in whole.all])
    squares = (whole.sigma0 or 0.0) ** 2 * whole.redundancy
    scaled = scaled_by_others(w, squares, whole.redundancy)
    order = _largest(w)
    names = _Names(solution)
    return SuspicionRecord(
        LEVEL,
        whole.n_tests,
        limit_by_others(w.max(initial=0.0), squares, whole.redundancy, LEVEL / max(whole.n_tests, 1)),
        tuple(names.record(*_place(whole, int(row)), float(scaled[row])) for row in order),
        int(np.count_nonzero(w >= (1.0 - SAME) * w.max(initial=0.0))) - 1,
        has_robust_weights(solution),
    )


def _largest(w: FloatArray) -> IntArray:
    """Positions of the largest tests, the largest first."""
    order = np.argpartition(-w, LISTED)[:LISTED] if w.size > LISTED else np.arange(w.size)
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
        self._control, self._given = solution.equations.control
        self._measures = {id(item.batch): item for item in solution.equations.measures}
        self._surveys = {
            id(batch): (part.network.book, rows)
            for part in solution.surveys
            for rows, batch in part.equations.batches.values()
        }

    def record(self, part: Tested, row: int, component: int, scaled: float) -> StandardisedRecord:
        """The test of one equation."""
        blunder = -float(part.left_out_residuals[row, component])
        name, size, unit = self._named(part, row, component, blunder)
        return StandardisedRecord(name, float(part.w[row, component]), scaled, size, unit)

    def _named(self, part: Tested, row: int, component: int, blunder: float) -> Named:
        key = id(part.source)
        if key in self._measures:
            return f"{self._measure(self._measures[key], row)} {'xy'[component]}", blunder, "px"
        if part.source is self._control:
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
