"""A model linearised at a place of its unknowns: what every test of a hypothesis reads.

The residuals v0 and the rows A are those of all equations at that place, divided by their sigmas. The place
need not be the least-squares solution. For an error C g of the observations T = u' M^-1 u is exact in g, be
it large, where the place is near the solution without the error: A and v0 are those of the truth there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from obseq.arrays import FloatArray
from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.leastsquares import Batch, LeastSquares, LeastSquaresResult
from obseq.leastsquares.assembly.clusters import whitening_of
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.solvers.base import forms_by_solves
from obseq.leastsquares.sparse import Sparse, on_diagonal, stacked, symmetric
from obseq.leastsquares.statistics.final_state import FinalState, final_state

_AT_A_TIME = 64
"""Right-hand sides that are solved together: as many as stay in cache."""


@dataclass(frozen=True, eq=False)
class Linear:
    """All equations of a model at a place.

    Attributes:
        residuals: (n,) v0, whitened: computed minus observed over sigmas.
        rows: (n, u) A, whitened.
        whitening: (n, n) from residuals in their units to whitened ones.
        inverse: Gives (u, u) Q on the pattern of the normal matrix, which few tests ask for.
        taken: (n, n) blocks of A Q A', one for each observation; all their entries are stored;
            dense where A is.
        solve: Q times right-hand sides (u,) or (u, k).
        redundancy: Degrees of freedom.
        forms: b Q b' (k,) of the rows b of a sparse matrix (k, u); by solves when None.
    """

    residuals: FloatArray
    rows: Sparse | FloatArray
    whitening: Sparse | FloatArray
    inverse: Callable[[], Sparse | FloatArray]
    taken: Sparse | FloatArray
    solve: Callable[[FloatArray], FloatArray]
    redundancy: int
    forms: Callable[[Sparse], FloatArray] | None = None

    @property
    def n(self) -> int:
        """How many equations there are."""
        return len(self.residuals)

    @cached_property
    def cofactors(self) -> Sparse | FloatArray:
        """(u, u) Q on the pattern of the normal matrix."""
        return self.inverse()

    def back(self, vectors: FloatArray) -> FloatArray:
        """(u,) or (u, k) A' times vectors (n,) or (n, k)."""
        if isinstance(self.rows, np.ndarray):
            return np.ascontiguousarray(self.rows.T @ vectors)
        return self.rows.transposed_times(vectors)

    def lost(self, rows: Sparse) -> FloatArray:
        """(k,) b Q b' of the rows b of a sparse matrix (k, u)."""
        if self.forms is not None:
            return self.forms(rows)
        return forms_by_solves(self.solve, rows.shape[1], rows.values, rows.columns, rows.starts)

    def left(self, vectors: FloatArray) -> FloatArray:
        """R times vectors (n,) or (n, k): what the unknowns do not take of them."""
        if not self.rows.shape[1]:
            return vectors
        if vectors.ndim == 1:
            return np.asarray(vectors - self.rows @ self.solve(self.back(vectors)))
        result = np.empty_like(vectors)
        for first in range(0, vectors.shape[1], _AT_A_TIME):
            part = vectors[:, first : first + _AT_A_TIME]
            result[:, first : first + _AT_A_TIME] = part - self.rows @ self.solve(self.back(part))
        return result


def linearised(
    system: LeastSquares, result: LeastSquaresResult, batches: Sequence[Batch], *, dense: bool = False
) -> Linear:
    """The equations of some batches at a result with covariances; inactive ones are rows of zeros.

    Args:
        system: It was solved, or evaluated (`max_iterations=0`), without losses.
        result: What came out, with covariances.
        batches: All batches that count, in the order in which hypotheses number their equations.
        dense: Whether matrices are few, and to be plain arrays: for small models, without clusters.
    """
    if not batches or not result.n_unknowns:
        return _of_nothing(result, batches)
    state = final_state(system, result)
    if dense:
        return _densely(state, result, batches)
    roots = [whitening_of(batch) for batch in batches]
    raw = [np.where(batch.active[:, None], np.nan_to_num(result.residuals(batch)), 0.0) for batch in batches]
    return Linear(
        np.concatenate([root @ one.ravel() for root, one in zip(roots, raw, strict=True)]),
        stacked([state.cluster_rows(batch) for batch in batches]),
        on_diagonal(roots),
        partial(symmetric, state.equations.pattern, state.cofactors.values),
        on_diagonal([taken_of(state, batch) for batch in batches]),
        state.solve,
        result.redundancy,
        state.quadratic_forms,
    )


def with_priors(
    linear: Linear, system: LeastSquares, result: LeastSquaresResult, priors: Sequence[Prior]
) -> Linear:
    """The same with the equations of observed unknowns after those of the batches."""
    if not priors:
        return linear
    state = final_state(system, result)
    weights = np.concatenate([prior.weights for prior in priors])
    columns = state.equations.free.number[np.concatenate([prior.scalars for prior in priors])]
    free = np.flatnonzero(columns >= 0)
    off = np.concatenate([result.prior_residuals(prior) for prior in priors])
    own = [Sparse.of_diagonal(state.prior_leverages(prior)) for prior in priors]
    shape = len(weights), linear.rows.shape[1]
    rows = Sparse.of_entries(weights[free], free, columns[free], shape)
    before, whitening, taken = (cast("Sparse", m) for m in (linear.rows, linear.whitening, linear.taken))
    return replace(
        linear,
        residuals=np.append(linear.residuals, weights * off),
        rows=stacked([before, rows]),
        whitening=on_diagonal([whitening, Sparse.of_diagonal(weights)]),
        taken=on_diagonal([taken, *own]),
    )


def _densely(state: FinalState, result: LeastSquaresResult, batches: Sequence[Batch]) -> Linear:
    """The same as plain arrays, of observations that are not correlated."""
    weights = np.concatenate([batch.weights[:, : batch.n].T.ravel() for batch in batches])
    raw = [np.where(batch.active[:, None], np.nan_to_num(result.residuals(batch)), 0.0) for batch in batches]
    rows = [state.rows(batch, np.arange(batch.n)) for batch in batches]
    rows = [
        np.where(b.active[:, None, None], one, 0.0).reshape(-1, one.shape[2])
        for b, one in zip(batches, rows, strict=True)
    ]
    matrix = np.concatenate(rows)
    cofactors = state.equations.pattern.dense(state.cofactors.values)
    return Linear(
        weights * np.concatenate([one.ravel() for one in raw]),
        matrix,
        np.diag(weights),
        lambda: cofactors,
        np.diag(np.einsum("ij,ij->i", matrix @ cofactors, matrix)),
        state.solve,
        result.redundancy,
    )


def _of_nothing(result: LeastSquaresResult, batches: Sequence[Batch]) -> Linear:
    """Equations without any unknown: residuals alone."""
    roots = [whitening_of(batch) for batch in batches]
    raw = [np.nan_to_num(result.residuals(batch)).ravel() for batch in batches]
    residuals = [root @ one for root, one in zip(roots, raw, strict=True)]
    values = np.concatenate([np.zeros(0), *residuals])
    none, nothing = Sparse.of_dense(np.zeros((len(values), 0))), Sparse.of_diagonal(np.zeros(len(values)))
    empty = partial(on_diagonal, [])
    return Linear(values, none, on_diagonal(roots), empty, nothing, np.asarray, result.redundancy)


def taken_of(state: FinalState, batch: Batch) -> Sparse:
    """(n m, n m) what the unknowns take of the observations of a batch: blocks (m, m) of A Q A'.

    Of observations that are correlated with others only the diagonal.
    """
    if batch.clusters is not None:
        return Sparse.of_diagonal(state.leverages(batch).ravel())
    return Sparse.of_blocks(state.leverages(batch, crossed=True))
