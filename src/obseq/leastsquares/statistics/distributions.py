"""The normal, chi-square and tau distributions, to rounding.

They are written here because loading SciPy's takes longer than a whole small adjustment.

Chi-square with f degrees of freedom is the incomplete gamma function of a = f/2 at x = half the statistic:
its series below a + 1, Lentz's continued fraction above. Tau is an incomplete beta function, by its continued
fraction. Their leading factors are written with the logarithm of 1 + e less e and with Stirling's
corrections, so that they lose no digits for millions of degrees of freedom. Sources: W. Gautschi, ACM
Transactions on Mathematical Software 5 (1979) 466; Abramowitz and Stegun 26.5.8.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import lru_cache
from itertools import count

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray

ROOT_2 = math.sqrt(2.0)
ROOT_2_PI = math.sqrt(2.0 * math.pi)
SMALLEST = 1e-300
MOST_STEPS = 100
NEAR = 1e-14
"""Of a number: where the next step would be rounding."""
STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188, -691 / 360360, 1 / 156)


def normal_below(x: float) -> float:
    """Probability that a standard normal variable is below x."""
    return 0.5 * math.erfc(-x / ROOT_2)


def normal_outside(x: ArrayLike) -> FloatArray:
    """Probability that a standard normal variable exceeds |x|, on either side."""
    array = np.abs(np.asarray(x, dtype=np.float64)) / ROOT_2
    return np.fromiter(map(math.erfc, array.ravel()), np.float64, array.size).reshape(array.shape)


@lru_cache
def normal_limit(above: float) -> float:
    """What a standard normal variable exceeds with this probability, strictly between 0 and 1.

    Halley's steps from formula 26.2.23 of Abramowitz and Stegun.
    """
    if above > 0.5:
        return -normal_limit(1.0 - above)
    t = math.sqrt(-2.0 * math.log(above))
    x = t - (2.515517 + t * (0.802853 + t * 0.010328)) / (
        1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308))
    )
    for _ in range(3):
        density = math.exp(-0.5 * x * x) / ROOT_2_PI
        step = (normal_below(-x) - above) / density if density else 0.0
        x += step / (1.0 - 0.5 * x * step)
    return x


def bisected(is_below: Callable[[float], bool], low: float, high: float) -> float:
    """Where a condition that holds at `low` and not at `high` ceases to hold, to the last digit."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if is_below(middle) else (low, middle)
    return low


def crossing(function: Callable[[float], float], low: float, high: float) -> float:
    """Where a smooth function crosses zero that is positive at `low` and negative at `high`.

    False position; an end that stays twice has its value halved (Illinois): a fifth of bisection's steps.
    Source: M. Dowell and P. Jarratt, BIT 11 (1971) 168.
    """
    first, last, x = function(low), function(high), low
    for _ in range(MOST_STEPS):
        before, x = x, (low * last - high * first) / (last - first)
        value = function(x)
        if abs(x - before) <= NEAR * abs(x) or not value:
            break
        if value * last > 0.0:
            first *= 0.5 if high == before else 1.0
            high, last = x, value
        else:
            last *= 0.5 if low == before else 1.0
            low, first = x, value
    return x


def chi_square_tails(statistic: float, freedom: float) -> tuple[float, float]:
    """Probabilities that a chi-square variable is below and above a value."""
    a, x = 0.5 * freedom, 0.5 * statistic
    if x <= 0.0:
        return 0.0, 1.0
    if not math.isfinite(x):
        return 1.0, 0.0
    if x < a + 1.0:
        below = _gamma_factor(a, x) * _series(a, x)
        return below, 1.0 - below
    above = _gamma_factor(a, x) * a * _fraction(a, x)
    return 1.0 - above, above


@lru_cache
def chi_square_limit(freedom: float, below: float | None = None, above: float | None = None) -> float:
    """The value that a chi-square variable is below, or above, with a probability: give one of the two.

    Halley's steps on the tail that is given, from Wilson and Hilferty's approximation.
    """
    tail, wanted, sign = (0, below, 1.0) if below is not None else (1, above, -1.0)
    assert wanted is not None
    shift = 2.0 / (9.0 * freedom)
    cube = 1.0 - shift - sign * normal_limit(wanted) * math.sqrt(shift)
    a = 0.5 * freedom
    x = a * cube**3 if cube > 0.1 else _small_limit(a, wanted if sign > 0 else 1.0 - wanted)
    for _ in range(MOST_STEPS):
        density = _gamma_factor(a, x) * a / x
        step = sign * (chi_square_tails(2.0 * x, freedom)[tail] - wanted) / density
        step /= max(0.5, 1.0 - 0.5 * step * ((a - 1.0) / x - 1.0))
        after = max(x - step, 0.1 * x)
        if abs(after - x) <= 1e-15 * x:
            break
        x = after
    return 2.0 * x


def tau_outside(tau: float, freedom: float) -> float:
    """Probability that Pope's tau exceeds |tau|: the incomplete beta function of ((f - 1)/2, 1/2)."""
    a, y = 0.5 * (freedom - 1.0), tau * tau / freedom
    if y <= 0.0 or y >= 1.0:
        return 0.0 if y >= 1.0 else 1.0
    factor = math.exp(a * math.log1p(-y) + _log_gamma_step(a)) * math.sqrt(y / math.pi)
    if y > 1.5 / (a + 2.5):
        return factor / a * _beta_fraction(a, 0.5, 1.0 - y)
    return 1.0 - factor / 0.5 * _beta_fraction(0.5, a, y)


def beta_above(y: float, a: float, b: float) -> float:
    """Probability that a beta variable of a and b exceeds y."""
    if y <= 0.0 or y >= 1.0:
        return 0.0 if y >= 1.0 else 1.0
    logarithm = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
    factor = math.exp(logarithm + a * math.log(y) + b * math.log1p(-y))
    if y > (a + 1.0) / (a + b + 2.0):
        return factor / b * _beta_fraction(b, a, 1.0 - y)
    return 1.0 - factor / a * _beta_fraction(a, b, y)


def non_central_above(statistic: float, freedom: int, shift: float) -> float:
    """Probability that a chi-square variable with that non-centrality (not above 1e4) exceeds a value.

    Those without it, with 0, 2, 4... degrees of freedom more, in the shares of Poisson's distribution.
    """
    half, x = 0.5 * shift, 0.5 * statistic
    if half <= 0.0 or x <= 0.0:
        return chi_square_tails(statistic, freedom)[1]
    steps = np.arange(int(half + 10.0 * math.sqrt(half)) + 30)
    shares = np.exp(steps * math.log(half) - half - np.append(0.0, np.cumsum(np.log(steps[1:]))))
    powers = np.cumsum(np.append(0.0, np.log(x / (0.5 * freedom + steps[1:]))))
    more = np.exp(0.5 * freedom * math.log(x) - x - math.lgamma(0.5 * freedom + 1.0) + powers)
    above = chi_square_tails(statistic, freedom)[1] + np.append(0.0, np.cumsum(more[:-1]))
    return float(shares @ np.minimum(above, 1.0))


def _log_gamma_step(a: float) -> float:
    """log(Gamma(a + 1/2)/Gamma(a))."""
    if a < 10.0:
        return math.lgamma(a + 0.5) - math.lgamma(a)
    return a * _log_excess(0.5 / a) + 0.5 * math.log(a) + _stirling(a + 0.5) - _stirling(a)


def _small_limit(a: float, below: float) -> float:
    """Where the first term of the series, x^a / Gamma(a + 1), has that value."""
    return max(SMALLEST, math.exp((math.log(below) + math.lgamma(a + 1.0)) / a))


def _gamma_factor(a: float, x: float) -> float:
    """x^a e^-x / Gamma(a + 1)."""
    if a < 10.0:
        return math.exp(a * math.log(x) - x - math.lgamma(a + 1.0))
    excess = (x - a) / a
    logarithm = _log_excess(excess) if abs(excess) < 0.5 else math.log(x / a) - excess
    return math.exp(a * logarithm - _stirling(a)) / math.sqrt(2.0 * math.pi * a)


def _stirling(a: float) -> float:
    """What log Gamma(a) exceeds (a - 1/2) log a - a + log(2 pi)/2 by, for a of 10 or more."""
    return sum(c / a ** (2 * k + 1) for k, c in enumerate(STIRLING))


def _log_excess(e: float) -> float:
    """log(1 + e) - e: by the series of log((1 + s)/(1 - s)) with s = e/(2 + e)."""
    s = e / (2.0 + e)
    square, term, total = s * s, 2.0 * s**3, 0.0
    for k in range(3, 80, 2):
        total += term / k
        term *= square
    return total - s * e


def _series(a: float, x: float) -> float:
    """1 + x/(a + 1) + x^2/((a + 1)(a + 2)) + ..."""
    total = term = 1.0
    while term > 1e-17 * total:
        a += 1.0
        term *= x / a
        total += term
    return total


def _fraction(a: float, x: float) -> float:
    """The continued fraction 1/(x + 1 - a - 1 (1 - a)/(x + 3 - a - ...))."""
    terms = ((k * (a - k), x + 1.0 - a + 2.0 * k) for k in count(1))
    return 1.0 / _lentz(x + 1.0 - a, terms)


def _beta_fraction(a: float, b: float, x: float) -> float:
    """The continued fraction 1/(1 + d_1/(1 + d_2/(1 + ...))) of the incomplete beta function."""

    def numerator(n: int) -> float:
        k, odd = divmod(n, 2)
        top = -(a + k) * (a + b + k) if odd else k * (b - k)
        return top * x / ((a + n - 1.0) * (a + n))

    return 1.0 / _lentz(1.0, ((numerator(n), 1.0) for n in count(1)))


def _lentz(first: float, terms: Iterable[tuple[float, float]]) -> float:
    """The continued fraction first + n_1/(d_1 + n_2/(d_2 + ...)) of (numerator, denominator) terms."""
    value = c = _nonzero(first)
    d = 0.0
    for numerator, denominator in terms:
        d = 1.0 / _nonzero(denominator + numerator * d)
        c = _nonzero(denominator + numerator / c)
        value *= c * d
        if abs(c * d - 1.0) <= 1e-16:
            break
    return value


def _nonzero(value: float) -> float:
    return value if abs(value) > SMALLEST else SMALLEST
