"""What is wrong with an open adjustment: the engine of the diagnosis on all of its equations."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, cast

import numpy as np

from obseq.arrays import BoolArray
from obseq.diagnosis.columns import Columns
from obseq.diagnosis.engine import diagnose
from obseq.diagnosis.hypotheses import Family, Hypotheses
from obseq.diagnosis.linear import Linear, linearised, with_priors
from obseq.diagnosis.policy import LOSSES, NO_WEIGHT
from obseq.diagnosis.protocol import Change, Slip
from obseq.diagnosis.verdict import Accusation, Verdict
from obseq.errors import ObseqError
from obseq.images.adjustment.surveys import JoinedSurvey, follower
from obseq.images.causes.other_observation import OTHER
from obseq.images.causes.survey_equations import SurveyEquation, SurveyEquations
from obseq.images.diagnosing.model import DAMPED, ITERATIONS, NEAR, STAGES, TOLERANCE, Place
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
from obseq.leastsquares.problem.losses import Loss
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.unknowns import State
from obseq.leastsquares.sparse import Sparse
from obseq.records.diagnosis import AccusedRecord, DiagnosisRecord, SlipRecord, SuspectRecord
from obseq.survey.causes.catalogue import RARITY


class Observation(NamedTuple):
    """An observation, or a known value: its batch or prior, its row there, its equations among all."""

    source: Batch | Prior
    row: int
    first: int
    width: int
    survey: SurveyEquation | None

    @property
    def code(self) -> str:
        """Of what accuses it: that of surveys for what is of one."""
        return OTHER.code if self.survey is None else self.survey.code

    @property
    def what(self) -> str:
        """What it is called."""
        return self.source.label(self.row) if self.survey is None else self.survey.what


def diagnosis_of(
    system: LeastSquares,
    result: LeastSquaresResult,
    start: State,
    surveys: Sequence[JoinedSurvey],
) -> DiagnosisRecord:
    """What is wrong with an adjustment that has redundancy; the system is as it was afterwards.

    Args:
        system: it was solved.
        result: what came out.
        start: where the iterations started.
        surveys: networks in it.
    """
    model = JointModel(system, result, start, surveys)
    with model.borrowed():
        return _record(diagnose(model), model)


class JointModel:
    """A system as the engine sees it: each observation, and each known value, may be wrong."""

    def __init__(
        self,
        system: LeastSquares,
        result: LeastSquaresResult,
        start: State,
        surveys: Sequence[JoinedSurvey],
    ) -> None:
        self._system, self._result, self._start = system, result, start
        self._before, of_surveys = follower(surveys), SurveyEquations(surveys)
        self._batches, self._priors = list(system.batches), list(system.priors)
        self._actives = [batch.active.copy() for batch in self._batches]
        self._losses = [batch.loss for batch in self._batches]
        self._sigmas = [prior.sigmas.copy() for prior in self._priors]
        self._state = system.unknowns.state()
        found: list[Observation] = []
        first = 0
        for batch, active in zip(self._batches, self._actives, strict=True):
            width = batch.shape.n_residuals
            rows = np.flatnonzero(active).tolist()
            found += [
                Observation(batch, row, first + width * row, width, of_surveys.of(batch, row)) for row in rows
            ]
            first += width * batch.n
        for prior in self._priors:
            count = len(prior.scalars)
            found += [Observation(prior, row, first + row, 1, None) for row in range(count)]
            first += count
        self._n = first
        self.observations = sorted(found, key=lambda one: one.code)
        alike = itertools.groupby(self.observations, key=lambda one: one.code)
        self.hypotheses = Hypotheses([_family(code, list(members)) for code, members in alike])

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
        self._system.unknowns.restore(place.state)
        result = self._solve(0, TOLERANCE, covariance=True)
        linear = linearised(self._system, result, self._batches)
        linear = with_priors(linear, self._system, result, self._priors)
        changed = cast("Sparse", linear.whitening).T.scaled(np.full(self._n, -1.0))
        return linear, Columns(changed, np.ones(self._n, np.bool_))

    def adjusted(self, place: Place, changes: Sequence[Change]) -> tuple[Place, bool, int]:
        """Where least squares without some observations lead from a place."""
        self._system.unknowns.restore(place.state)
        with self._changed(changes):
            result = self._solve(ITERATIONS, TOLERANCE)
        return Place(self._system.unknowns.state()), result.converged, len(result.iterations)

    def slips(self, change: Change, place: Place) -> tuple[Slip, ...]:
        """Of surveys alone: what the numbers of any formula are is not known here."""
        survey = self.observations[change.index].survey
        return () if survey is None else tuple(survey.slips(change))

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


def _family(code: str, members: Sequence[Observation]) -> Family:
    """The hypotheses that each of some observations is wrong."""
    starts = np.append(0, np.cumsum([one.width for one in members]))
    columns = np.concatenate([np.arange(one.first, one.first + one.width) for one in members])
    return Family(code, starts, columns, RARITY.get(code, 0.0), is_start=True)


def _record(verdict: Verdict, model: JointModel) -> DiagnosisRecord:
    def suspect(index: int) -> SuspectRecord:
        one = model.observations[index]
        return SuspectRecord(one.code, one.what)

    def accused(one: Accusation) -> AccusedRecord:
        own, others = suspect(one.change.index), tuple(suspect(other.change.index) for other in one.others)
        survey = model.observations[one.change.index].survey
        size = ", ".join(f"{value:+.4g}" for value in one.change.size)
        size = size if survey is None else survey.told(float(one.change.size[0]))
        slip = "".join(f"; {slip.text}" for slip in one.slips[:1])
        alike = "".join(f", or {other.what}" for other in others)
        return AccusedRecord(
            own.code,
            own.what,
            text=f"{own.what}{alike} is off by {size}{slip}",
            size=tuple(one.change.size.tolist()),
            sigma=tuple(one.change.sigma.tolist()),
            unit="" if survey is None else survey.unit,
            test=one.test,
            limit=one.limit,
            others=others,
            slips=tuple(SlipRecord(slip.code, slip.text) for slip in one.slips),
        )

    return DiagnosisRecord(
        verdict.status.value,
        verdict.left,
        verdict.redundancy,
        tuple(map(accused, verdict.accused)),
        verdict.reason,
        tuple(map(accused, verdict.remarks)),
    )
