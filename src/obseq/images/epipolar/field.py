"""The field of residuals over an image: percentiles, and polynomials fitted with robust weights.

Each fit of degree d takes its weights from the errors of degree d - 1, and solves the right system by QR on
centred and scaled coordinates. (The original adds each equation once per monomial, while its row is half
refreshed, and reads the weight of the monomial's index: its fits have been wrong since 2016.)
"""

from __future__ import annotations

from itertools import chain
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass

INTERVALS = 20
"""Percentiles are given at every twentieth, both ends included: 21 values, the last is the worst point."""
PROPORTION, FACTOR, LEAST_ERROR = 0.75, 2.0, 0.5
"""Of the weights: quantile that sets the scale; how it is divided; pixels added to every error."""
HIGHEST_DEGREE = 5
"""Of the fits; percentiles are reported up to the one before."""


def exponents(degree: int) -> list[tuple[int, int]]:
    """Powers of x and y up to a total degree: 1, y, x, y^2, xy, x^2, ..."""
    return list(chain.from_iterable([(i, t - i) for i in range(t + 1)] for t in range(degree + 1)))


@dataclass(frozen=True)
class Polynomial:
    """A polynomial in pixels, kept on centred and scaled coordinates.

    Attributes:
        degree: total degree.
        scaled: coefficients of the monomials of `exponents` in (pixel - centre) / scale.
        centre: (2,) pixels.
        scale: pixels.
    """

    degree: int
    scaled: FloatArray
    centre: FloatArray
    scale: float

    def __call__(self, pixels: FloatArray) -> FloatArray:
        """Values (n,) at pixels (n, 2)."""
        return np.asarray(_monomials(pixels, self.degree, self.centre, self.scale) @ self.scaled)

    def coefficients(self) -> FloatArray:
        """Coefficients of the monomials of `exponents` in raw pixels."""
        index = {power: row for row, power in enumerate(exponents(self.degree))}
        found = np.zeros(len(index))
        x = np.polynomial.Polynomial([-self.centre[0] / self.scale, 1.0 / self.scale])
        y = np.polynomial.Polynomial([-self.centre[1] / self.scale, 1.0 / self.scale])
        for (i, j), value in zip(index, self.scaled, strict=True):
            product = np.multiply.outer((x**i).coef[: i + 1], (y**j).coef[: j + 1]) * value
            for (a, b), part in np.ndenumerate(product):
                found[index[a, b]] += part
        return found


class Fit(NamedTuple):
    """A fitted field.

    Attributes:
        polynomial: the field.
        scale: the error that sets the weights, pixels.
        weights: (n,).
        cost: weighted sum of squares.
    """

    polynomial: Polynomial
    scale: float
    weights: FloatArray
    cost: float


def percentiles(values: FloatArray) -> FloatArray:
    """The 21 order statistics of absolute values at 0, 5, ..., 100 per cent; nan of none."""
    ordered = np.sort(np.abs(values))
    if not len(ordered):
        return np.full(INTERVALS + 1, np.nan)
    return np.asarray(ordered[np.arange(INTERVALS + 1) * (len(ordered) - 1) // INTERVALS])


def robust_weights(errors: FloatArray) -> tuple[FloatArray, float]:
    """Weights (n,) of errors (n,), and the error that sets their scale: its point weighs about one fifth.

    Where three quarters of the errors are exactly zero, all weights are equal.
    """
    rank = int(np.clip(np.floor(PROPORTION * len(errors) + 0.5), 0, len(errors) - 1))
    scale = float(np.sort(np.abs(errors))[rank])
    if scale == 0.0:
        return np.ones(len(errors)), scale
    return 1.0 / (1.0 + (FACTOR * (np.abs(errors) + LEAST_ERROR) / scale) ** 2), scale


def fit(pixels: FloatArray, values: FloatArray, weights: FloatArray, degree: int) -> Polynomial:
    """The polynomial with the least weighted squares; of least norm where points do not determine it."""
    centre = pixels.mean(axis=0)
    scale = float(np.abs(pixels - centre).max()) or 1.0
    root = np.sqrt(weights)
    rows = _monomials(pixels, degree, centre, scale) * root[:, None]
    scaled, *_ = np.linalg.lstsq(rows, values * root, rcond=None)
    return Polynomial(degree, np.asarray(scaled, dtype=np.float64), centre, scale)


def fit_field(pixels: FloatArray, values: FloatArray, highest: int = HIGHEST_DEGREE) -> list[Fit]:
    """Fits of degrees 0 to `highest`, each with weights from the errors of the one before."""
    fits = []
    errors = values
    for degree in range(highest + 1):
        weights, scale = robust_weights(errors)
        polynomial = fit(pixels, values, weights, degree)
        errors = values - polynomial(pixels)
        fits.append(Fit(polynomial, scale, weights, float((weights * errors**2).sum())))
    return fits


def _monomials(pixels: FloatArray, degree: int, centre: FloatArray, scale: float) -> FloatArray:
    """(n, terms)."""
    x, y = ((pixels - centre) / scale).T
    return np.stack([x**i * y**j for i, j in exponents(degree)], axis=1)
