"""Data snooping: one blunder after another is found by a test of stated level, and left out."""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, SingularSystemError
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability, overall_level
from obseq.leastsquares.statistics.reliability import reliability

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from obseq.arrays import FloatArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.solution.result import LeastSquaresResult
    from obseq.leastsquares.statistics.reliability import ObservationReliability, Reliability
    from obseq.leastsquares.system import LeastSquares

    _Part = ObservationReliability[Batch | Prior]


Place: TypeAlias = "tuple[Batch, int]"
"""A batch, and a row in it."""

TIE = 1e-6
"""Two statistics that agree to this share cannot tell their observations apart."""


class Statistic(Enum):
    """What is tested."""

    W = "w"
    TAU = "tau"


class SnoopingEnd(Enum):
    """Why snooping ended."""

    CLEAN = "no test rejects any more"
    LIMIT = "the number of rejections asked for is reached"
    INSEPARABLE = "a test rejects, but cannot tell which of several observations is wrong"
    NEEDED = "a test rejects an observation without which some unknowns are undetermined"
    GIVEN = "a test rejects what is given of some unknowns beforehand, which is not left out"
    UNTESTABLE = "no observation is controlled by the others"


@dataclass(frozen=True)
class Rejection:
    """An observation that was left out.

    Attributes:
        label: what it is called.
        batch: its batch.
        row: its row in the batch.
        component: the residual that failed the test; the whole observation was left out.
        statistic: value of w or tau, the largest of its adjustment.
        p_value: probability that the largest of all statistics is larger still when there is no blunder; of
            this statistic alone when the level is that of single tests.
        blunder: estimate of the error of the observed value, in its unit: too large when positive.
        detectable: minimal detectable bias, in the same unit.
        companions: batches and rows of the observations that were left out with it.
    """

    label: str
    batch: Batch
    row: int
    component: int
    statistic: float
    p_value: float
    blunder: float
    detectable: float
    companions: tuple[Place, ...] = ()

    def set_active(self, active: bool) -> None:
        """Makes it and its companions active or not."""
        for batch, row in ((self.batch, self.row), *self.companions):
            batch.set_active(row, active)


@dataclass(frozen=True)
class Snooping:
    """What data snooping did.

    Attributes:
        rejections: in the order of finding; these observations are inactive now.
        end: why it ended.
        suspects: names of the observations that could not be told apart, or are needed.
        statistic: what was tested.
        level: probability of rejecting something when there is no blunder.
        overall: True when the level is that of all tests of an adjustment together, False for each test.
        result: solution of what remained.
        reliability: of what remained.
    """

    rejections: tuple[Rejection, ...]
    end: SnoopingEnd
    suspects: tuple[str, ...]
    statistic: Statistic
    level: float
    overall: bool
    result: LeastSquaresResult
    reliability: Reliability

    def reinstate(self) -> None:
        """Makes the rejected observations active again; the system is to be solved anew."""
        for rejection in self.rejections:
            rejection.set_active(True)

    def columns(self) -> dict[str, list[str] | list[int] | list[float]]:
        """The rejections as a table by columns."""
        return {
            "observation": [rejection.label for rejection in self.rejections],
            "component": [rejection.component for rejection in self.rejections],
            self.statistic.value: [rejection.statistic for rejection in self.rejections],
            "p_value": [rejection.p_value for rejection in self.rejections],
            "blunder": [rejection.blunder for rejection in self.rejections],
            "detectable": [rejection.detectable for rejection in self.rejections],
        }


@dataclass(frozen=True)
class _Settings:
    """What the tests are; see `snoop`."""

    statistic: Statistic
    level: float
    overall: bool
    batches: Collection[Batch] | None
    priors: bool


@dataclass(frozen=True)
class _Outcome:
    """One round of tests: what to reject, or why not."""

    rejection: Rejection | None = None
    end: SnoopingEnd | None = None
    suspects: tuple[str, ...] = ()


def snoop(
    system: LeastSquares,
    level: float = 0.05,
    statistic: Statistic | str = Statistic.W,
    overall: bool = True,
    batches: Collection[Batch] | None = None,
    max_rejections: int | None = None,
    solve_options: Mapping[str, Any] | None = None,
    priors: bool = False,
    together: Callable[[Batch, int], Sequence[Place]] | None = None,
) -> Snooping:
    """Finds blunders one at a time: solves, rejects the worst observation if it fails its test, solves again.

    Args:
        system: the system; its rejected observations become inactive (`Snooping.reinstate` undoes it).
        level: probability of rejecting something where nothing is wrong.
        statistic: "w" where the given sigmas are trusted, "tau" where only their proportions are.
        overall: whether the level is that of all tests of one adjustment together (Sidak), or of each.
        batches: the batches whose observations may be rejected; all when None.
        max_rejections: ends after as many; no limit when None.
        solve_options: arguments of `LeastSquares.solve` for the solutions.
        priors: whether priors are tested too; they are not left out, but where the largest test is that of
            one, it is the suspect and the search ends.
        together: what is left out with an observation, such as the other components of its vector.
    """
    checked_probability(level, "level")
    settings = _Settings(Statistic(statistic), level, overall, batches, priors)
    rejections: list[Rejection] = []
    needed: tuple[str, ...] = ()
    try:
        while True:
            try:
                result = system.solve(covariance=True, **dict(solve_options or {}))
            except SingularSystemError:
                if needed or not rejections or not rejections[-1].companions:
                    raise
                needed = (rejections[-1].label,)
                rejections.pop().set_active(True)
                continue
            quality = reliability(system, result)
            outcome = _Outcome(None, SnoopingEnd.NEEDED, needed) if needed else _tested(quality, settings)
            if outcome.rejection is not None and len(rejections) == max_rejections:
                outcome = _Outcome(None, SnoopingEnd.LIMIT, (outcome.rejection.label,))
            if outcome.end is not None or outcome.rejection is None:
                break
            rejections.append(_with_companions(outcome.rejection, together))
            rejections[-1].set_active(False)
    except BaseException:  # an interruption too leaves the system as it was given
        for rejection in rejections:
            rejection.set_active(True)
        raise
    end = outcome.end or SnoopingEnd.CLEAN
    return Snooping(
        tuple(rejections), end, outcome.suspects, settings.statistic, level, overall, result, quality
    )


def _with_companions(
    rejection: Rejection, together: Callable[[Batch, int], Sequence[Place]] | None
) -> Rejection:
    """A rejection with what goes with it, of what is active."""
    found = together(rejection.batch, rejection.row) if together else ()
    others = (place for place in found if place != (rejection.batch, rejection.row))
    return replace(rejection, companions=tuple((batch, row) for batch, row in others if batch.active[row]))


def _tested(quality: Reliability, settings: _Settings) -> _Outcome:
    """The worst observation of an adjustment, if its test rejects it."""
    observed = [
        part for part in quality.observations if settings.batches is None or part.source in settings.batches
    ]
    parts: list[_Part] = [*observed, *(quality.constraints if settings.priors else ())]
    n_tests = sum(int(np.count_nonzero(part.controlled)) for part in parts)
    if not n_tests:
        return _Outcome(None, SnoopingEnd.UNTESTABLE)
    tops = [np.nanmax(_statistics(part, settings), initial=0.0) for part in parts]
    worst = int(np.argmax(tops))
    at, p_value = _worst(parts[worst], settings, n_tests)
    if p_value >= settings.level:
        return _Outcome(None, SnoopingEnd.CLEAN)
    ties = _tied(parts, settings, max(tops))
    if len(ties) > 1:
        return _Outcome(None, SnoopingEnd.INSEPARABLE, ties)
    if worst >= len(observed):
        return _Outcome(None, SnoopingEnd.GIVEN, ties)
    rejection = _rejection(observed[worst], settings, at, p_value)
    try:
        quality.left_out(rejection.batch, rejection.row)
    except InputError:
        return _Outcome(None, SnoopingEnd.NEEDED, (rejection.label,))
    return _Outcome(rejection)


def _statistics(part: _Part, settings: _Settings) -> FloatArray:
    return np.abs(part.w if settings.statistic is Statistic.W else part.tau)


def _worst(part: _Part, settings: _Settings, n_tests: int) -> tuple[tuple[int, int], float]:
    """Row and component of the largest statistic, and its p value."""
    row, component = np.unravel_index(np.nanargmax(_statistics(part, settings)), part.w.shape)
    at = int(row), int(component)
    single = (part.w_p_values if settings.statistic is Statistic.W else part.tau_p_values)[at]
    return at, float(overall_level(single, n_tests)) if settings.overall else float(single)


def _rejection(
    part: ObservationReliability[Batch], settings: _Settings, at: tuple[int, int], p_value: float
) -> Rejection:
    return Rejection(
        part.label(at[0]),
        part.source,
        *at,
        float((part.w if settings.statistic is Statistic.W else part.tau)[at]),
        p_value,
        float(-part.left_out_residuals[at]),
        float(part.detectable[at]),
    )


def _tied(parts: list[_Part], settings: _Settings, top: float) -> tuple[str, ...]:
    """Names of the observations whose statistic is the largest, up to rounding."""
    return tuple(
        part.label(int(row))
        for part in parts
        for row in np.flatnonzero((_statistics(part, settings) > top * (1.0 - TIE)).any(axis=1))
    )
