"""A rejected adjustment of vectors: where causes of many contradictions are looked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.final_state import final_state

if TYPE_CHECKING:
    from obseq.arrays import IntArray
    from obseq.leastsquares.statistics.final_state import FinalState
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.equations import Equations

_ACCEPTED = 0.01
"""Level of the test of what remains without a cause."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """A rejected adjustment of vectors.

    Attributes:
        equations: of the network, as they were solved.
        adjustment: what came out.
        state: the solved system.
    """

    equations: Equations
    adjustment: Adjustment
    state: FinalState

    def is_explained(self, statistic: float, degrees: int) -> bool:
        """Whether the adjustment is accepted without what has this test T, of so many degrees of freedom."""
        solution = self.adjustment.solution
        return not is_rejected(solution.cost - statistic, solution.redundancy - degrees)

    @property
    def suspected(self) -> float:
        """The square of the test of the one observation that is suspected; 0 where none is."""
        suspicion = self.adjustment.suspicion
        return suspicion.statistic**2 if suspicion else 0.0


def contradiction(equations: Equations, adjustment: Adjustment) -> Contradiction | None:
    """What to look for causes in; None without vectors, or where the adjustment is accepted.

    Args:
        equations: of the network, as they were solved.
        adjustment: what came out.
    """
    solution = adjustment.solution
    if not vectors_of(adjustment) or not is_rejected(solution.cost, solution.redundancy):
        return None
    try:
        return Contradiction(equations, adjustment, final_state(equations.system, solution))
    except InputError:
        return None  # parts of the network were left out, or its sigmas changed


def vectors_of(adjustment: Adjustment) -> list[IntArray]:
    """Rows of the components of each vector that is tested as one, along a vertical."""
    return [test.rows for test in adjustment.quality.joint if np.isfinite(test.rise)]


def is_rejected(squares: float, redundancy: int) -> bool:
    """Whether residuals are larger than the sigmas announce: their weighted squares, and the redundancy."""
    return redundancy > 0 and squares > chi_square_limit(redundancy, above=_ACCEPTED)
