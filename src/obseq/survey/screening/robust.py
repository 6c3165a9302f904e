"""A robust estimate of a network: what it is when observations that contradict the others do not count.

Reweighted least squares from the initial values: first nearly the least sum of absolute residuals, which
brings points to their place that a wrong observation has put elsewhere; then a loss under which large
residuals have no effect at all.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import ObseqError, SingularSystemError
from obseq.leastsquares.iterations.arrival import Options
from obseq.leastsquares.iterations.strategies import GaussNewton
from obseq.leastsquares.problem.losses import GemanMcClure, Huber
from obseq.report.units import METRIC, Units
from obseq.survey.adjustment.equations import sigmas_of
from obseq.survey.adjustment.kept_equations import KeptEquations
from obseq.survey.initial.left_out import Determined, leave_out

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares import LeastSquaresResult
    from obseq.leastsquares.problem.losses import Loss
    from obseq.survey.adjustment.equations import Equations
    from obseq.survey.initial.initial_values import InitialValues
    from obseq.survey.model import FieldBook, Points

Moved = TypeVar("Moved")
"""What a solution, or iterations alone, give."""

Stages = tuple[tuple["Loss", int], ...]
"""Losses and the most iterations with each."""
WHOLE: Stages = ((Huber(1.5), 14), (GemanMcClure(8.0), 6), (GemanMcClure(4.0), 6))
QUICK: Stages = ((Huber(1.5), 6),)
GLANCE: Stages = ((Huber(1.5), 1),)
_ARRIVED = 0.05
"""Iterations end when no unknown moves by more than this share of its standard deviation."""
_FOLLOW = 3
"""Verticals and refraction are computed anew after so many iterations."""
GROSS = 10.0
"""Misfit, in sigmas, from which an observation is called gross: noise of any honest sigma stays below."""

_ENDLESS = 1e9
"""Ratio beyond which a contradiction is a whole one."""
WELL_CONTROLLED = 0.6
"""Redundancy for each observation from which the majority is right."""
LARGEST_SCALE = 4.0
"""Sigmas may be too small by so much; when misfits are larger still, something is wrong."""


@dataclass(frozen=True)
class Model:
    """How initial values and equations of a network are made.

    Attributes:
        initial: points and book -> initial values, as far as they go.
        equations: a network with its initial values -> its equations.
        units: in which values are told.
        progress: receives what is being tried; None for nobody.
    """

    initial: Callable[[Points, FieldBook], InitialValues]
    equations: Callable[[Determined], Equations]
    units: Units = METRIC
    progress: Callable[[str], None] | None = None

    def for_trials(self) -> Model:
        """The same for networks that differ in little, one at a time: what they have in common is kept."""
        if isinstance(self.equations, KeptEquations):
            return self
        return replace(self, equations=KeptEquations(self.equations))

    def start(self, points: Points, book: FieldBook) -> Determined:
        """What can be computed of a network, with its initial values.

        Raises:
            ObseqError: nothing of the network can be computed.
        """
        start = Determined(points, book, self.initial(points, book))
        return leave_out(start, start.initial.unplaced)


@dataclass(frozen=True, eq=False)
class Estimate:
    """A network estimated robustly.

    Attributes:
        points: the points.
        book: the observations.
        start: what could be computed of them, where the iterations started.
        end: the same where they ended.
        coordinates: (n, 3) of all points of the frame; NaN where nothing determines them.
        rotations: (m, 3, 3) instrument -> frame of all stations; NaN where unknown.
        misfits: (k,) computed minus observed, m or rad; NaN where it is not known.
        ratios: (k,) size of the misfits in sigmas; 0 where it is not known.
        scale: how many times larger than their sigmas the misfits of good observations are, 1 to 4.
        instruments: names and values (m, parts) of the unknowns of instruments, where there are any.
        control: redundancy for each observation, on average.
        units: in which values are told.
    """

    points: Points
    book: FieldBook
    start: Determined
    end: Determined
    coordinates: FloatArray
    rotations: FloatArray
    misfits: FloatArray
    ratios: FloatArray
    scale: float
    instruments: tuple[tuple[str, float], ...] = ()
    control: float = 1.0
    units: Units = METRIC

    def places_in(self, start: Determined) -> Determined:
        """A network of these points and stations, where they were found; what was not stays where it starts.

        Args:
            start: the network, of the same points and observations or of part of them.
        """
        rows, initial = [self.points.index[name] for name in start.points.names], start.initial
        found = self.coordinates[rows]
        moved = np.asarray(start.points.is_free.any(axis=1) & np.isfinite(found).all(axis=1))
        rotations = initial.rotations.copy()
        if len(rotations):
            turned = self.rotations[_kept_stations(self.book, start.book)]
            is_known = np.isfinite(turned).all(axis=(1, 2))
            rotations[is_known] = turned[is_known]
        coordinates = np.where(moved[:, None], found, initial.coordinates)
        return replace(start, initial=replace(initial, coordinates=coordinates, rotations=rotations))

    @property
    def computed(self) -> FloatArray:
        """(k,) what each observation should have been."""
        return np.asarray(self.book.observations.values + self.misfits)

    @property
    def limit(self) -> float:
        """Misfit in sigmas from which an observation is suspected."""
        return GROSS * self.scale

    @property
    def suspects(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Rows of the observations that contradict the others, the worst first; none where none is spare."""
        if self.control <= 0.0:
            return np.zeros(0, np.intp)
        rows = np.flatnonzero(self.ratios > self.limit)
        return np.asarray(rows[np.argsort(-self.ratios[rows], kind="stable")])

    @property
    def noise(self) -> float:
        """What the noise of good observations adds to the contradictions, these being counted softly."""
        count = np.count_nonzero(np.isfinite(self.misfits))
        return max(self.control, 0.0) * float(count) * (self.scale / GROSS) ** 2

    @property
    def lost(self) -> int:
        """How many observations cannot be compared with the others."""
        return int(np.count_nonzero(np.isnan(self.misfits) & self.book.observations.active))

    def disagreement(self, limit: float) -> float:
        """How many observations contradict the others, counted softly, or cannot be compared."""
        return self.lost + float(self.contradictions(limit).sum())

    def contradictions(self, limit: float) -> FloatArray:
        """(k,) from 0 to 1, how much each observation contradicts the others; 0 where it is not known."""
        seen = self.book.observations.active & ~np.isnan(self.misfits)
        return _softly(np.where(seen, self.ratios / limit, 0.0))


def estimate(
    model: Model, points: Points, book: FieldBook, stages: Stages = WHOLE, start: Determined | None = None
) -> Estimate:
    """The network by the observations that agree with each other.

    Args:
        model: how initial values and equations are made.
        points: of the network.
        book: its observations.
        stages: losses and iterations; `GLANCE` has one, `QUICK` enough to see whether a cause explains much.
        start: what `model.start` gives of them, where that is known.

    Raises:
        ObseqError: nothing of the network can be computed.
    """
    start = start or model.start(points, book)
    equations = model.equations(start)
    _settle(equations, stages)
    return replace(_estimate(points, book, start, equations), units=model.units)


def first_sight(model: Model, start: Determined) -> float:
    """The contradictions of a network one step from its initial values, counted softly.

    Raises:
        ObseqError: its equations cannot be made.
    """
    equations = model.equations(start)
    _glance(equations)
    return sum(float(_softly(ratios / GROSS).sum()) for _, _, ratios in _misfits(equations))


def _softly(sizes: FloatArray) -> FloatArray:
    """From 0 to 1, how much misfits contradict, of their sizes as shares of a limit."""
    squares = np.square(np.fmin(sizes, _ENDLESS))
    return np.asarray(squares / (1.0 + squares))


def _glance(equations: Equations) -> None:
    """Moves the unknowns by one step, as `_settle` does in the stages of a glance."""
    system, ((loss, _),) = equations.system, GLANCE
    for _, batch in equations.batches.values():
        batch.loss = loss
    try:
        equations.follow(system, 0)
        system.analysis(reduced=True).step()
    except ObseqError:
        _settle(equations, GLANCE)
    else:
        equations.linearise()


def _settle(equations: Equations, stages: Stages) -> None:
    """Moves the unknowns to the robust solution, as far as the iterations go."""
    batches = [batch for _, batch in equations.batches.values()]
    for loss, count in stages:
        for batch in batches:
            batch.loss = loss
        try:
            _on_datum(equations, partial(_iterate, equations, count))
        except ObseqError:
            return  # what has been found so far is what there is


def _iterate(equations: Equations, count: int) -> None:
    """Moves the unknowns by so many iterations at most; nothing else of a solution is worked out."""
    system = equations.system

    def before(iteration: int) -> None:
        if iteration % _FOLLOW == 0:
            equations.follow(system, iteration)
        else:
            equations.linearise()

    analysis = system.analysis(reduced=True)
    options = Options(count, _ARRIVED)
    analysis.iterate(GaussNewton(), options, analysis.redundancy, before, lambda _: None)


def solved(equations: Equations, **options: Any) -> LeastSquaresResult:
    """The solution; of a network that a trial has left free to turn, say, the one that moves points least."""
    return _on_datum(equations, partial(equations.system.solve, **options))


def _on_datum(equations: Equations, move: Callable[[], Moved]) -> Moved:
    """Moves the unknowns; where they are free to move together, so that points move least."""
    system = equations.system
    try:
        return move()
    except SingularSystemError:
        if system.datum.scalars.size:
            raise
        system.set_datum(equations.points)
        try:
            return move()
        finally:
            system.set_datum([])


def _estimate(
    points: Points,
    book: FieldBook,
    start: Determined,
    equations: Equations,
) -> Estimate:
    n, m = len(points), len(book.stations)
    kept_points = [points.index[name] for name in start.points.names]
    kept_stations = _kept_stations(book, start.book)
    coordinates, rotations = np.full((n, 3), np.nan), np.full((m, 3, 3), np.nan)
    places, turned = equations.system.values(equations.points), start.initial.rotations
    coordinates[kept_points] = places
    if len(kept_stations):
        turned = equations.instruments.rotations(equations.system)
        rotations[kept_stations] = turned
    redundancy = equations.system.redundancy
    misfits = np.full(len(book.observations), np.nan)
    ratios = np.zeros(len(book.observations))
    for rows, off, sizes in _misfits(equations):
        misfits[rows], ratios[rows] = off, sizes
    return Estimate(
        points,
        book,
        start,
        replace(start, initial=replace(start.initial, coordinates=places, rotations=turned)),
        coordinates,
        rotations,
        misfits,
        ratios,
        _scale(ratios, redundancy),
        tuple(equations.shared.of_instruments(equations.system)),
        redundancy / max(int(np.count_nonzero(np.isfinite(misfits))), 1),
    )


def _misfits(equations: Equations) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
    """Rows of the observations that count, their misfits (m, rad), and these in sigmas."""
    for rows, batch in equations.batches.values():
        misfits = equations.system.residuals(batch)[batch.active, 0]
        yield rows[batch.active], misfits, np.abs(misfits) / sigmas_of(batch)[batch.active]


def _kept_stations(before: FieldBook, after: FieldBook) -> list[int]:
    """Numbers that the stations of a reduced book have in the book before."""
    starts = after.stations.starts[:-1]
    firsts = after.stations.members[starts] if len(starts) else np.zeros(0, np.int64)
    return [int(number) for number in before.observations.stations[firsts]]


def _scale(ratios: FloatArray, redundancy: int) -> float:
    """Size of the ratios of good observations: from their median, and the share that is redundant."""
    seen = ratios[ratios > 0.0]
    share = redundancy / max(len(seen), 1)
    if not seen.size or share <= 0.0:
        return 1.0
    size = 1.4826 * float(np.median(seen)) / min(1.0, share) ** 0.5
    return float(min(max(1.0, size), LARGEST_SCALE))
