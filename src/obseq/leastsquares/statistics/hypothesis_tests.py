"""Tests on an adjustment, and the distributions behind them: levels, critical values, powers.

Notation of docs/statistics.md: `level` is the probability of rejecting a true hypothesis (alpha), `power`
that of finding what is there (beta).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.statistics.distributions import (
    bisected,
    chi_square_limit,
    chi_square_tails,
    normal_below,
    normal_limit,
    normal_outside,
    tau_outside,
)

MEDIAN_TO_SIGMA = 1.4826
"""Standard deviation of a normal variable over the median of its absolute value."""
WITHIN_THREE = 0.98658
"""Standard deviation of a normal variable that is known to lie within three of its own."""


@dataclass(frozen=True)
class GlobalTest:
    """Test of the variance factor: do the residuals agree with the given sigmas?

    Attributes:
        statistic: sum of weighted squared residuals; if they do, chi-square with `redundancy` degrees of
            freedom.
        redundancy: degrees of freedom.
        level: probability of rejecting sigmas that are right.
        lower: the statistic is too small below it: sigmas too large; 0 for a one-sided test.
        upper: too large above it: sigmas too small, a blunder, or a wrong model.
        p_value: probability of a statistic at least as far out if the sigmas are right.
    """

    statistic: float
    redundancy: int
    level: float
    lower: float
    upper: float
    p_value: float

    @property
    def passed(self) -> bool:
        """True when the statistic lies between its limits."""
        return self.lower <= self.statistic <= self.upper

    @property
    def sigma0(self) -> float:
        """Square root of the variance factor."""
        return float(np.sqrt(self.statistic / self.redundancy))

    @property
    def sigma0_limits(self) -> tuple[float, float]:
        """The limits for sigma0."""
        return float(np.sqrt(self.lower / self.redundancy)), float(np.sqrt(self.upper / self.redundancy))

    def to_dict(self) -> dict[str, float | bool]:
        """Numbers by name."""
        return {
            "statistic": self.statistic,
            "redundancy": self.redundancy,
            "level": self.level,
            "lower": self.lower,
            "upper": self.upper,
            "p_value": self.p_value,
            "passed": self.passed,
        }


def global_test(result: LeastSquaresResult, level: float = 0.05, two_sided: bool = True) -> GlobalTest:
    """The chi-square test of the variance factor against 1.

    Raises:
        InputError: redundancy 0: nothing is left to test.
    """
    checked_probability(level, "level")
    f, statistic = result.redundancy, result.cost
    if f <= 0:
        raise InputError("redundancy 0: the residuals vanish whatever the sigmas, nothing can be tested")
    below, above = chi_square_tails(statistic, f)
    if not two_sided:
        return GlobalTest(statistic, f, level, 0.0, chi_square_limit(f, above=level), above)
    lower, upper = chi_square_limit(f, below=level / 2), chi_square_limit(f, above=level / 2)
    return GlobalTest(statistic, f, level, lower, upper, min(1.0, 2.0 * min(below, above)))


def normal_p_values(w: ArrayLike) -> FloatArray:
    """Probability that a standard normal variable exceeds |w|, on either side."""
    return normal_outside(w)


def normal_critical(level: float) -> float:
    """Limit that the absolute value of a standard normal variable exceeds with probability `level`."""
    return normal_limit(checked_probability(level, "level") / 2.0)


def tau_p_values(tau: ArrayLike, redundancy: int) -> FloatArray:
    """Probability that Pope's tau exceeds |tau|, with f = `redundancy` degrees of freedom.

    tau = v / (sigma0 sigma_v) with sigma0 estimated from all residuals, v included; tau^2 / f has the beta
    distribution (1/2, (f - 1)/2). With f = 1, tau is 1 or -1 whatever the blunder: the probability is 1.
    Source: A. Pope, The statistics of residuals and the detection of outliers, NOAA TR NOS 65 NGS 1, 1976.
    """
    from scipy.special import betainc

    array = np.asarray(tau, dtype=np.float64)
    if redundancy <= 1:
        return np.where(np.isnan(array), np.nan, 1.0)
    share = np.clip(1.0 - np.square(array) / redundancy, 0.0, 1.0)
    return np.asarray(betainc((redundancy - 1) / 2.0, 0.5, share))


@lru_cache
def tau_critical(level: float, redundancy: int) -> float:
    """Limit that |tau| exceeds with probability `level`; infinite with redundancy 1."""
    checked_probability(level, "level")
    if redundancy <= 1:
        return float("inf")
    return bisected(lambda tau: tau_outside(tau, redundancy) > level, 0.0, float(np.sqrt(redundancy)))


def robust_spread(w: ArrayLike) -> float:
    """Standard deviation of variables of which most are normal with mean 0, whatever the others are.

    That of those within three of the standard deviations that the median of their sizes announces.
    """
    sizes = np.abs(np.asarray(w, dtype=np.float64))
    if not sizes.size:
        return 0.0
    most = sizes[sizes <= 3.0 * MEDIAN_TO_SIGMA * np.median(sizes)]
    return float(np.sqrt(np.mean(most**2))) / WITHIN_THREE


def single_level(level: float, n_tests: int) -> float:
    """Sidak's level of each of n independent tests, so that one at least rejects with probability `level`."""
    return float(-np.expm1(np.log1p(-checked_probability(level, "level")) / max(n_tests, 1)))


def overall_level(single: ArrayLike, n_tests: int) -> FloatArray:
    """Probability that one at least of n independent tests of a level rejects: inverse of `single_level`."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(n_tests * np.log1p(-np.asarray(single, dtype=np.float64))))


def holm(p_values: ArrayLike) -> FloatArray:
    """(n,) smallest overall levels at which each of n tests is rejected by Holm's procedure (1979).

    Whatever depends on what, the probability of rejecting any true hypothesis is at most that level.
    """
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    stepped = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1.0)
    found = np.empty_like(p)
    found[order] = stepped
    return found


@lru_cache
def non_centrality(level: float, power: float) -> float:
    """Shift of a standard normal variable that a two-sided test of that level finds with that power.

    Baarda's delta_0: 4.13 for a level of 0.001 and a power of 0.80.
    """
    limit = normal_critical(level)
    if not level < checked_probability(power, "power"):
        raise InputError(f"the power of a test ({power}) must exceed its level ({level})")

    def is_too_small(shift: float) -> bool:
        return normal_below(shift - limit) + normal_below(-shift - limit) < power

    return bisected(is_too_small, 0.0, limit + 10.0)


def checked_probability(value: float, what: str) -> float:
    """A probability strictly between 0 and 1."""
    if not 0.0 < value < 1.0:
        raise InputError(f"{what}: {value} is not between 0 and 1 (5 % is 0.05)")
    return value
