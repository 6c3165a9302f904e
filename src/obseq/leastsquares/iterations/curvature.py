"""What large residuals add to the curvature of the sum of squares, learnt from the gradients along the way.

The sum of squares has the second derivatives N + S, S the sum of each residual times its own second
derivatives. Gauss-Newton leaves S out; where residuals stay large, its steps then swing or creep. What a step
dx has changed of the gradient tells (N + S) dx (Dennis, Gay and Welsch, An adaptive nonlinear least-squares
algorithm, 1981: their update and their sizing; of S the largest components are kept).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from obseq.arrays import FloatArray
from obseq.leastsquares.assembly.linearisation import Linearisation
from obseq.leastsquares.assembly.normal_equations import NormalEquations

COMPONENTS = 6
"""Most components of S that are kept."""

CLEARLY = 0.5
"""Share of Gauss-Newton's error in foretelling the last decrease below which S foretold it better."""

ACROSS = 1e-10
"""Cosine between a step and the change of the gradient below which it tells nothing."""


RESIDUAL = 0.2
"""Share of the cost that Gauss-Newton may still promise to remove where residuals are what is left."""


class _Place(NamedTuple):
    """Free unknowns at a linearisation; what multiplies by N there, the gradient and the sum of squares."""

    unknowns: FloatArray
    times: Callable[[FloatArray], FloatArray]
    gradient: FloatArray
    cost: float


def curvature_of(equations: NormalEquations) -> Curvature | None:
    """What is known of the curvature at first: nothing; None where gradients at two places do not compare.

    All unknowns are to be in the matrix and none curved, as rotations are; no loss changes the weights.
    """
    whole = equations.n_unknowns == equations.pattern.n and not equations.constraints
    flat = equations.table.is_flat and not equations.viscosities
    is_smooth = whole and flat and all(batch.loss is None for batch in equations.batches)
    return Curvature() if is_smooth else None


class Curvature:
    """S = V diag(s) V', of few components."""

    def __init__(self) -> None:
        self._is_better = False
        self._last: _Place | None = None
        self._vectors, self._sizes = np.zeros((0, 0)), np.zeros(0)

    def learn(self, equations: NormalEquations, linearisation: Linearisation, scale: FloatArray) -> None:
        """Learns from the way between the last place and this one.

        Args:
            equations: the system, at its current values.
            linearisation: its undamped linearisation there.
            scale: (n,) the diagonal of N, or the largest so far: the metric in which components are large.
        """
        times = partial(equations.pattern.product, linearisation.values.copy())
        values = equations.table.values[equations.free.scalars]
        last, place = self._last, _Place(values, times, linearisation.gradient, linearisation.cost)
        self._last = place
        if last is None:
            self._vectors = np.zeros((len(scale), 0))
            return
        step, change = place.unknowns - last.unknowns, place.gradient - last.gradient
        expected = last.times(step)
        self._judge(step, -float((2.0 * last.gradient + expected) @ step), last.cost - place.cost)
        self._update(step, change, change - expected, np.sqrt(scale))

    def _judge(self, step: FloatArray, plain: float, decrease: float) -> None:
        """Whether S foretold the last decrease, and clearly better than N alone (`plain`)."""
        own = float(step @ self.times(step))
        self._is_better = own != 0.0 and abs(plain - own - decrease) < CLEARLY * abs(plain - decrease)

    def is_trusted(self, length: float, cost: float) -> bool:
        """Whether to use S where Gauss-Newton's step has this length and the sum of squares this size."""
        return self._is_better and length**2 <= RESIDUAL * cost

    def correcting(
        self, solve: Callable[[FloatArray], FloatArray]
    ) -> Callable[[FloatArray], FloatArray] | None:
        """Solutions with A + S from those with a positive definite A; None where A + S is not."""
        across = solve(np.ascontiguousarray(self._vectors))
        core = np.diag(1.0 / self._sizes) + self._vectors.T @ across
        if np.count_nonzero(np.linalg.eigvalsh(core) > 0.0) != np.count_nonzero(self._sizes > 0.0):
            return None
        share = np.linalg.solve(core, across.T)

        def bent(right: FloatArray) -> FloatArray:
            plain = solve(right)
            return np.asarray(plain - across @ (share @ right))

        return bent

    def times(self, step: FloatArray) -> FloatArray:
        """(n,) S times a step (n,)."""
        return np.asarray(self._vectors @ (self._sizes * (self._vectors.T @ step)))

    def _update(self, step: FloatArray, change: FloatArray, seen: FloatArray, root: FloatArray) -> None:
        """Makes S dx what was seen, and S no larger than that along the step (DFP, with sizing)."""
        along, size = float(change @ step), float(step @ self.times(step))
        if not along > ACROSS * float(np.linalg.norm(change / root) * np.linalg.norm(step * root)):
            return
        if size != 0.0:
            self._sizes = self._sizes * min(1.0, abs(float(step @ seen)) / abs(size))
        rest, known = seen - self.times(step), len(self._sizes)
        core = np.zeros((known + 2, known + 2))
        core[range(known), range(known)] = self._sizes
        core[known, known + 1] = core[known + 1, known] = 1.0 / along
        core[known + 1, known + 1] = -float(rest @ step) / along**2
        basis, parts = np.linalg.qr(np.column_stack([self._vectors, rest, change]) / root[:, None])
        self._keep(basis, parts @ core @ parts.T, root)

    def _keep(self, basis: FloatArray, core: FloatArray, root: FloatArray) -> None:
        """Keeps the largest components of S = R basis core basis' R, R the scale's root."""
        sizes, turned = np.linalg.eigh(core)
        order = np.argsort(-np.abs(sizes))[:COMPONENTS]
        kept = order[np.abs(sizes[order]) > 1e-12 * np.abs(sizes).max(initial=0.0)]
        self._vectors, self._sizes = (basis @ turned[:, kept]) * root[:, None], sizes[kept]
