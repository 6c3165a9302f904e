"""The tests of one adjustment by which data snooping finds its worst observation, with their limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from enum import Enum
from typing import TypeAlias

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.statistics.hypothesis_tests import overall_level
from obseq.leastsquares.statistics.joint_levels import (
    POWER,
    joint_critical,
    joint_p_value,
    joint_ratio_critical,
    shared_level,
)
from obseq.leastsquares.statistics.joint_tests import JointTest
from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
from obseq.leastsquares.statistics.reliability import Reliability

Part: TypeAlias = ObservationReliability[Batch | Prior]


TIE = 1e-6
"""Two statistics that agree to this share cannot tell their observations apart."""


class Statistic(Enum):
    """What is tested."""

    W = "w"
    TAU = "tau"


@dataclass(frozen=True)
class Settings:
    """What the tests are; see `snoop`."""

    statistic: Statistic
    level: float
    overall: bool
    batches: Collection[Batch] | None
    priors: bool
    groups: Mapping[Batch, Sequence[IntArray]]


@dataclass(frozen=True, eq=False)
class Test:
    """The worst of some tests of as many degrees of freedom each.

    Attributes:
        part: where it stands.
        statistic: w, tau, or the square T of a test of several equations.
        degrees: of freedom.
        share: square of the statistic, or T, over its limit.
        at: row and component.
        joint: the test of several equations as one; None for one equation.
    """

    part: Part
    statistic: float
    degrees: int
    share: float
    at: tuple[int, int]
    joint: JointTest | None = None


@dataclass(frozen=True)
class Limits:
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
    settings: Settings
    n_tests: int

    def of(self, degrees: int) -> float:
        """The limit of a test of so many degrees of freedom."""
        if self.settings.statistic is Statistic.W:
            return joint_critical(self.level, POWER, degrees)
        return joint_ratio_critical(self.level, POWER, degrees, self.redundancy)

    def scaled(self, test: JointTest) -> float:
        """T, or T over the variance factor."""
        return test.statistic if self.settings.statistic is Statistic.W else test.statistic / self.sigma0**2

    def p_value(self, test: Test) -> float:
        """Probability of a larger statistic where nothing is wrong, of all tests if they share the level."""
        single = self._single(test)
        return float(overall_level(single, self.n_tests)) if self.settings.overall else single

    def _single(self, test: Test) -> float:
        if test.joint is not None:
            redundancy = None if self.settings.statistic is Statistic.W else self.redundancy
            return joint_p_value(test.statistic, test.degrees, redundancy)
        is_w = self.settings.statistic is Statistic.W
        return float((test.part.w_p_values if is_w else test.part.tau_p_values)[test.at])


def limits_of(parts: list[Part], quality: Reliability, settings: Settings) -> Limits | None:
    """The limits of all tests; None where there are none."""
    alone = sum(int(np.count_nonzero(_alone(part))) for part in parts)
    counts = Counter({1: alone} if alone else {})
    counts.update(test.degrees for part in parts for test in part.joint if test.degrees)
    if not counts:
        return None
    level = shared_level(settings.level, counts, POWER) if settings.overall else settings.level
    sigma0 = quality.sigma0 or float("nan")
    return Limits(level, quality.redundancy, sigma0, settings, sum(counts.values()))


def _alone(part: Part) -> BoolArray:
    """(n, n_residuals) equations that are tested one by one."""
    found = part.controlled.copy()
    for test in part.joint:
        found[test.rows] = False
    return found


def statistics_of(part: Part, settings: Settings) -> FloatArray:
    """(n, n_residuals) |w| or |tau| of the equations that are tested one by one; 0 for others."""
    values = np.abs(part.w if settings.statistic is Statistic.W else part.tau)
    return np.where(_alone(part), np.nan_to_num(values), 0.0)


def worst_tests(part: Part, limits: Limits) -> Iterator[Test]:
    """The worst equation, and the tests of several as one."""
    values = statistics_of(part, limits.settings)
    if values.size:
        row, component = np.unravel_index(np.argmax(values), values.shape)
        at = int(row), int(component)
        signed = (part.w if limits.settings.statistic is Statistic.W else part.tau)[at]
        yield Test(part, float(signed), 1, float(values[at]) ** 2 / limits.of(1), at)
    for test in part.joint:
        if test.degrees:
            statistic = limits.scaled(test)
            share = statistic / limits.of(test.degrees)
            yield Test(part, statistic, test.degrees, share, (_worst(part, test), 0), test)


def _worst(part: Part, test: JointTest) -> int:
    """The equation whose own test is the worst; the one with the largest error where none has one."""
    alone = np.abs(part.w[test.rows, 0])
    sizes = np.abs(test.blunder) if np.isnan(alone).all() else np.nan_to_num(alone)
    return int(test.rows[np.argmax(sizes)])


def tied_names(part: Part, limits: Limits, share: float) -> Iterator[str]:
    """Names of the observations whose test is as far beyond its limit as the worst, up to rounding."""
    least = share * (1.0 - TIE) ** 2
    beyond = np.square(statistics_of(part, limits.settings)) > least * limits.of(1)
    for row in np.flatnonzero(beyond.any(axis=1)):
        yield part.label(int(row))
    for test in part.joint:
        if test.degrees and limits.scaled(test) > least * limits.of(test.degrees):
            yield part.label(int(test.rows[0]))
