"""Distributions against SciPy's, and against themselves where SciPy loses digits."""

import numpy as np
import pytest
from scipy import special

from obseq.leastsquares.statistics.distributions import (
    bisected,
    chi_square_limit,
    chi_square_tails,
    crossing,
    non_central_above,
    normal_below,
    normal_limit,
    normal_outside,
    tau_outside,
)

FREEDOMS = (1, 2, 3, 4, 10, 19, 20, 21, 100, 273, 12345, 1_000_000)


def test_the_normal_distribution():
    x = np.linspace(-30.0, 30.0, 121).reshape(11, 11)
    assert normal_outside(x) == pytest.approx(2.0 * special.ndtr(-np.abs(x)), rel=1e-12)
    assert [normal_below(value) for value in x[0]] == pytest.approx(special.ndtr(x[0]), rel=1e-12)
    assert np.isnan(normal_outside([np.nan]))[0]


@pytest.mark.parametrize("above", [1e-300, 1e-16, 1e-5, 0.0005, 0.05, 0.3, 0.5, 0.7, 0.95, 1 - 1e-12])
def test_limits_of_the_normal_distribution(above):
    assert normal_limit(above) == pytest.approx(-special.ndtri(above), rel=1e-15, abs=1e-16)


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize("share", [1e-3, 0.5, 0.9, 0.999, 1.0, 1.001, 1.1, 2.0, 10.0])
def test_tails_of_chi_square(freedom, share):
    below, above = chi_square_tails(share * freedom, freedom)
    assert below == pytest.approx(special.gammainc(freedom / 2, share * freedom / 2), rel=1e-11, abs=1e-290)
    assert above == pytest.approx(special.gammaincc(freedom / 2, share * freedom / 2), rel=1e-11, abs=1e-290)


def test_tails_of_chi_square_at_the_ends():
    assert chi_square_tails(0.0, 5) == (0.0, 1.0)
    assert chi_square_tails(np.inf, 5) == (1.0, 0.0)


@pytest.mark.parametrize("freedom", FREEDOMS)
@pytest.mark.parametrize("level", [1e-9, 0.001, 0.025, 0.5, 0.975])
def test_limits_of_chi_square_are_where_its_tails_have_that_probability(freedom, level):
    assert chi_square_tails(chi_square_limit(freedom, below=level), freedom)[0] == pytest.approx(
        level, rel=1e-9
    )
    assert chi_square_tails(chi_square_limit(freedom, above=level), freedom)[1] == pytest.approx(
        level, rel=1e-9
    )
    assert chi_square_limit(freedom, above=level) == pytest.approx(
        2.0 * special.gammainccinv(freedom / 2, level), rel=1e-12
    )


@pytest.mark.parametrize("freedom", [f for f in FREEDOMS if f > 1])
@pytest.mark.parametrize("share", [1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999])
def test_tau(freedom, share):
    """SciPy is given the smaller of the two arguments, so that it does not round it."""
    tau = min(10.0, share * np.sqrt(freedom))
    inside = special.betainc(0.5, (freedom - 1) / 2, tau**2 / freedom)
    outside = special.betaincc(0.5, (freedom - 1) / 2, tau**2 / freedom)
    assert tau_outside(tau, freedom) == pytest.approx(outside, rel=1e-10)
    assert 1.0 - tau_outside(tau, freedom) == pytest.approx(inside, rel=1e-11, abs=1e-15)


def test_tau_at_its_ends():
    assert tau_outside(0.0, 5) == 1.0
    assert tau_outside(np.sqrt(5.0) * 1.000001, 5) == 0.0


@pytest.mark.parametrize("power", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("freedom", [2, 40, 300])
def test_a_crossing_is_where_bisection_finds_it_in_half_the_steps(power, freedom):
    asked = []

    def above(x):
        asked.append(x)
        return non_central_above(x, freedom, 20.0) - power

    high = 4.0 * (20.0 + freedom)
    found = crossing(above, 0.0, high)
    steps = len(asked)
    asked.clear()
    assert found == pytest.approx(bisected(lambda x: above(x) > 0.0, 0.0, high), rel=1e-12)
    assert 2 * steps < len(asked)
