"""A rejected adjustment: where causes of many contradictions are looked for, and how one cause is tested."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.assembly.clusters import whitening_of
from obseq.leastsquares.statistics.distributions import chi_square_limit
from obseq.leastsquares.statistics.final_state import final_state

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import FloatArray, IntArray
    from obseq.leastsquares.statistics.final_state import FinalState
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.adjustment.equations import Equations

Part: TypeAlias = "tuple[IntArray, Any, FloatArray, Any]"
"""Rows of the field book, root of their weights, and their whitened residuals and Jacobian."""

_ACCEPTED = 0.01
"""Level of the test of what remains without a cause."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """A rejected adjustment.

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
    def needed(self) -> float:
        """T without which the adjustment is rejected, whatever the degrees of freedom."""
        solution = self.adjustment.solution
        return solution.cost - chi_square_limit(solution.redundancy, above=_ACCEPTED)

    @property
    def suspected(self) -> float:
        """The square of the test of the one observation that is suspected; 0 where none is."""
        suspicion = self.adjustment.suspicion
        return suspicion.statistic**2 if suspicion else 0.0


def contradiction(equations: Equations, adjustment: Adjustment) -> Contradiction | None:
    """What to look for causes in; None where the adjustment is accepted.

    Args:
        equations: of the network, as they were solved.
        adjustment: what came out.
    """
    solution = adjustment.solution
    if not solution.converged or not is_rejected(solution.cost, solution.redundancy):
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


def parts_of(equations: Equations, state: FinalState, rows: IntArray) -> Iterator[Part]:
    """The batches that have any of some rows of the field book."""
    for own, batch in equations.batches.values():
        if np.isin(rows, own).any():
            root, residuals = whitening_of(batch), np.nan_to_num(state.result.residuals(batch)[:, 0])
            yield own, root.tocsc(), root @ residuals, state.cluster_rows(batch).T.tocsr()


def weighted(
    state: FinalState, parts: list[Part], columns: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """C' P v (k,), its covariance C' P Qv P C (k, k), and C' P C, of columns C (n, k) over the field book."""
    shown, whole, through = through_unknowns(state, parts, columns)
    return shown, whole - through.T @ state.solve(through), whole


def through_unknowns(
    state: FinalState, parts: list[Part], columns: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """C' P v (k,), C' P C (k, k) and A' P C (unknowns, k), of columns C (n, k) over the field book."""
    count = columns.shape[1]
    shown, whole = np.zeros(count), np.zeros((count, count))
    through = np.zeros((state.equations.n_unknowns, count))
    for rows, root, residuals, jacobian in parts:
        used = np.flatnonzero(columns[rows].any(axis=1))
        if used.size:
            white = root[:, used] @ columns[rows[used]]
            shown += white.T @ residuals
            whole += white.T @ white
            through += jacobian @ white
    return shown, whole, through


def independent(found: Contradiction) -> IntArray:
    """Rows of the known coordinates that have no covariance with others."""
    places = found.equations.known.places()
    return next((own for batch, own in places.items() if batch.clusters is None), np.zeros(0, np.int64))


def known_rows(found: Contradiction, mine: IntArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (k,) and Jacobian (k, unknowns) of independent known coordinates, in their sigmas."""
    known, state = found.adjustment.known, found.state
    places = found.equations.known.places()
    batch = next((one for one in places if one.clusters is None), None)
    if batch is None or not len(mine):
        return np.zeros(0), np.zeros((0, state.equations.n_unknowns))
    rows = state.rows(batch, np.searchsorted(places[batch], mine))[:, 0]
    return known.residuals[mine] / known.sigmas[mine], rows
