"""Whether points have stayed: tests of displacements.

The congruence test is Pelzer's: ``d' Q^+ d / (h s0^2)`` against Fisher's distribution, h the rank of the
cofactors Q of the displacements d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.distributions import chi_square_limit, chi_square_tails
from obseq.records.comparison import TestRecord

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray
    from obseq.survey.epochs.displacements import Displacements

RANK = 1e-9
"""Share of the largest eigenvalue below which a direction counts as known exactly."""


@dataclass(frozen=True)
class Tester:
    """Tests at one level.

    Attributes:
        level: probability that a test finds a movement where there is none.
        variance_factor: of both epochs together; 1 when the sigmas are trusted.
        redundancy: behind it; None when the sigmas are trusted.
    """

    level: float
    variance_factor: float = 1.0
    redundancy: int | None = None

    def of(self, vector: FloatArray, cofactors: FloatArray) -> TestRecord | None:
        """The test of displacements (k,) with cofactors (k, k); None where all of them are known exactly."""
        if not cofactors.any():
            return None
        values, vectors = np.linalg.eigh(cofactors)
        kept = values > RANK * values[-1]
        freedom = int(np.count_nonzero(kept))
        along = vectors[:, kept].T @ vector
        squares = float(np.sum(along**2 / values[kept]) / self.variance_factor)
        return self.judged(squares / freedom, freedom)

    def of_ratio(self, ratio: float, above: int, below: int) -> TestRecord:
        """The two-sided test of a ratio of variance factors, the larger above, of given redundancies."""
        from scipy.special import fdtrc, fdtri

        p_value = min(2.0 * float(fdtrc(above, below, ratio)), 1.0)
        limit = float(fdtri(above, below, 1.0 - 0.5 * self.level))
        return TestRecord(ratio, above, limit, p_value, p_value >= self.level)

    def judged(self, statistic: float, freedom: int) -> TestRecord:
        """The test of a statistic, of displacements in units of sigma0, by its degrees of freedom."""
        if self.redundancy is None:
            p_value = chi_square_tails(statistic * freedom, freedom)[1]
            limit = chi_square_limit(freedom, above=self.level) / freedom
        else:
            from scipy.special import fdtrc, fdtri

            p_value = float(fdtrc(freedom, self.redundancy, statistic))
            limit = float(fdtri(freedom, self.redundancy, 1.0 - self.level))
        return TestRecord(statistic, freedom, limit, p_value, p_value >= self.level)


def congruence(moved: Displacements, chosen: BoolArray, tester: Tester) -> TestRecord:
    """The test of chosen points (a mask) together.

    Raises:
        InputError: all of them are held: nothing can be tested.
    """
    scalars = np.repeat(chosen, 3)
    found = tester.of(moved.vectors[chosen].ravel(), moved.cofactors[np.ix_(scalars, scalars)])
    if found is None:
        raise InputError("compare: all common points are held in both epochs; there is nothing to test")
    return found
