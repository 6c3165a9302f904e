"""Data snooping: one blunder after another is found by a test of stated level, and left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any, TypeAlias, cast

from obseq.arrays import IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, SingularSystemError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.statistics.hypothesis_tests import checked_probability
from obseq.leastsquares.statistics.reliability import Reliability, reliability
from obseq.leastsquares.statistics.snooping_tests import (
    Limits,
    Part,
    Settings,
    Statistic,
    Test,
    limits_of,
    tied_names,
    worst_tests,
)
from obseq.leastsquares.system import LeastSquares

Place: TypeAlias = "tuple[Batch, int]"
"""A batch, and a row in it."""


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
    """
    checked_probability(level, "level")
    settings = Settings(Statistic(statistic), level, overall, batches, priors, groups or {})
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


def _tested(quality: Reliability, settings: Settings) -> _Outcome:
    """The worst observation of an adjustment, if its test rejects it."""
    observed = [
        part for part in quality.observations if settings.batches is None or part.source in settings.batches
    ]
    parts: list[Part] = [*observed, *(quality.constraints if settings.priors else ())]
    limits = limits_of(parts, quality, settings)
    if limits is None:
        return _Outcome(None, SnoopingEnd.UNTESTABLE)
    tests = [test for part in parts for test in worst_tests(part, limits)]
    worst = max(tests, key=lambda test: test.share)
    p_value = limits.p_value(worst)
    if worst.share <= 1.0:
        return _Outcome(None, SnoopingEnd.CLEAN)
    ties = tuple(name for part in parts for name in tied_names(part, limits, worst.share))
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


def _rejection(test: Test, limits: Limits, p_value: float) -> Rejection:
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
