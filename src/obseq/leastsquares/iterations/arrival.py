"""When an iteration has arrived: one theory for all strategies (docs/statistics.md, "When iterations end").

A step dx has the length L = sqrt(dx' N dx): no unknown, and no function of unknowns, moves by more than L of
its a-priori standard deviations. That of Gauss-Newton is the norm of the part of the residuals that unknowns
could still take away, whatever their units (the relative offset of Bates and Watts, 1981). It has arrived
when it says nothing any more: to the statistician, or to the computer.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.kernels.layout import LANES
from obseq.leastsquares.assembly.evaluation import jacobian_rows
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.unknowns import UnknownTable
from obseq.leastsquares.solution.result import StopReason

EPS = float(np.finfo(np.float64).eps)

NEGLIGIBLE = 1e-2
"""Share of a standard deviation, and..."""

FINE = 1e-6
"""...share of the unknowns themselves below which a step that does not shrink is looked at: is it noise?"""

CONTRACTION = 0.7
"""Share of the step before it below which a step shrinks as it should."""

LAST_DIGITS = 1e7 * EPS
"""Share of the largest unknown within which steps remain that are rounding, of formulas that cancel, too."""

DIGITS = 4.0
"""Times its own rounding that a gradient may be, and tell nothing."""

SHARES = (0.1, 0.01, 0.001)
"""Shares of a step along which rounding is told from what bends."""

LONG = (1.0, 0.618, 0.382)
"""Shares of a step that is as long as is negligible: so far apart that chance is not the same on them."""

FALLING = 1e-6, 1e-2
"""Shares of what was found along a step ten times as long between which that was a bend.

A bend falls to a thousandth. The rounding of a single residual falls to less than a hundredth by chance, in
one of two hundred cases, or to nothing where the step is lost in the last digits.
"""

NOISY = 3.0
"""Multiple of the rounding of the residuals below which a step that does not shrink is made of it."""


@dataclass(frozen=True)
class Options:
    """When to stop, and what to count.

    Attributes:
        max_iterations: no more iterations than this.
        tolerance: the iterations end when a step, or all steps to come together, are shorter than
            `tolerance * sigma0` in the metric of the normal matrix: then no unknown moves by more than
            `tolerance` of its own a-posteriori standard deviation. Negative: all iterations are done.
        sigma0_groups: groups whose residuals make the numerator of sigma0; None for all.
    """

    max_iterations: int = 20
    tolerance: float = 1e-6
    sigma0_groups: Collection[str] | None = None


class Arrival:
    """Judges the Gauss-Newton steps of one solution, in their order."""

    def __init__(self, equations: NormalEquations, tolerance: float) -> None:
        self._equations = equations
        self._tolerance = tolerance
        self._first_cost: float | None = None
        self._previous = np.inf
        self._in_a_row: tuple[float, ...] = ()
        self._rough = np.inf

    def unit(self, cost: float, redundancy: int) -> float:
        """What steps are compared with: sigma0; without redundancy the first misfit, at most 1."""
        if self._first_cost is None:
            self._first_cost = cost
        if redundancy > 0:
            return math.sqrt(cost / redundancy)
        return min(1.0, math.sqrt(self._first_cost))

    def reach(self, cost: float, redundancy: int, weights: FloatArray) -> float:
        """Length below which a step has arrived without further questions; `weights` as of `resolution`."""
        resolved = resolution(self._equations.table, weights)
        return max(self._tolerance * self.unit(cost, redundancy), resolved)

    def reason(
        self, step: FloatArray, length: float, cost: float, redundancy: int, weights: FloatArray
    ) -> StopReason | None:
        """Why the iterations end with this step (n_scalars,); None when they go on."""
        unit = self.unit(cost, redundancy)
        shrinks = length <= CONTRACTION * self._previous
        self._previous = length
        self._in_a_row = (*self._in_a_row[-2:], length)
        if self._tolerance < 0.0:
            return None
        if min(length, self._to_come()) <= self._tolerance * unit:
            return StopReason.STEP
        resolved = resolution(self._equations.table, weights)
        if length <= resolved and self._may_be_rounding(step, length, unit):
            return StopReason.ROUNDING
        if not shrinks and self.is_rounding(step, length, cost, redundancy, weights):
            return StopReason.ROUNDING
        return None

    def interrupt(self) -> None:
        """The last step was not taken as it was: what comes next does not follow from it."""
        self._in_a_row = ()

    def _to_come(self) -> float:
        """How long all steps after this one are together, at most; infinite where that is not known.

        Near a minimum Gauss-Newton steps shrink by rates that grow towards the largest eigenvalue q of the
        curvature that linearisations do not know. The larger of the last two stands for it. Hard constraints
        are not in the length of a step: they are met by the steps themselves.
        """
        if len(self._in_a_row) < 3 or not all(self._in_a_row) or self._equations.constraints:
            return np.inf
        first, second, last = self._in_a_row
        rate = max(second / first, last / second)
        return last * rate / (1.0 - rate) if rate < 1.0 else np.inf

    def is_rounding(
        self, step: FloatArray, length: float, cost: float, redundancy: int, weights: FloatArray
    ) -> bool:
        """Whether a step that does not shrink, or brings nothing, is made of the rounding of residuals."""
        if self._tolerance < 0.0:
            return False
        resolved = resolution(self._equations.table, weights)
        unit = self.unit(cost, redundancy)
        small = length <= max(NEGLIGIBLE * unit, FINE / EPS * resolved)
        may_be = small and self._may_be_rounding(step, length, unit)
        return may_be and self._is_within_roughness(step, length, unit)

    def _may_be_rounding(self, step: FloatArray, length: float, unit: float) -> bool:
        """Whether no unknown moves beyond its last digits, by a step that is not short anyway.

        One unknown that is known absurdly well, of a point at the very centre of a camera, would hide that
        all others still move. Unknowns that hang together closely, as coefficients of a polynomial do, may
        move further, by a gradient that is all rounding.
        """
        if length <= NEGLIGIBLE * unit:
            return True
        largest = float(np.abs(sizes_of(self._equations.table)).max())
        return float(np.abs(step).max()) <= LAST_DIGITS * largest or is_balanced(self._equations)

    def _is_within_roughness(self, step: FloatArray, length: float, unit: float) -> bool:
        """Whether a step is made of the rounding of the residuals, measured anew when it may have fallen."""
        if length > NOISY * self._rough:
            return False
        self._rough = 0.0
        for way in _ways(step, length, unit):
            self._rough = max(self._rough, roughness(self._equations, way))
            if length <= NOISY * self._rough:
                return True
        return False


def _ways(step: FloatArray, length: float, unit: float) -> Iterator[FloatArray]:
    """A step, and some nearly as long as is negligible: along these rounding is looked for.

    A residual that has few digits, such as a latitude in radians, does not change at all on a short way, and
    on a longer one four places may agree by chance.
    """
    yield step
    if 0.0 < length < NEGLIGIBLE * unit:
        for share in LONG:
            yield step * (share * NEGLIGIBLE * unit / length)


def resolution(table: UnknownTable, weights: FloatArray) -> float:
    """Length of a step that is the last digit of every unknown: eps sqrt(sum of N_jj x_j^2).

    Args:
        table: the unknowns.
        weights: (n_scalars,) diagonal of N, 0 where frozen.
    """
    return EPS * math.sqrt(weights @ np.square(sizes_of(table)))


def sizes_of(table: UnknownTable) -> FloatArray:
    """(n_scalars,) what the digits of a step are compared with: values; 1 for rotations and directions."""
    if not table.curved:
        return table.values
    sizes = table.values.copy()
    for blocks in table.curved:
        sizes[blocks.scalars] = 1.0
    return sizes


def is_balanced(equations: NormalEquations) -> bool:
    """Whether the gradient is made of the rounding of the residuals, for each unknown."""
    table = equations.table
    pulls, noise = np.zeros((2, table.n_scalars))
    for prior in equations.priors:
        weights = np.square(prior.weights)
        np.add.at(pulls, prior.scalars, prior.residuals(table.values) * weights)
        np.add.at(noise, prior.scalars, np.square(_digits_of(table, prior) * weights))
    for batch in equations.batches:
        if batch.clusters is not None:
            return False
        scalars = batch.scalars()
        for residual, weight, derivatives, digits in _rounded(table, batch):
            np.add.at(pulls, scalars, derivatives * (weight * residual))
            np.add.at(noise, scalars, np.square(derivatives * (weight * digits)))
    return bool((np.abs(pulls) <= DIGITS * EPS * np.sqrt(noise))[~table.frozen].all())


def rounding_of_sum(equations: NormalEquations) -> float:
    """Share of a sum of squares that its additions lose: three standard deviations, 16 eps at least.

    The sums of n tiles are added one after the other. Each addition rounds the sum so far, evenly within
    eps/2 of it: that is eps sqrt(n) / 6 in the end.
    """
    tiles = sum(batch.n for batch in equations.batches) / LANES
    return EPS * max(16.0, 0.5 * math.sqrt(tiles))


def rounding_of_cost(equations: NormalEquations) -> float:
    """What the rounding of the residuals makes of the sum of squares; those of clusters are left out."""
    table, squares = equations.table, 0.0
    for prior in equations.priors:
        lost = prior.residuals(table.values) * np.square(prior.weights) * _digits_of(table, prior)
        squares += float(lost @ lost)
    for batch in equations.batches:
        if batch.clusters is None:
            for residual, weight, _, digits in _rounded(table, batch):
                lost = weight * residual * digits
                squares += float(lost @ lost)
    return 2.0 * DIGITS * EPS * math.sqrt(squares)


def _digits_of(table: UnknownTable, prior: Prior) -> FloatArray:
    """(n,) what the digits of the residuals of a prior are compared with."""
    return np.maximum(np.abs(sizes_of(table)[prior.scalars]), np.abs(prior.values))


def _rounded(
    table: UnknownTable, batch: Batch
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Each residual of a batch (n,), its weight (n,), derivatives (n_unknowns, n), rounding over eps (n,).

    A residual with derivatives a is rounded by about eps |a| |x|, x the unknowns that it has.
    """
    m, count, sizes = batch.shape.n_residuals, batch.shape.n_unknowns, np.abs(sizes_of(table))
    rows, own = jacobian_rows(table, batch), sizes[batch.scalars()]
    weights = np.where(batch.active, np.square(batch.weights[:, : batch.n]), 0.0)
    for residual, weight, derivatives in zip(rows[:m], weights, rows[m:].reshape(m, count, -1), strict=True):
        counts = weight > 0.0
        if not counts.all():
            residual, derivatives = np.where(counts, residual, 0.0), np.where(counts, derivatives, 0.0)
        yield residual, weight, derivatives, np.einsum("kn,kn->n", np.abs(derivatives), own)


def roughness(equations: NormalEquations, step: FloatArray) -> float:
    """Norm of the rounding of the weighted residuals along a step; see `rounding_along`."""
    norm = float(np.linalg.norm(rounding_along(equations, step)))
    return norm if np.isfinite(norm) else 0.0


def rounding_along(equations: NormalEquations, step: FloatArray) -> FloatArray:
    """(m,) rounding of each weighted residual, from third differences along a step and shares of it.

    Of a smooth residual these fall with the cube of the share, of one that is bent too. What does not fall is
    what the formulas lose inside, and what the unknowns themselves cannot hold.
    """
    found = _third_differences(equations, step)
    for share in SHARES:
        less = _third_differences(equations, share * step)
        before, now = (float(np.linalg.norm(vector)) for vector in (found, less))
        if not FALLING[0] * before < now < FALLING[1] * before:
            break
        found = less
    return found


def _third_differences(equations: NormalEquations, step: FloatArray) -> FloatArray:
    """(m,) of the weighted residuals along a step, divided by what independent rounding multiplies by."""
    table = equations.table
    start = table.state()
    found = np.zeros(1)
    try:
        for share, times in ((0.0, 1.0), (1.0 / 3.0, -3.0), (2.0 / 3.0, 3.0), (1.0, -1.0)):
            table.restore(start)
            table.move(share * step)
            found = found + times * equations.weighted_residuals()
    finally:
        table.restore(start)
    return np.asarray(found / np.sqrt(20.0))
