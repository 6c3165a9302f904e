"""Does the adjustment fit as well as the given sigmas say? The test of sigma0, and what it means."""

import math
from dataclasses import dataclass

from obseq.report.record import AdjustmentRecord, ObservationRecord

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Verdict:
    """The two-sided chi-square test of sigma0.

    Attributes:
        sigma0: The estimate that is tested, from all residuals; None when nothing is redundant.
        lower: Smallest sigma0 that the test accepts.
        upper: Largest sigma0 that the test accepts.
        redundancy: Degrees of freedom.
    """

    sigma0: float | None
    lower: float
    upper: float
    redundancy: int

    @property
    def is_accepted(self) -> bool:
        """Whether sigma0 is what the sigmas announce; False also when it cannot be tested."""
        return self.sigma0 is not None and self.lower <= self.sigma0 <= self.upper

    @property
    def headline(self) -> str:
        """The result of the test in a few words."""
        if self.sigma0 is None:
            return "not tested"
        if self.is_accepted:
            return "accepted"
        return "rejected: too large" if self.sigma0 > self.upper else "rejected: too small"

    @property
    def explanation(self) -> str:
        """What the result means and what to do about it."""
        if self.sigma0 is None:
            return "Nothing is redundant: each observation fits exactly, and nothing checks it."
        if self.is_accepted:
            return "The residuals are what the sigmas of the observations announce."
        if self.sigma0 > self.upper:
            return (
                "The residuals are larger than the sigmas announce: look for a blunder among the worst "
                "residuals, for a wrong known point, or for sigmas that are too small."
            )
        return (
            "The residuals are smaller than the sigmas announce: the sigmas are too large, or observations "
            "that depend on each other were given as independent."
        )


def verdict(record: AdjustmentRecord) -> Verdict:
    """The test of sigma0: redundancy * sigma0^2 follows chi-square with that many degrees of freedom.

    What is tested is the root of the variance factor, in which the residuals of known points count, or the
    record's sigma0 (MMVII's, of the survey observations) where the record has no variance factor.
    """
    redundancy, factor = record["redundancy"], record.get("variance_factor")
    sigma0 = record["sigma0"] if factor is None else math.sqrt(factor)
    if redundancy <= 0 or sigma0 is None or not math.isfinite(sigma0):
        return Verdict(None, math.nan, math.nan, redundancy)
    from scipy.special import gammaincinv

    tail = (1.0 - CONFIDENCE) / 2.0
    lower, upper = (
        math.sqrt(2.0 * float(gammaincinv(redundancy / 2.0, level)) / redundancy)
        for level in (tail, 1.0 - tail)
    )
    return Verdict(sigma0, lower, upper, redundancy)


def worst_first(record: AdjustmentRecord) -> list[ObservationRecord]:
    """The active observations that have a normalised residual, the largest in absolute value first."""
    tested = [
        row for row in record["observations"] if row["active"] and row["normalised_residual"] is not None
    ]
    return sorted(tested, key=lambda row: -abs(row["normalised_residual"] or 0.0))
