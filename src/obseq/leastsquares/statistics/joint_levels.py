"""Limits of tests of several equations as one: those that find an error as large as tests of one equation do.

Baarda's B-method: an error that the test of one equation finds with some power, at some level, is found with
the same power whatever the number of equations that are tested together. The level of their test follows.
Sources: W. Baarda, A testing procedure for use in geodetic networks, Delft 1968; P. Teunissen, Testing
theory, Delft 2000, section 4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

from obseq.leastsquares.statistics.distributions import (
    beta_above,
    bisected,
    chi_square_tails,
    crossing,
    non_central_above,
)
from obseq.leastsquares.statistics.hypothesis_tests import (
    checked_probability,
    non_centrality,
    normal_critical,
    single_level,
)

POWER = 0.80
"""Power that tests of different numbers of equations have in common."""
_ROUNDS, _ARRIVED = 30, 1e-9


@lru_cache
def joint_critical(level: float, power: float, degrees: int) -> float:
    """Limit of the statistic T of a test of so many equations as one.

    Args:
        level: of the test of one equation.
        power: that both have for one error.
        degrees: of freedom of T.
    """
    if degrees == 1:
        return normal_critical(level) ** 2
    shift = non_centrality(level, power) ** 2
    return crossing(lambda x: non_central_above(x, degrees, shift) - power, 0.0, 4.0 * (shift + degrees))


@lru_cache
def joint_level(level: float, power: float, degrees: int) -> float:
    """Probability that T exceeds its limit where nothing is wrong; above `level` for more degrees."""
    return level if degrees == 1 else chi_square_tails(joint_critical(level, power, degrees), degrees)[1]


def joint_p_value(statistic: float, degrees: int, redundancy: int | None = None) -> float:
    """Probability of a larger T where nothing is wrong; of T over the variance factor with a redundancy."""
    if redundancy is None:
        return chi_square_tails(statistic, degrees)[1]
    rest = redundancy - degrees
    return beta_above(statistic / redundancy, 0.5 * degrees, 0.5 * rest) if rest > 0 else 1.0


def joint_ratio_critical(level: float, power: float, degrees: int, redundancy: int) -> float:
    """Limit of T over the variance factor, which T has a share in (Pope's tau squared, of one equation)."""
    rest = redundancy - degrees
    if rest <= 0:
        return float("inf")
    return redundancy * _beta_limit(joint_level(level, power, degrees), degrees, rest)


@lru_cache
def _beta_limit(level: float, degrees: int, rest: int) -> float:
    return bisected(lambda y: beta_above(y, 0.5 * degrees, 0.5 * rest) > level, 0.0, 1.0)


def shared_level(level: float, counts: Mapping[int, int], power: float) -> float:
    """Level of tests of one equation with which all tests of an adjustment together have a level.

    Args:
        level: probability that any of them rejects where nothing is wrong, were they independent.
        counts: how many tests there are of each number of degrees of freedom.
        power: that all of them have for one error.
    """
    checked_probability(level, "level")
    single = single_level(level, sum(counts.values()))
    if set(counts) <= {1}:
        return single
    for _ in range(_ROUNDS):
        levels = ((n, joint_level(single, power, degrees)) for degrees, n in counts.items())
        times = sum(n * math.log1p(-own) for n, own in levels) / math.log1p(-single)
        before, single = single, -math.expm1(math.log1p(-level) / times)
        if abs(single - before) <= _ARRIVED * single:
            break
    return single
