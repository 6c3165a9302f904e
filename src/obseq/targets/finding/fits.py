"""Where a drawing lies in an image, and what the least squares of it gives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray, FloatRows, IntArray
from obseq.dataclass import dataclass

SQUARE = 8
"""Pixels of the side of the squares in which JPEG rounds: what it adds is common to those of one."""


@dataclass(frozen=True, eq=False)
class Placed:
    """How a drawing lies in an image.

    Attributes:
        centre: (2,) image of the centre of the figure, pixels.
        matrix: (2, 2) images of the unit vectors, pixels.
        perspective: (2,) as in `DeformImHomography`, 1/unit.
        sigma: of the point spread, pixels.
        bend: (2,) likewise, 1/pixel.
    """

    centre: FloatArray
    matrix: FloatRows
    perspective: FloatArray
    sigma: float
    bend: FloatArray

    @property
    def unit(self) -> float:
        """Pixels of a unit, the mean of both directions."""
        a, b, c, d = self.matrix.ravel().tolist()
        return math.sqrt(abs(a * d - b * c))

    @property
    def largest(self) -> float:
        """Pixels of a unit in the direction in which it is longest."""
        a, b, c, d = self.matrix.ravel().tolist()
        return 0.5 * (math.hypot(a + d, c - b) + math.hypot(a - d, b + c))

    @property
    def smallest(self) -> float:
        """And in which it is shortest."""
        a, b, c, d = self.matrix.ravel().tolist()
        return 0.5 * abs(math.hypot(a + d, c - b) - math.hypot(a - d, b + c))

    def pixels(self, places: FloatRows) -> FloatRows:
        """(n, 2) where places of the drawing (n, 2), units, are seen."""
        away = places @ self.matrix.T / (1.0 + places @ self.perspective)[:, None]
        bent: FloatRows = (away * away).sum(axis=1)[:, None] * self.bend
        return self.centre + away + bent

    @property
    def ellipse(self) -> tuple[FloatArray, FloatRows]:
        """The image of the unit circle: the centre of its ellipse, which is not the circle's, and its shape.

        A place p on it has `(p - centre)' inverse(shape) (p - centre) = 1`. The dual conic of the circle is
        diag(1, 1, -1); the centre of its image is the pole of the line at infinity.
        """
        g = self.perspective
        denominator = 1.0 - float(g @ g)
        away = -self.matrix @ g / denominator
        shape: FloatRows = self.matrix @ self.matrix.T / denominator + np.outer(away, away)
        return self.centre + away, shape

    def turned(self, turn: FloatRows) -> Placed:
        """The same for a drawing that is turned: its place m is where `turn @ m` was."""
        return Placed(self.centre, self.matrix @ turn, self.perspective @ turn, self.sigma, self.bend)


@dataclass(frozen=True, eq=False)
class Fit:
    """What the least squares of a drawing gives.

    Attributes:
        placed: where the drawing lies.
        joint: (4, 4) covariance of bend and centre.
        sigma0: of the grey levels, from the residuals.
        likeness: share of the grey variance that the drawing explains.
        gain: grey levels between sheet and ink, in the middle; negative for black ink.
        offset: grey level of the sheet in the middle.
        places: (n, 2) of the drawing, of the pixels that count.
        residuals: (n,) drawing minus image, in parts of the gain.
        forgiven: numbers of the pixels of the image that show something else, and were left out.
        squares: (2,) variance of the centre as whole squares of pixels say it, and as they would if no noise
            were common to the pixels of one, over that of `joint` (`in_squares`).
        n_pixels: their number.
    """

    placed: Placed
    joint: FloatRows
    sigma0: float
    likeness: float
    gain: float
    offset: float
    places: FloatRows
    residuals: FloatArray
    forgiven: IntArray
    squares: FloatArray

    def likeness_with(self, noise: float) -> float:
        """The share of the variance that the drawing explains, of what noise (grey levels) does not."""
        left, noise = self.sigma0**2, min(noise, self.sigma0) ** 2
        whole = left / max(1.0 - self.likeness, 1e-12)
        return 1.0 - (left - noise) / (whole - noise) if whole > 2.0 * noise else self.likeness

    @property
    def covariance(self) -> FloatRows:
        """(2, 2) of the centre, pixels squared."""
        return self.joint[2:, 2:]

    @property
    def n_pixels(self) -> int:
        """Number of the pixels that count."""
        return len(self.residuals)


def in_squares(
    jacobian: FloatRows, inverse: FloatRows, residuals: FloatArray, pixels: IntArray, width: int
) -> FloatArray:
    """(2,) variance of the last two unknowns from the sums of whole squares, and what is expected of it.

    The residuals of a square move the unknowns together, whatever their correlation is. The sum of the
    squares of that is the true variance (Liang and Zeger, 1986), less what the fit has taken from residuals.

    Args:
        jacobian: (n, k).
        inverse: (k, k) of the normal matrix.
        residuals: (n,).
        pixels: (n,) their numbers in the image.
        width: of the image.
    """
    lines, columns = np.divmod(pixels, width)
    squares = lines // SQUARE * width + columns // SQUARE
    order = np.argsort(squares, kind="stable")
    starts = np.flatnonzero(np.diff(squares[order], prepend=-1))
    rows, left = jacobian[order], residuals[order]
    moves = rows @ inverse[:, -2:]
    moved = np.add.reduceat(moves * left[:, None], starts)
    taken = np.add.reduceat(moves[:, :, None] * rows[:, None], starts)
    free = np.square(moves).sum() - np.einsum("nki,ij,nkj->", taken, inverse, taken, optimize=True)
    variance = left @ left / max(len(left) - len(inverse), 1)
    stated = variance * float(np.trace(inverse[-2:, -2:]))
    return np.array([float(np.square(moved).sum()) / stated, variance * float(free) / stated])


def as_in_squares(fits: Sequence[Fit]) -> list[Fit]:
    """The fits of an image with the noise that is common in squares: all together say how much that is."""
    seen, expected = np.sum([fit.squares for fit in fits], axis=0) if fits else (1.0, 1.0)
    return [replace(fit, joint=fit.joint * max(seen / expected, 1.0)) for fit in fits]
