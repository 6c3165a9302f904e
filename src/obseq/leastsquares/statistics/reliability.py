"""How observations control each other: redundancy numbers, tests of residuals, detectable blunders.

Everything follows from h = a Q a', with a the row of the Jacobian of an observation divided by its sigma and
Q the inverse of the normal matrix: the redundancy number is r = 1 - h, the variance of the residual is
r sigma^2. Where a loss gives a robust weight g, from 0 to 1, r = 1 - g h, and residuals are judged by what
they are against the other observations, v / r, whose variance is (1 + h / r) sigma^2. Only entries of Q on
the pattern of N are needed. Formulas and sources: docs/statistics.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.statistics.final_state import FinalState, final_state
from obseq.leastsquares.statistics.hypothesis_tests import (
    non_centrality,
    normal_critical,
    tau_critical,
)
from obseq.leastsquares.statistics.joint_tests import JointTest, joint_tests, numbered, tests_of_groups
from obseq.leastsquares.statistics.observation_reliability import ObservationReliability
from obseq.leastsquares.statistics.observation_statistics import (
    UNCONTROLLED,
    Numbers,
    correlated_numbers,
    independent_numbers,
    residual_cofactors,
)
from obseq.leastsquares.system import LeastSquares

Given = TypeVar("Given", "Batch", "Prior")


@dataclass(frozen=True)
class LeftOut:
    """What happens when one observation, with all its residuals, is left out; to first order, without refit.

    Attributes:
        label: the observation.
        residuals: (n_residuals,) its residuals against the unknowns that the other observations give, less
            what those that it is correlated with let expect of them.
        change: (n_scalars,) what is added to all unknowns, zero where frozen; `Reliability.change_of` picks
            blocks.
        cost: sum of weighted squared residuals of the others.
    """

    label: str
    residuals: FloatArray
    change: FloatArray
    cost: float


@dataclass(frozen=True)
class Reliability:
    """The quality of all observations of an adjustment.

    Attributes:
        observations: one record per batch, in order of addition.
        constraints: one record per prior.
        level: level of the single test behind the detectable biases.
        power: its power.
        non_centrality: delta_0, the shift of w that the test finds with that power.
        redundancy: redundancy of the adjustment; the redundancy numbers sum up to it.
        sigma0: square root of the variance factor, which scales tau; None with redundancy 0.
    """

    observations: tuple[ObservationReliability[Batch], ...]
    constraints: tuple[ObservationReliability[Prior], ...]
    level: float
    power: float
    non_centrality: float
    redundancy: int
    sigma0: float | None
    _state: FinalState = field(repr=False)

    @property
    def all(self) -> tuple[ObservationReliability[Batch | Prior], ...]:
        """Batches, then priors."""
        return self.observations + self.constraints

    @property
    def sum_of_redundancy_numbers(self) -> float:
        """Equal to `redundancy` up to rounding: a check of the whole computation.

        What a loss leaves no weight counts in neither.
        """
        weighings = (self._state.result.weighing(part.source) for part in self.observations)
        weighed = [weighing.robust_weights() > 0.0 for weighing in weighings]
        rows = zip(self.observations, weighed, strict=True)
        found = sum(np.nansum(part.redundancy[counts]) for part, counts in rows)
        return float(found + sum(np.nansum(part.redundancy) for part in self.constraints))

    @property
    def n_tests(self) -> int:
        """Number of scalar equations whose residual can be tested."""
        return sum(int(np.count_nonzero(part.controlled)) for part in self.all)

    @property
    def w_critical(self) -> float:
        """Limit of `|w|` at the level of the analysis."""
        return normal_critical(self.level)

    @property
    def tau_critical(self) -> float:
        """Limit of `|tau|` at the level of the analysis."""
        return tau_critical(self.level, self.redundancy)

    def of(self, source: Batch | Prior) -> ObservationReliability[Batch | Prior]:
        """The record of one batch or prior."""
        for part in self.all:
            if part.source is source:
                return part
        raise InputError("this batch or prior was not part of the solved system")

    def uncontrolled(self) -> tuple[str, ...]:
        """Names of active observations that nothing controls: w is undefined, any blunder goes unseen."""
        return tuple(
            part.label(int(row))
            for part in self.all
            for row in np.flatnonzero((part.active & ~part.controlled).any(axis=1))
        )

    @property
    def state(self) -> FinalState:
        """The solved system behind the numbers."""
        return self._state

    def residual_cofactors(self, batch: Batch) -> FloatArray:
        """(n, n_residuals, n_residuals) cofactors of residual vectors, in squared units of residuals."""
        leverages = self._state.leverages(batch, crossed=True)
        given = self._state.weighing(batch)
        whitened = residual_cofactors(leverages, given.robust_weights())
        colour = np.linalg.inv(self._state.whitening(batch))
        cofactors = colour @ whitened @ np.swapaxes(colour, 1, 2)
        cofactors[~given.active] = np.nan
        return np.asarray(cofactors)

    def effect_of_bias(
        self, batch: Batch, row: int, component: int = 0, bias: float | None = None
    ) -> FloatArray:
        """(n_scalars,) what a bias of one observed value does to all unknowns, by a solve.

        Args:
            batch: the batch of the observation.
            row: its row.
            component: which of its residuals.
            bias: in the unit of the observation (observed too large); the detectable bias when None.
        """
        if bias is None:
            bias = float(self.of(batch).detectable[row, component])
        if not np.isfinite(bias):
            raise InputError(f"{batch.label(row)}: nothing controls this observation; give the bias")
        own = self._state.alone(batch, row)
        weighted = bias * own.weight * own.whitening[:, component]
        return self._unknowns(self._state.solve(weighted @ own.rows))

    def left_out(self, batch: Batch, row: int) -> LeftOut:
        """What remains when one observation is left out, by a solve; of first order when not linear.

        Raises:
            InputError: the observation is inactive, or the others do not determine the unknowns without it.
        """
        if not self._state.weighing(batch).active[row]:
            raise InputError(f"{batch.label(row)}: the observation is not active, it is left out already")
        own = self._state.alone(batch, row)
        solved = self._state.solve(np.ascontiguousarray(own.rows.T))
        remaining = np.eye(len(own.rows)) - own.weight * (own.rows @ solved)
        if np.linalg.eigvalsh(remaining)[0] < UNCONTROLLED:
            raise InputError(f"{batch.label(row)}: without this observation some unknowns are undetermined")
        predicted = np.linalg.solve(remaining, own.residuals)
        cost = self._state.result.cost - own.weight * float(own.residuals @ predicted)
        change = self._unknowns(solved @ (own.weight * predicted))
        return LeftOut(batch.label(row), np.linalg.solve(own.whitening, predicted), change, cost)

    def change_of(self, ids: ArrayLike, change: FloatArray) -> FloatArray:
        """(n, k) the part of a change of all unknowns that concerns blocks that are alike."""
        return np.asarray(change[self._state.equations.table.scalars(ids)])

    def to_dict(self) -> dict[str, object]:
        """Levels, sums and one table per batch and prior."""
        return {
            "level": self.level,
            "power": self.power,
            "redundancy": self.redundancy,
            "sigma0": self.sigma0,
            "uncontrolled": list(self.uncontrolled()),
            "observations": [_titled(part) for part in self.observations],
            "constraints": [_titled(part) for part in self.constraints],
        }

    def _unknowns(self, free: FloatArray) -> FloatArray:
        return self._state.all_unknowns(free)


def reliability(
    system: LeastSquares,
    result: LeastSquaresResult,
    level: float = 0.001,
    power: float = 0.80,
    groups: Mapping[Batch, Sequence[IntArray]] | None = None,
) -> Reliability:
    """The quality of all observations of a solved system, from its final weights.

    Args:
        system: the system, as it was when solved.
        result: its solution, with covariances asked for.
        level: level of the single test behind the detectable biases.
        power: its power.
        groups: by batch, rows that are tested as one observation too, such as the components of a vector: of
            observations of one residual each, that have the same unknowns or a covariance of the whole batch.

    Raises:
        InputError: covariances were not asked for, or the system changed since.
    """
    state, shift = final_state(system, result), non_centrality(level, power)
    sigma0 = None if result.variance_factor is None else float(np.sqrt(result.variance_factor))
    named = groups or {}
    measured = tuple(
        _of_batch(state, batch, shift, sigma0, named.get(batch, ())) for batch in state.equations.batches
    )
    priors = tuple(_of_prior(state, prior, shift, sigma0) for prior in state.equations.priors)
    return Reliability(measured, priors, level, power, shift, result.redundancy, sigma0, state)


def _of_batch(
    state: FinalState, batch: Batch, shift: float, sigma0: float | None, groups: Sequence[IntArray]
) -> ObservationReliability[Batch]:
    given = state.weighing(batch)
    residuals, weights = state.result.residuals(batch), given.robust_weights()
    joint: tuple[JointTest, ...] = ()
    if batch.clusters is not None:
        sigmas = np.sqrt(batch.clusters.variances()).reshape(residuals.shape)
        numbers, joint = _of_clusters(state, batch, residuals, groups)
    elif batch.roots.size:
        roots = state.whitening(batch)
        numbers = correlated_numbers(residuals, roots, state.leverages(batch, crossed=True), weights)
        sigmas = np.linalg.norm(np.linalg.inv(roots), axis=2)
    else:
        sigmas = given.sigmas
        numbers = independent_numbers(residuals, sigmas, state.leverages(batch), weights[:, None])
        joint = tuple(tests_of_groups(state, batch, residuals, groups)) if groups else ()
    active = np.broadcast_to(given.active[:, None], residuals.shape)
    return _record(state, batch, residuals, sigmas, numbers, active, shift, sigma0, joint)


def _of_clusters(
    state: FinalState, batch: Batch, residuals: FloatArray, groups: Sequence[IntArray]
) -> tuple[Numbers, tuple[JointTest, ...]]:
    """The numbers of observations that are correlated with one another: a cluster is as one observation."""
    if batch.clusters is None:
        raise InputError(f"{batch.name}: its observations are not correlated with one another")
    rows, m = state.cluster_rows(batch), batch.shape.n_residuals
    group_of = numbered(groups, residuals.size)
    joint: list[JointTest] = []
    found = [np.full(residuals.size, np.nan) for _ in fields(Numbers)]
    found[1] = np.zeros(residuals.size, dtype=bool)
    for members in batch.clusters.alike(np.repeat(batch.active, m)):
        roots, leverages = batch.cluster_roots(members), state.cluster_cofactors(rows, members)
        numbers = correlated_numbers(residuals.ravel()[members], roots, leverages, np.ones(len(members)))
        joint += joint_tests(members, group_of[members], roots, residuals.ravel()[members], leverages)
        for column, entry in zip(found, fields(Numbers), strict=True):
            column[members] = getattr(numbers, entry.name)
    return Numbers(*(column.reshape(residuals.shape) for column in found)), tuple(joint)


def _of_prior(
    state: FinalState, prior: Prior, shift: float, sigma0: float | None
) -> ObservationReliability[Prior]:
    residuals, sigmas = state.result.prior_residuals(prior)[:, None], 1.0 / prior.weights[:, None]
    leverages = state.prior_leverages(prior)[:, None]
    numbers = independent_numbers(residuals, sigmas, leverages, np.ones_like(sigmas))
    return _record(state, prior, residuals, sigmas, numbers, np.ones_like(numbers.controlled), shift, sigma0)


def _record(
    state: FinalState,
    source: Given,
    residuals: FloatArray,
    sigmas: FloatArray,
    numbers: Numbers,
    active: BoolArray,
    shift: float,
    sigma0: float | None,
    joint: tuple[JointTest, ...] = (),
) -> ObservationReliability[Given]:
    controlled = numbers.controlled & active
    missing = np.where(active, np.inf, np.nan)
    w = np.where(controlled, numbers.left_out / numbers.spread, np.nan)
    detectable = shift * numbers.spread
    return ObservationReliability(
        source,
        residuals,
        sigmas,
        np.where(active, numbers.redundancy, np.nan),
        controlled,
        w,
        w / sigma0 if sigma0 else np.full_like(w, np.nan),
        np.where(controlled, detectable, missing),
        np.where(controlled, numbers.left_out, np.nan),
        np.where(controlled, numbers.effect * detectable, missing),
        state.result.redundancy,
        joint,
    )


def _titled(part: ObservationReliability[Batch | Prior]) -> Mapping[str, object]:
    return {"group": part.source.group, **part.columns()}
