"""How the image points of a block control each other, which observations are blunders, and their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.images.adjustment.equations import LENGTHS, Equations, MeasureBatch
from obseq.images.adjustment.start import LeftOut
from obseq.images.adjustment.surveys import JoinedSurvey
from obseq.leastsquares import Batch, LeastSquaresResult, Rejection
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.statistics.reliability import Reliability, reliability
from obseq.leastsquares.statistics.snooping import SnoopingEnd, snoop
from obseq.survey.kinds.registry import BY_CODE
from obseq.survey.model import FieldBook


@dataclass(frozen=True, eq=False)
class MeasureReliability:
    """The quality of the image points of a solution, in the rows of its `residuals`; x, then y.

    Attributes:
        image_names: names of the images.
        point_names: names of the points.
        image: (n,) image of each measure.
        point: (n,) point of each measure.
        redundancy: (n, 2) redundancy numbers, from 0 (nothing controls it) to 1.
        w: (n, 2) standardised residuals, the given sigmas being right; NaN where nothing controls.
        tau: (n, 2) the same with the estimated sigma0.
        detectable: (n, 2) smallest blunder that the test of w finds, pixels; infinite where nothing controls.
        left_out: (n, 2) residual that the measure has against all the others, pixels; minus it is the
            estimate of a blunder.
        external: (n, 2) by how many of its standard deviations an undetected blunder of that size moves any
            function of the unknowns, at most.
        whole: the same of every equation of the system: control points, lengths, survey observations.
    """

    image_names: tuple[str, ...]
    point_names: tuple[str, ...]
    image: IntArray
    point: IntArray
    redundancy: FloatArray
    w: FloatArray
    tau: FloatArray
    detectable: FloatArray
    left_out: FloatArray
    external: FloatArray
    whole: Reliability

    def label(self, row: int) -> str:
        """What to call a measure: its image and its point."""
        return f"image {self.image_names[self.image[row]]}, point {self.point_names[self.point[row]]}"

    def worst(self, count: int = 10) -> IntArray:
        """Rows of the measures with the largest standardised residuals, the worst first."""
        sizes = np.nan_to_num(np.abs(self.w).max(axis=1), nan=0.0)
        return np.argsort(-sizes, kind="stable")[:count]


@dataclass(frozen=True)
class BlunderSearch:
    """How to look for wrong observations, one at a time: the worst is left out, and all is adjusted again.

    Image points, control coordinates, lengths, survey observations and what rigid blocks and clinometers say
    are tested together: the one that is left out is that which lowers the weighted sum of squares most.
    Observed poses and camera parameters are tested too, and end the search where they are the worst.

    Attributes:
        level: probability of leaving out anything where nothing is wrong.
        statistic: `w` where the given sigmas are trusted, `tau` where only their proportions are.
        max_rejections: no more than this many are left out; None for no limit.
    """

    level: float = 0.05
    statistic: str = "w"
    max_rejections: int | None = None


@dataclass(frozen=True)
class BlundersFound:
    """What the search for blunders did.

    Attributes:
        rejected: the observations that were left out, in the order of finding.
        end: why the search ended.
        suspects: names of observations that could not be told apart, that the block cannot do without, or
            that are not left out.
    """

    rejected: tuple[RejectedMeasure | RejectedObservation, ...]
    end: SnoopingEnd
    suspects: tuple[str, ...]


@dataclass(frozen=True)
class RejectedMeasure:
    """An image point that the search for blunders left out.

    Attributes:
        image: name of the image.
        point: name of the point.
        axis: `x` or `y`: which coordinate failed the test.
        statistic: standardised residual that failed.
        p_value: probability of a larger one somewhere in the block without any blunder.
        blunder: estimated error of that coordinate, pixels; too large when positive.
    """

    image: str
    point: str
    axis: str
    statistic: float
    p_value: float
    blunder: float

    def as_left_out(self) -> LeftOut:
        """The same among what takes no part."""
        reason = f"a blunder: its {self.axis} is off by {self.blunder:.3g} pixels (test {self.statistic:.3g})"
        return LeftOut("measure", f"image {self.image}, point {self.point}", reason)


@dataclass(frozen=True)
class RejectedObservation:
    """An observation other than an image point that the search for blunders left out.

    Attributes:
        name: control point and coordinate, length, survey observation, ...
        statistic: standardised residual that failed.
        p_value: probability of a larger one somewhere in the block without any blunder.
        blunder: its estimated error, too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
    """

    name: str
    statistic: float
    p_value: float
    blunder: float | None
    unit: str

    def as_left_out(self) -> LeftOut:
        """The same among what takes no part."""
        off = "" if self.blunder is None else f": it is off by {self.blunder:.3g} {self.unit}".rstrip()
        return LeftOut("observation", self.name, f"a blunder{off} (test {self.statistic:.3g})")


def measure_reliability(
    equations: Equations, result: LeastSquaresResult, level: float, power: float
) -> MeasureReliability:
    """The quality of the image points of a solution; see `BundleSolution.reliability`."""
    whole, start = reliability(equations.system, result, level, power), equations.start
    parts = [(item, whole.of(item.batch), item.batch.active) for item in equations.measures]
    rows = [(start.sets[item.part], item.rows[active]) for item, _, active in parts]

    def joined(name: str) -> FloatArray:
        return np.concatenate([getattr(found, name)[active] for _, found, active in parts])

    return MeasureReliability(
        start.poses.images,
        start.points,
        np.concatenate([part.image[chosen] for part, chosen in rows]),
        np.concatenate([part.point[chosen] for part, chosen in rows]),
        joined("redundancy"),
        joined("w"),
        joined("tau"),
        joined("detectable"),
        joined("left_out_residuals"),
        joined("external"),
        whole,
    )


def search_blunders(
    equations: Equations,
    surveys: Sequence[JoinedSurvey],
    search: BlunderSearch,
    solving: Mapping[str, object],
) -> tuple[LeastSquaresResult, BlundersFound]:
    """Leaves out the observations that are blunders; the solution of the others, and what was left out."""
    found = snoop(
        equations.system,
        search.level,
        search.statistic,
        max_rejections=search.max_rejections,
        solve_options=solving,
        priors=True,
    )
    names = EquationNames(equations, surveys)
    rejected = tuple(_rejected(equations, names, rejection) for rejection in found.rejections)
    return found.result, BlundersFound(rejected, found.end, found.suspects)


def _rejected(
    equations: Equations, names: EquationNames, rejection: Rejection
) -> RejectedMeasure | RejectedObservation:
    item = names.measures.get(id(rejection.batch))
    tested = rejection.statistic, rejection.p_value
    if item is None:
        found = names.of(rejection.batch, rejection.row, rejection.component, rejection.blunder)
        return RejectedObservation(found.name, *tested, found.error, found.unit)
    part, row = equations.start.sets[item.part], item.rows[rejection.row]
    return RejectedMeasure(
        equations.start.poses.images[part.image[row]],
        equations.start.points[part.point[row]],
        "xy"[rejection.component],
        *tested,
        rejection.blunder,
    )


class NamedError(NamedTuple):
    """An observation and its error.

    Attributes:
        name: image and point and coordinate, control point and coordinate, length, survey observation, ...
        error: too large when positive; None where it is no number of the input.
        unit: of that; empty for the unit of the world.
    """

    name: str
    error: float | None
    unit: str


class EquationNames:
    """Names of the equations of a block.

    Attributes:
        measures: batches of image points, by the identity of their batch.
    """

    def __init__(self, equations: Equations, surveys: Sequence[JoinedSurvey]) -> None:
        self._start, self._lengths = equations.start, equations.block.lengths
        self._control, self._given = equations.control
        self.measures = {id(item.batch): item for item in equations.measures}
        self._surveys = {
            id(batch): (part.network.book, rows)
            for part in surveys
            for rows, batch in part.equations.batches.values()
        }

    def of(self, source: Batch | Prior, row: int, component: int, error: float) -> NamedError:
        """The name of one equation whose observation has this error, in the unit of its residual."""
        key = id(source)
        if key in self.measures:
            return NamedError(f"{self._measure(self.measures[key], row)} {'xy'[component]}", error, "px")
        if source is self._control:
            return self._control_coordinate(int(self._given[row, 0]), int(self._given[row, 1]), error)
        if key in self._surveys:
            return self._survey(*self._surveys[key], row, error)
        if source.group == LENGTHS:
            return NamedError(f"length {self._lengths.first[row]} to {self._lengths.second[row]}", error, "")
        return NamedError(source.label(row), None, "")

    def point_of(self, source: Batch | Prior, row: int) -> int | None:
        """The point of a measure or of a control coordinate, a position in the points of the start."""
        item = self.measures.get(id(source))
        if item is not None:
            return int(self._start.sets[item.part].point[item.rows[row]])
        return int(self._given[row, 0]) if source is self._control else None

    def _measure(self, item: MeasureBatch, row: int) -> str:
        return self._start.sets[item.part].given.measures.label(int(item.rows[row]))

    def _control_coordinate(self, point: int, axis: int, error: float) -> NamedError:
        """Correlated coordinates are tested in mixtures, which have no errors of their own."""
        name, covariance = f"control point {self._start.points[point]}", self._start.covariances[point]
        if np.any(covariance[~np.eye(3, dtype=bool)]):
            return NamedError(name, None, "")
        return NamedError(f"{name} {'xyz'[axis]}", error * float(np.sqrt(covariance[axis, axis])), "")

    def _survey(self, book: FieldBook, rows: IntArray, row: int, error: float) -> NamedError:
        place = int(rows[row])
        is_angle = BY_CODE[int(book.observations.types[place])].is_angle
        return NamedError(book.label(place), None if is_angle else error, "" if is_angle else "m")
