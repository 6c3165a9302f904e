"""What an adjustment found: a plain record, and the questions it answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError
from obseq.leastsquares.solution import export

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.problem.unknowns import State, UnknownTable
    from obseq.leastsquares.solution.cofactors import Cofactors


class StopReason(Enum):
    """Why the iterations ended."""

    STEP = "the last step is below the tolerance, in standard deviations of the unknowns"
    ROUNDING = "the last step is at the level of rounding"
    STALLED = "the last steps are negligible and the sum of squares no longer decreases"
    NO_DECREASE = "no step decreases the cost any more, and the last one is not negligible"
    NO_UNKNOWNS = "every unknown is frozen"
    ITERATIONS = "the number of iterations asked for is reached"


@dataclass(frozen=True)
class Iteration:
    """One Gauss-Newton iteration.

    Attributes:
        sigma0: from the residuals at the start of the iteration, over the redundancy of the whole system;
            None when the redundancy is zero.
        max_step: largest change of an unknown, in its unit (metre, radian).
        length: length of the step in the metric of the normal matrix, sqrt(dx' N dx): no unknown moved
            by more than this many of its a-priori standard deviations.
        squares: sum of weighted squared residuals by group, at the start of the iteration.
    """

    sigma0: float | None
    max_step: float
    length: float
    squares: Mapping[str, float]

    @property
    def cost(self) -> float:
        """Sum of all weighted squared residuals at the start of the iteration."""
        return sum(self.squares.values())


@dataclass(frozen=True)
class LeastSquaresResult:
    """The solution of a least squares system.

    Attributes:
        iterations: one record per iteration.
        converged: True when the iterations ended by themselves.
        stop_reason: why they ended.
        n_observations: scalar equations of the active observations.
        n_constraints: scalar equations of the priors.
        n_unknowns: free scalar unknowns.
        redundancy: n_observations + n_constraints - n_unknowns.
        sigma0: square root of the sum of squares of the chosen groups, at the solution, over the
            redundancy; None when the redundancy is zero: nothing can be said then of the given sigmas.
        variance_factor: sum of squares of all groups over the redundancy: what scales covariances; None as
            sigma0.
        squares: sum of weighted squared residuals by group at the solution.
        redundant_constraints: hard constraints that follow from the others, by name.
    """

    iterations: tuple[Iteration, ...]
    converged: bool
    stop_reason: StopReason
    n_observations: int
    n_constraints: int
    n_unknowns: int
    redundancy: int
    sigma0: float | None
    variance_factor: float | None
    squares: Mapping[str, float]
    _table: UnknownTable = field(repr=False)
    _state: State = field(repr=False)
    _residuals: Mapping[Batch, FloatArray] = field(repr=False)
    _cofactors: Cofactors | None = field(repr=False, default=None)
    redundant_constraints: tuple[str, ...] = ()

    @property
    def cost(self) -> float:
        """Sum of all weighted squared residuals at the solution."""
        return sum(self.squares.values())

    def values(self, ids: ArrayLike) -> FloatArray:
        """Solution of blocks that are alike: (n, k); (n, 3, 3) for rotations; (n, 3) for directions."""
        return self._table.read(ids, self._state)

    def residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed at the solution, in the unit of the observation."""
        try:
            return self._residuals[batch]
        except KeyError:
            raise InputError(f"this {batch.name} batch was not part of the solved system") from None

    def whitened_residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) what the adjustment sees: residuals, whitened where they are correlated."""
        return np.ascontiguousarray(batch.whitened(self.residuals(batch).T[:, None])[:, 0].T)

    def normalised_residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) residuals divided by the given sigmas."""
        return self.whitened_residuals(batch) / batch.sigmas

    def prior_residuals(self, prior: Prior) -> FloatArray:
        """(n_scalars,) unknowns minus given values at the solution."""
        return prior.residuals(self._state.values)

    def covariance(self, ids: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n, k, k) covariances of blocks that are alike, in squared units; zero where frozen.

        Rotations: of the small rotation around the solution, in radians, along the axes of its local frame.

        Args:
            ids: blocks.
            a_priori: with the given sigmas as they are, instead of scaled by the variance factor.
        """
        return self._asked().blocks(ids) * self._factor(a_priori)

    def covariance_between(self, first: ArrayLike, second: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n k, m l) covariances between two lists of blocks, whether or not an observation joins them."""
        rows, columns = self._table.scalars(first).ravel(), self._table.scalars(second).ravel()
        return self._asked().between(rows, columns) * self._factor(a_priori)

    def precisions(self, ids: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n, k) standard deviations of the unknowns of blocks that are alike."""
        return np.sqrt(np.diagonal(self.covariance(ids, a_priori), axis1=1, axis2=2))

    def summary(self) -> str:
        """A few lines: counts, sigma0, why the iterations ended, worst normalised residuals."""
        return export.summary(self)

    def to_dict(self) -> dict[str, Any]:
        """The whole solution as plain values (see `export`)."""
        return export.to_dict(self)

    def to_json(self) -> str:
        """The same as JSON text."""
        return export.to_json(self)

    def unknowns(self, package: str | None = None) -> Any:
        """One row per scalar unknown: columns, or a table of "pandas" or "pyarrow" when one is asked for."""
        columns = export.unknown_columns(self)
        return columns if package is None else export.as_table(columns, package)

    def observations(self, package: str | None = None) -> Any:
        """One row per scalar residual: columns, or a table of "pandas" or "pyarrow"."""
        columns = export.observation_columns(self)
        return columns if package is None else export.as_table(columns, package)

    def _asked(self) -> Cofactors:
        if self._cofactors is None:
            raise InputError("covariances were not asked for: solve(covariance=True)")
        return self._cofactors

    def _factor(self, a_priori: bool) -> float:
        if a_priori:
            return 1.0
        if self.variance_factor is None:
            raise InputError(
                "redundancy 0: the residuals say nothing of the precision; ask for a_priori=True, "
                "which takes the given sigmas as they are"
            )
        return self.variance_factor
