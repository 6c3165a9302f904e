"""What is wrong with an open adjustment: the engine of the diagnosis on all of its equations."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from obseq.diagnosis.columns import Columns
from obseq.diagnosis.engine import diagnose
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import linearised, with_priors
from obseq.diagnosis.policy import LOSSES, NO_WEIGHT
from obseq.errors import ObseqError
from obseq.images.causes.model import DAMPED, ITERATIONS, NEAR, STAGES, TOLERANCE, Place
from obseq.images.causes.points import OTHER
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, SuspectRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from obseq.arrays import BoolArray
    from obseq.diagnosis.linear import Linear
    from obseq.diagnosis.protocol import Change, Slip
    from obseq.diagnosis.verdict import Accusation, Verdict
    from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
    from obseq.leastsquares.problem.losses import Loss
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.problem.unknowns import State


class Observation(NamedTuple):
    """An observation, or a known value: its batch or prior, its row there, its equations among all."""

    source: Batch | Prior
    row: int
    first: int
    width: int


def diagnosis_of(
    system: LeastSquares,
    result: LeastSquaresResult,
    start: State,
    before: Callable[[LeastSquares, int], None] | None,
) -> DiagnosisRecord:
    """What is wrong with an adjustment that has redundancy; the system is as it was afterwards.

    Args:
        system: it was solved.
        result: what came out.
        start: where the iterations started.
        before: is called before each iteration.
    """
    model = JointModel(system, result, start, before)
    with model.borrowed():
        return _record(diagnose(model), model)


class JointModel:
    """A system as the engine sees it: each observation, and each known value, may be wrong."""

    def __init__(
        self,
        system: LeastSquares,
        result: LeastSquaresResult,
        start: State,
        before: Callable[[LeastSquares, int], None] | None,
    ) -> None:
        self._system, self._result, self._start, self._before = system, result, start, before
        self._batches, self._priors = list(system.batches), list(system.priors)
        self._actives = [batch.active.copy() for batch in self._batches]
        self._losses = [batch.loss for batch in self._batches]
        self._sigmas = [prior.sigmas.copy() for prior in self._priors]
        self._state = system.unknowns.state()
        self.observations: list[Observation] = []
        first = 0
        for batch, active in zip(self._batches, self._actives, strict=True):
            width = batch.shape.n_residuals
            rows = np.flatnonzero(active).tolist()
            self.observations += [Observation(batch, row, first + width * row, width) for row in rows]
            first += width * batch.n
        for prior in self._priors:
            count = len(prior.scalars)
            self.observations += [Observation(prior, row, first + row, 1) for row in range(count)]
            first += count
        self._n = first
        starts = np.append(0, np.cumsum([one.width for one in self.observations]))
        columns = [np.arange(one.first, one.first + one.width) for one in self.observations]
        joined = np.concatenate([np.zeros(0, np.int64), *columns])
        self.hypotheses = Hypotheses([Family(OTHER.code, starts, joined, is_start=True)])

    @contextmanager
    def borrowed(self) -> Iterator[None]:
        """Without losses as long as it lasts; all is as it was afterwards."""
        try:
            self._lose([None] * len(self._batches))
            yield
        finally:
            self._lose(self._losses)
            self._put_back()
            self._system.unknowns.restore(self._state)

    def solution(self) -> Place | None:
        """Where the adjustment with everything in it ended; None where it did not converge."""
        if not self._result.converged:
            return None
        place = Place(self._state)
        return place if not any(self._losses) else self.adjusted(place, ())[0]

    def robust(self, without: Sequence[Change] = ()) -> Place:
        """Where iterations with redescending losses lead from the start."""
        self._system.unknowns.restore(self._start)
        with self._changed(without):
            try:
                for loss, count in zip(LOSSES, STAGES, strict=True):
                    self._lose([loss] * len(self._batches))
                    self._solve(count, NEAR)
            except ObseqError:
                pass  # what has been found so far is what there is
            finally:
                self._lose([None] * len(self._batches))
        return Place(self._system.unknowns.state())

    def linearised(self, place: Place, applied: Sequence[Change]) -> tuple[Linear, Columns]:
        """All equations as they are given, at a place, and the columns of all hypotheses."""
        from scipy.sparse import csc_array

        self._system.unknowns.restore(place.state)
        result = self._solve(0, TOLERANCE, covariance=True)
        linear = linearised(self._system, result, self._batches)
        linear = with_priors(linear, self._system, result, self._priors)
        return linear, Columns(csc_array(-1.0 * linear.whitening), np.ones(self._n, np.bool_))

    def adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool, int]:
        """Where least squares without some observations lead from a place."""
        self._system.unknowns.restore(place.state)
        with self._changed(changes):
            result = self._solve(ITERATIONS, TOLERANCE)
        return Place(self._system.unknowns.state()), result.converged, len(result.iterations)

    def slips(self, change: Change, place: Place) -> tuple[Slip, ...]:
        """None: what the numbers of any formula are is not known here."""
        return ()

    def _solve(self, most: int, tolerance: float, *, covariance: bool = False) -> LeastSquaresResult:
        return self._system.solve(most, tolerance, covariance, before_iteration=self._before, strategy=DAMPED)

    def _lose(self, losses: Sequence[Loss | None]) -> None:
        for batch, loss in zip(self._batches, losses, strict=True):
            batch.loss = loss

    @contextmanager
    def _changed(self, changes: Sequence[Change]) -> Iterator[None]:
        """The system without some observations."""
        out = np.zeros(self._n, np.bool_)
        for change in changes:
            out[self.hypotheses.of(change.index)] = True
        try:
            self._take_out(out)
            yield
        finally:
            self._put_back()

    def _take_out(self, out: BoolArray) -> None:
        first = 0
        for batch, active in zip(self._batches, self._actives, strict=True):
            count = batch.shape.n_residuals * batch.n
            own = out[first : first + count].reshape(batch.n, -1).any(axis=1)
            if own.any():
                batch.active = active & ~own
            first += count
        for prior, sigmas in zip(self._priors, self._sigmas, strict=True):
            own = out[first : first + len(sigmas)]
            if own.any():
                prior.sigmas = np.where(own[:, None], NO_WEIGHT * sigmas, sigmas)
            first += len(sigmas)

    def _put_back(self) -> None:
        for batch, active in zip(self._batches, self._actives, strict=True):
            batch.active = active
        for prior, sigmas in zip(self._priors, self._sigmas, strict=True):
            prior.sigmas = sigmas


def _record(verdict: Verdict, model: JointModel) -> DiagnosisRecord:
    def what(index: int) -> str:
        one = model.observations[index]
        return one.source.label(one.row)

    def accused(one: Accusation) -> AccusedRecord:
        others = tuple(SuspectRecord(OTHER.code, what(other.change.index)) for other in one.others)
        name, size = what(one.change.index), ", ".join(f"{value:+.4g}" for value in one.change.size)
        alike = "".join(f", or {other.what}" for other in others)
        return AccusedRecord(
            OTHER.code,
            name,
            text=f"{name}{alike}: off by {size}",
            size=tuple(one.change.size.tolist()),
            sigma=tuple(one.change.sigma.tolist()),
            test=one.test,
            limit=one.limit,
            others=others,
        )

    return DiagnosisRecord(
        verdict.status.value,
        verdict.left,
        verdict.redundancy,
        tuple(map(accused, verdict.accused)),
        verdict.reason,
        tuple(map(accused, verdict.remarks)),
    )
