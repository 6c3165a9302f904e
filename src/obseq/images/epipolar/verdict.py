"""Whether two orientations agree: epipolar residuals against what the measures of the points announce."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.images.epipolar.field import Fit

GOOD = 1.5
"""Residuals are good up to so many times the expected size."""
_BEYOND = 5.0
_PATTERN = 0.5
"""Share of the noise from which a pattern is worth telling."""
_POINTS_PER_TERM = 3


@dataclass(frozen=True)
class EpipolarVerdict:
    """How large epipolar residuals are, and what they consist of; pixels of the first image.

    Attributes:
        count: of points.
        expected: standard deviation that the measures of the points give a residual.
        size: robust standard deviation about zero.
        noise: what is left without the pattern.
        pattern: root mean square of the pattern over the image; None with too few points to see one.
        degree: of the polynomial that the pattern is.
        gross: rows of the points beyond five times the larger of `noise` and `expected`, once the pattern is
            off; the worst first.
    """

    count: int
    expected: float
    size: float
    noise: float
    pattern: float | None
    degree: int
    gross: tuple[int, ...]

    @property
    def is_good(self) -> bool:
        """Whether the residuals are about what is expected."""
        return self.size <= GOOD * self.expected

    def sentences(self) -> str:
        """What was found, in words."""
        found = (
            f"Standard deviation of {self.count} residuals: {self.size:.3g} px (robust); expected of the "
            f"measures: {self.expected:.3g} px."
        )
        return "\n".join([found, self._judged(), *([self._mismatches()] if self.gross else [])])

    def _judged(self) -> str:
        pattern = self._of_pattern()
        if self.is_good:
            return f"GOOD: the orientations agree with the points. {pattern}"
        times = self.size / self.expected
        if self.pattern is not None and self.pattern > self.noise:
            why = (
                "mostly a pattern over the image: look at the calibration, or at the orientation of one image"
            )
        else:
            why = (
                "and no pattern explains it: look at the points (their measures, mismatches), or whether "
                "orientation and points belong together"
            )
        return f"POOR: {times:.2g} times larger than expected, {why}. {pattern}"

    def _of_pattern(self) -> str:
        if self.pattern is None:
            return "There are too few points to see a pattern."
        parts = (
            f"{self.pattern:.2g} px against {self.noise:.2g} px of noise (polynomial of degree {self.degree})"
        )
        word = (
            "A pattern over the image" if self.pattern > _PATTERN * self.noise else "No pattern to speak of"
        )
        return f"{word}: {parts}."

    def _mismatches(self) -> str:
        subject = "point is" if len(self.gross) == 1 else "points are"
        return f"{len(self.gross)} {subject} far beyond the others: mismatches, or gross errors."


def judged(values: FloatArray, pixels: FloatArray, fits: Sequence[Fit], sigma: float) -> EpipolarVerdict:
    """What epipolar residuals say of two orientations.

    A residual is half the distance to the epipolar line: of two points measured with a standard deviation s
    in each coordinate it has s / sqrt(2).

    Args:
        values: (n,) residuals.
        pixels: (n, 2) of the first image.
        fits: polynomials of degrees 0, 1, ...
        sigma: standard deviation of a measured coordinate, pixels.
    """
    usable = [fit for fit in fits if _POINTS_PER_TERM * _terms(fit) <= len(values)]
    left, pattern = values, None
    if usable:
        field = usable[-1].polynomial(pixels)
        left = values - field
        own = _terms(usable[-1]) / len(values) * _robust_deviation(left) ** 2
        pattern = math.sqrt(max(0.0, float(np.mean(field**2)) - own))
    expected, noise = sigma / math.sqrt(2.0), _robust_deviation(left)
    order = np.argsort(-np.abs(left), kind="stable")
    gross = tuple(order[np.abs(left[order]) > _BEYOND * max(noise, expected)].tolist())
    degree = usable[-1].polynomial.degree if usable else -1
    return EpipolarVerdict(len(values), expected, _robust_deviation(values), noise, pattern, degree, gross)


def _terms(fit: Fit) -> int:
    degree = fit.polynomial.degree
    return (degree + 1) * (degree + 2) // 2


def _robust_deviation(values: FloatArray) -> float:
    """Robust standard deviation about zero."""
    return 1.4826 * float(np.median(np.abs(values)))
