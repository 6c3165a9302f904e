"""What an adjustment found: a plain record, and the questions it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from obseq.arguments import expecting, instance
from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError, ObseqError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.unknowns import State, UnknownTable
from obseq.leastsquares.problem.weights import Weighing
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solution.export import as_table, observation_columns, rows, unknown_columns

FORMAT = "obseq-least-squares"
VERSION = 1

SHOWN = 5
"""Worst observations in a summary."""


class StopReason(Enum):
    """Why the iterations ended."""

    STEP = "what steps would still change is below the tolerance, in standard deviations of the unknowns"
    ROUNDING = "the last step is at the level of rounding"
    NO_DECREASE = "no step decreases the cost any more, and the last one is not negligible"
    DIVERGED = "the steps and the sum of squares grow: the iterations diverge"
    OSCILLATES = "the steps swing about and do not shrink: the iterations oscillate"
    NO_UNKNOWNS = "every unknown is frozen"
    ITERATIONS = "the number of iterations asked for is reached"

    @property
    def is_arrival(self) -> bool:
        """Whether the iterations have arrived at a minimum."""
        return self in (StopReason.STEP, StopReason.ROUNDING, StopReason.NO_UNKNOWNS)


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

    def __str__(self) -> str:
        sigma0 = "undefined" if self.sigma0 is None else f"{self.sigma0:.6g}"
        return f"iterations: sigma0 {sigma0}, largest step {self.max_step:.3g}"


@dataclass(frozen=True)
class LeastSquaresResult:
    """The solution of a least squares system.

    Attributes:
        iterations: one record per iteration.
        converged: True when the iterations have arrived at a minimum.
        stop_reason: why they ended.
        n_observations: scalar equations of the active observations, those that a loss leaves no weight aside.
        n_constraints: scalar equations of the priors, and of rows that count as constraints.
        n_unknowns: free scalar unknowns.
        redundancy: n_observations + n_constraints - n_unknowns, and the parameters that a datum takes, or
            that the observations of a free network leave to chance (Levenberg-Marquardt).
        sigma0: square root of the sum of squares of the chosen groups, at the solution, over the
            redundancy; None when the redundancy is zero: nothing can be said then of the given sigmas.
        variance_factor: sum of squares of all groups over the redundancy: what scales covariances; None as
            sigma0.
        squares: sum of weighted squared residuals by group at the solution.
        table: the unknowns, by name and block.
        state: their values at the solution.
        frozen: (n_scalars,) which of them kept their values.
        redundant_constraints: hard constraints that follow from the others, by name.
        evaluations: at how many points the iterations computed all residuals; derivatives at a point that
            was tried before count no more (so do SciPy's `nfev` and MINPACK's).
        weak: why there are no covariances: the error that names what is hardly determined where the
            iterations ended; None where nothing is. Who asks for covariances gets this error.
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
    table: UnknownTable = field(repr=False)
    state: State = field(repr=False)
    frozen: BoolArray = field(repr=False)
    _residuals: Mapping[Batch, FloatArray] = field(repr=False)
    _weighings: Mapping[Batch, Weighing] = field(repr=False)
    _prior_values: Mapping[Prior, FloatArray] = field(repr=False)
    _cofactors: Cofactors | None = field(repr=False, default=None)
    redundant_constraints: tuple[str, ...] = ()
    evaluations: int = 0
    weak: ObseqError | None = None

    @property
    def ending(self) -> str:
        """Why the iterations ended; where they have not arrived, with the last iteration and its step."""
        reason = self.stop_reason.value
        if self.converged or not self.iterations:
            return reason
        last = self.iterations[-1]
        step = f"a step of {last.max_step:.3g}, {last.length:.3g} standard deviations"
        return f"{reason} (iteration {len(self.iterations)}: {step})"

    @property
    def cost(self) -> float:
        """Sum of all weighted squared residuals at the solution."""
        return sum(self.squares.values())

    def values(self, ids: ArrayLike) -> FloatArray:
        """Solution of blocks that are alike: (n, k); (n, 3, 3) for rotations; (n, 3) for directions."""
        return self.table.read(self._solved(ids, "values"), self.state)

    @expecting(batch=instance(Batch))
    def residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed at the solution, in the unit of the observation."""
        try:
            return self._residuals[batch]
        except KeyError:
            raise InputError(f"this {batch.name} batch was not part of the solved system") from None

    def whitened_residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) what the adjustment sees: residuals, whitened where they are correlated."""
        return self.weighing(batch).whitened_residuals(self.residuals(batch))

    def normalised_residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) residuals divided by the given sigmas."""
        return self.whitened_residuals(batch) / self.weighing(batch).sigmas

    def weighing(self, batch: Batch) -> Weighing:
        """The sigmas, and what else its residuals were weighed by, whatever became of them since."""
        self.residuals(batch)
        return self._weighings[batch]

    @expecting(prior=instance(Prior))
    def prior_residuals(self, prior: Prior) -> FloatArray:
        """(n_scalars,) unknowns minus given values at the solution."""
        try:
            return np.asarray(self.state.values[prior.scalars] - self._prior_values[prior])
        except KeyError:
            raise InputError(f"this {prior.name} prior was not part of the solved system") from None

    def covariance(self, ids: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n, k, k) covariances of blocks that are alike, in squared units; zero where frozen.

        Rotations: of the small rotation around the solution, in radians, along the axes of its local frame.

        Args:
            ids: blocks.
            a_priori: with the given sigmas as they are, instead of scaled by the variance factor.
        """
        return self.cofactors.blocks(self._solved(ids, "covariance")) * self._factor(a_priori)

    def covariance_between(self, first: ArrayLike, second: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n k, m l) covariances between two lists of blocks, whether or not an observation joins them."""
        both = (self._solved(ids, "covariance_between") for ids in (first, second))
        rows, columns = (self.table.scalars(ids).ravel() for ids in both)
        return self.cofactors.between(rows, columns) * self._factor(a_priori)

    def precisions(self, ids: ArrayLike, a_priori: bool = False) -> FloatArray:
        """(n, k) standard deviations of the unknowns of blocks that are alike."""
        return np.sqrt(np.diagonal(self.covariance(ids, a_priori), axis1=1, axis2=2))

    def summary(self) -> str:
        """A few lines: counts, sigma0, why the iterations ended, the five worst normalised residuals."""
        sigma0 = "undefined (no redundancy)" if self.sigma0 is None else f"{self.sigma0:.6g}"
        lines = [
            f"{self.n_observations} observations, {self.n_constraints} constraints, "
            f"{self.n_unknowns} unknowns: redundancy {self.redundancy}",
            f"sigma0 {sigma0}; {len(self.iterations)} iterations, {self.stop_reason.value}",
        ]
        lines += [f"  {group}: sum of squares {square:.6g}" for group, square in self.squares.items()]
        columns = self.observations()
        worst = np.argsort(-np.abs(np.nan_to_num(columns["normalised"])))[:SHOWN]
        lines += [f"  {columns['observation'][k]}: {columns['normalised'][k]:+.2f} sigma" for k in worst]
        return "\n".join(lines) + "\n"

    def to_dict(self) -> dict[str, Any]:
        """The whole solution as plain values, versioned; numbers that are not defined are None."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "n_observations": self.n_observations,
            "n_constraints": self.n_constraints,
            "n_unknowns": self.n_unknowns,
            "redundancy": self.redundancy,
            "sigma0": self.sigma0,
            "converged": self.converged,
            "stop_reason": self.stop_reason.value,
            "iterations": [{"sigma0": step.sigma0, "max_step": step.max_step} for step in self.iterations],
            "squares": dict(self.squares),
            "precision": "a priori" if self.variance_factor is None else "a posteriori",
            "unknowns": rows(self.unknowns()),
            "observations": rows(self.observations()),
        }

    def to_json(self) -> str:
        """The same as JSON text, floats at full precision."""
        import json

        return json.dumps(self.to_dict(), ensure_ascii=False, allow_nan=False, indent=1)

    def unknowns(self, package: str | None = None) -> Any:
        """One row per scalar unknown: columns, or a table of "pandas" or "pyarrow" when one is asked for.

        Precisions are NaN when covariances were not asked for; they are a posteriori, or a priori when there
        is no redundancy.
        """
        precisions = None
        if self._cofactors is not None:
            scale = 1.0 if self.variance_factor is None else self.variance_factor
            precisions = np.sqrt(scale * self._cofactors.variances())
        columns = unknown_columns(self.table, self.state, self.frozen, precisions)
        return columns if package is None else as_table(columns, package)

    def observations(self, package: str | None = None) -> Any:
        """One row per scalar residual: columns, or a table of "pandas" or "pyarrow"."""
        parts = ((batch, v, self._weighings[batch]) for batch, v in self._residuals.items())
        columns = observation_columns(parts)
        return columns if package is None else as_table(columns, package)

    @property
    def has_covariances(self) -> bool:
        """Whether covariances were asked for, and are there."""
        return self._cofactors is not None

    @property
    def cofactors(self) -> Cofactors:
        """The inverse of the normal matrix.

        Raises:
            InputError: covariances were not asked for.
            SingularSystemError: the observations hardly determine some unknowns (`weak`).
        """
        if self.weak is not None:
            raise self.weak
        if self._cofactors is None:
            raise InputError("covariances were not asked for: solve(covariance=True)")
        return self._cofactors

    def _solved(self, ids: ArrayLike, what: str) -> IntArray:
        """Ids of blocks of the solved system."""
        blocks = self.table.checked(ids, what)
        is_new = self.table.start[blocks] >= len(self.frozen)
        if is_new.any():
            name = self.table.names[blocks[is_new][0]]
            raise InputError(
                f"{what}: {name!r} was added after this solution and has no part in it; solve again"
            )
        return blocks

    def _factor(self, a_priori: bool) -> float:
        if a_priori:
            return 1.0
        if self.variance_factor is None:
            raise InputError(
                "redundancy 0: the residuals say nothing of the precision; ask for a_priori=True, "
                "which takes the given sigmas as they are"
            )
        return self.variance_factor
