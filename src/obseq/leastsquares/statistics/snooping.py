"""Data snooping: one blunder after another is found by a test of stated level, and left out."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from enum import Enum
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError, SingularSystemError
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability, overall_level
from obseq.leastsquares.statistics.joint_levels import (
    POWER,
    joint_critical,
    joint_p_value,
    joint_ratio_critical,
    shared_level,
)
from obseq.leastsquares.statistics.reliability import reliability

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.solution.result import LeastSquaresResult
    from obseq.leastsquares.statistics.joint_tests import JointTest
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
        degrees: how many equations were tested as one; the statistic is then the square T of its test.
        critical: limit of the statistic.
        blunders: estimates of the errors of the observations that were tested as one: its own, then those of
            its companions; empty where it was tested alone.
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
    degrees: int = 1
    critical: float = float("nan")
    blunders: tuple[float, ...] = ()

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
    groups: Mapping[Batch, Sequence[IntArray]]


@dataclass(frozen=True, eq=False)
class _Test:
    """The worst of some tests of as many degrees of freedom each.

    Attributes:
        part: where it stands.
        statistic: w, tau, or the square T of a test of several equations.
        degrees: of freedom.
        share: square of the statistic, or T, over its limit.
        at: row and component.
        joint: the test of several equations as one; None for one equation.
    """

    part: _Part
    statistic: float
    degrees: int
    share: float
    at: tuple[int, int]
    joint: JointTest | None = None


@dataclass(frozen=True)
class _Limits:
    """Limits of squares of w or tau, by degrees of freedom, of all tests of an adjustment.

    Attributes:
        level: of the test of one equation.
        redundancy: of the adjustment.
        sigma0: root of its variance factor.
        settings: what is tested.
        n_tests: how many tests there are.
    """

    level: float
    redundancy: int
    sigma0: float
    settings: _Settings
    n_tests: int

    def of(self, degrees: int) -> float:
        if self.settings.statistic is Statistic.W:
            return joint_critical(self.level, POWER, degrees)
        return joint_ratio_critical(self.level, POWER, degrees, self.redundancy)

    def scaled(self, test: JointTest) -> float:
        """T, or T over the variance factor."""
        return test.statistic if self.settings.statistic is Statistic.W else test.statistic / self.sigma0**2

    def p_value(self, test: _Test) -> float:
        """Probability of a larger statistic where nothing is wrong, of all tests if they share the level."""
        single = self._single(test)
        return float(overall_level(single, self.n_tests)) if self.settings.overall else single

    def _single(self, test: _Test) -> float:
        if test.joint is not None:
            redundancy = None if self.settings.statistic is Statistic.W else self.redundancy
            return joint_p_value(test.statistic, test.degrees, redundancy)
        is_w = self.settings.statistic is Statistic.W
        return float((test.part.w_p_values if is_w else test.part.tau_p_values)[test.at])


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
    groups: Mapping[Batch, Sequence[IntArray]] | None = None,
    first: Sequence[Place] = (),
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
        groups: by batch, the rows that are tested and left out as one observation: the components of a
            vector; see `reliability`.
        first: observations that are tested before all others, each where the unknowns are when it is called:
            at a place that fits the others. Where a direction is half a turn off, iterations that take part
            of it end far from there, and tests then leave out what is right.
    """
    checked_probability(level, "level")
    settings = _Settings(Statistic(statistic), level, overall, batches, priors, groups or {})
    rejections: list[Rejection] = []
    needed: tuple[str, ...] = ()
    try:
        for place in first:
            rejections += _tested_in_place(system, place, settings)
        while True:
            try:
                result = system.solve(covariance=True, **dict(solve_options or {}))
            except SingularSystemError:
                if needed or not rejections or not rejections[-1].companions:
                    raise
                needed = (rejections[-1].label,)
                rejections.pop().set_active(True)
                continue
            quality = reliability(system, result, groups=settings.groups)
            outcome = _Outcome(None, SnoopingEnd.NEEDED, needed) if needed else _tested(quality, settings)
            if outcome.rejection is not None and len(rejections) == max_rejections:
                outcome = _Outcome(None, SnoopingEnd.LIMIT, (outcome.rejection.label,))
            if outcome.end is not None or outcome.rejection is None:
                break
            rejections.append(outcome.rejection)
            rejections[-1].set_active(False)
    except BaseException:  # an interruption too leaves the system as it was given
        for rejection in rejections:
            rejection.set_active(True)
        raise
    end = outcome.end or SnoopingEnd.CLEAN
    return Snooping(
        tuple(rejections), end, outcome.suspects, settings.statistic, level, overall, result, quality
    )


def _tested_in_place(system: LeastSquares, place: Place, settings: _Settings) -> list[Rejection]:
    """The rejection of an observation, whose residual is its error here; none where no test rejects it."""
    batch, row = place
    try:
        quality = reliability(system, system.solve(covariance=True, max_iterations=0), groups=settings.groups)
        part = quality.of(batch)
        limits = _limits(list(quality.observations), quality, settings)
        quality.left_out(batch, row)
    except (InputError, SingularSystemError):  # nothing is known without it
        return []
    at, tested = (row, 0), _statistics(part, settings)
    if limits is None or tested.shape[1:] != (1,) or not tested[at]:
        return []
    share, w = float(part.redundancy[at]), float(part.w[at])
    statistic = share * w  # what an adjustment would show, which spreads the rest among the others
    if settings.statistic is Statistic.TAU:
        factor = limits.sigma0**2 - share * (1.0 - share) * w**2 / quality.redundancy
        statistic /= factor**0.5
    if statistic**2 <= limits.of(1):
        return []
    test = _Test(part, statistic, 1, statistic**2 / limits.of(1), at)
    found = _rejection(test, limits, limits.p_value(test))
    found = replace(found, blunder=share * found.blunder)
    found.set_active(False)
    return [found]


def _tested(quality: Reliability, settings: _Settings) -> _Outcome:
    """The worst observation of an adjustment, if its test rejects it."""
    observed = [
        part for part in quality.observations if settings.batches is None or part.source in settings.batches
    ]
    parts: list[_Part] = [*observed, *(quality.constraints if settings.priors else ())]
    limits = _limits(parts, quality, settings)
    if limits is None:
        return _Outcome(None, SnoopingEnd.UNTESTABLE)
    tests = [test for part in parts for test in _worst(part, limits)]
    worst = max(tests, key=lambda test: test.share)
    p_value = limits.p_value(worst)
    if worst.share <= 1.0:
        return _Outcome(None, SnoopingEnd.CLEAN)
    ties = tuple(name for part in parts for name in _tied(part, limits, worst.share))
    if len(ties) > 1:
        return _Outcome(None, SnoopingEnd.INSEPARABLE, ties)
    if not any(worst.part is part for part in observed):
        return _Outcome(None, SnoopingEnd.GIVEN, ties)
    rejection = _rejection(worst, limits, p_value)
    try:
        quality.left_out(rejection.batch, rejection.row)
    except InputError:
        return _Outcome(None, SnoopingEnd.NEEDED, (rejection.label,))
    return _Outcome(rejection)


def _limits(parts: list[_Part], quality: Reliability, settings: _Settings) -> _Limits | None:
    """The limits of all tests; None where there are none."""
    alone = sum(int(np.count_nonzero(_alone(part))) for part in parts)
    counts = Counter({1: alone} if alone else {})
    counts.update(test.degrees for part in parts for test in part.joint if test.degrees)
    if not counts:
        return None
    level = shared_level(settings.level, counts, POWER) if settings.overall else settings.level
    sigma0 = quality.sigma0 or float("nan")
    return _Limits(level, quality.redundancy, sigma0, settings, sum(counts.values()))


def _alone(part: _Part) -> BoolArray:
    """(n, n_residuals) equations that are tested one by one."""
    found = part.controlled.copy()
    for test in part.joint:
        found[test.rows] = False
    return found


def _statistics(part: _Part, settings: _Settings) -> FloatArray:
    """(n, n_residuals) |w| or |tau| of the equations that are tested one by one; 0 for others."""
    values = np.abs(part.w if settings.statistic is Statistic.W else part.tau)
    return np.where(_alone(part), np.nan_to_num(values), 0.0)


def _worst(part: _Part, limits: _Limits) -> Iterator[_Test]:
    """The worst equation, and the tests of several as one."""
    values = _statistics(part, limits.settings)
    if values.size:
        row, component = np.unravel_index(np.argmax(values), values.shape)
        at = int(row), int(component)
        signed = (part.w if limits.settings.statistic is Statistic.W else part.tau)[at]
        yield _Test(part, float(signed), 1, float(values[at]) ** 2 / limits.of(1), at)
    for test in part.joint:
        if test.degrees:
            statistic = limits.scaled(test)
            share = statistic / limits.of(test.degrees)
            worst = int(test.rows[np.nanargmax(np.abs(part.w[test.rows, 0]))])
            yield _Test(part, statistic, test.degrees, share, (worst, 0), test)


def _rejection(test: _Test, limits: _Limits, p_value: float) -> Rejection:
    part, at, joint = test.part, test.at, test.joint
    batch = cast("Batch", part.source)
    found = Rejection(
        part.label(at[0]),
        batch,
        *at,
        test.statistic,
        p_value,
        float(-part.left_out_residuals[at]),
        float(part.detectable[at]),
        critical=limits.of(test.degrees) if joint else limits.of(1) ** 0.5,
    )
    if joint is None:
        return found
    own = joint.rows == at[0]
    blunder, others = float(joint.blunder[own][0]), joint.rows[~own].tolist()
    blunders = (blunder, *joint.blunder[~own].tolist())
    companions = tuple((batch, row) for row in others)
    return replace(found, blunder=blunder, blunders=blunders, degrees=test.degrees, companions=companions)


def _tied(part: _Part, limits: _Limits, share: float) -> Iterator[str]:
    """Names of the observations whose test is as far beyond its limit as the worst, up to rounding."""
    least = share * (1.0 - TIE) ** 2
    beyond = np.square(_statistics(part, limits.settings)) > least * limits.of(1)
    for row in np.flatnonzero(beyond.any(axis=1)):
        yield part.label(int(row))
    for test in part.joint:
        if test.degrees and limits.scaled(test) > least * limits.of(test.degrees):
            yield part.label(int(test.rows[0]))
