"""The scalar functions of formulas: numbers, high precision, and kernels with derivatives say the same."""

from typing import Annotated

import mpmath
import numpy as np
import pytest

from obseq.codegen import compile_formula
from obseq.formulas import Formula
from obseq.formulas import functions as f
from obseq.formulas.blocks import Number, Vector
from obseq.kernels import Calculator

UNARY = {
    "sqrt": (f.sqrt, 0.1, 9.0),
    "sin": (f.sin, -9.0, 9.0),
    "cos": (f.cos, -9.0, 9.0),
    "tan": (f.tan, -1.5, 1.5),
    "exp": (f.exp, -30.0, 30.0),
    "log": (f.log, 0.01, 99.0),
    "asin": (f.asin, -0.99, 0.99),
    "acos": (f.acos, -0.99, 0.99),
    "atan": (f.atan, -9.0, 9.0),
    "sinc": (f.sinc, -3.0, 3.0),
    "sinc_sqrt": (f.sinc_sqrt, 0.0, 9.0),
    "cos_sqrt": (f.cos_sqrt, 0.01, 2.0),
}
BINARY = {
    "atan2": (f.atan2, -2.0, 2.0),
    "power": (f.power, 0.5, 4.0),
    "angle_ratio": (f.angle_ratio, 0.1, 4.0),
    "axial_sum": (f.axial_sum, 0.1, 4.0),
    "normalised_ratio": (f.normalised_ratio, 1.0, 9.0),
}


def _formula(function, arity):
    if arity == 1:

        class Probe(Formula):
            """One function."""

            def residual(self, x: Number):
                return function(x)
    else:

        class Probe(Formula):
            """One function."""

            def residual(self, x: Number, y: Number):
                return function(x, y)

    return Probe()


@pytest.mark.slow
@pytest.mark.parametrize("name", [*UNARY, *BINARY])
def test_kernels_and_derivatives_are_exact(exact, name):
    arity = 1 if name in UNARY else 2
    function, low, high = (UNARY | BINARY)[name]
    formula = _formula(function, arity)
    u = np.random.default_rng(8).uniform(low, high, (20, arity))
    values, jacobian = Calculator(compile_formula(formula)).values_and_jacobian(u, np.zeros((20, 0)))
    for k in range(20):
        expected, slopes = exact(formula, u[k], [])
        assert formula.evaluate(u[k].tolist(), []) == pytest.approx(tuple(expected), rel=1e-14, abs=1e-15)
        np.testing.assert_allclose(values[k], expected, rtol=1e-14, atol=1e-15)
        np.testing.assert_allclose(jacobian[k], slopes, rtol=1e-13, atol=1e-14)


class Growth(Formula):
    """A regression with powers of unknowns and unknown exponents, as published test problems have."""

    def residual(
        self,
        b: Annotated[Vector, "b1", "b2", "b3", "b4"],
        *,
        x: Annotated[Number, "x"],
        y: Annotated[Number, "y"],
    ):
        b1, b2, b3, b4 = b
        decay = b1 * f.exp(-b2 * x) + b3 * x**b4 + (1 + x / b2) ** -1.5
        return decay + f.atan(b3 / (x - b4)) / np.pi + f.log(b1 + x**2) * f.cos(b4) - 2**b2 * b3**0.5 - y


@pytest.mark.slow
def test_a_formula_of_powers_and_transcendental_functions(exact):
    u, o = [1.3, 0.4, 2.1, 0.7], [1.9, 0.25]
    values, jacobian = Calculator(compile_formula(Growth())).values_and_jacobian([u], [o])
    expected, slopes = exact(Growth(), u, o)
    np.testing.assert_allclose(values[0], expected, rtol=1e-14)
    np.testing.assert_allclose(jacobian[0], slopes, rtol=1e-14)
    assert Growth().evaluate(u, o) == pytest.approx(tuple(expected), rel=1e-14)


def test_limits_on_numbers():
    assert f.sinc(0.0) == f.sinc_sqrt(0.0) == 1.0
    assert f.angle_ratio(0.0, 4.0) == 0.25
    assert np.isnan(f.angle_ratio(0.0, -4.0))
    assert f.axial_sum(16.0, -3.0) == 2.0
    assert f.normalised_ratio(2.0, 2.0) == 0.0 == f.normalised_ratio(0.0, -1.0)


def test_high_precision_is_kept():
    with mpmath.workdps(50):
        third = mpmath.mpf(1) / 3
        assert abs(f.power(third, third) - third**third) < mpmath.mpf(10) ** -49
        assert abs(f.axial_sum(mpmath.mpf(10) ** -40, mpmath.mpf(-1)) * 2 - mpmath.mpf(10) ** -40) < 1e-79
