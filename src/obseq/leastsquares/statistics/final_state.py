"""What the statistics of an adjustment read of a solved system: weights, rows of the Jacobian, inverse."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from obseq.arrays import FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.kernels.layout import LANES
from obseq.leastsquares.assembly.clusters import are_few, whitened_rows
from obseq.leastsquares.assembly.evaluation import batch_arrays, whitened_residual_rows
from obseq.leastsquares.assembly.normal_equations import NormalEquations
from obseq.leastsquares.loops.loop_arguments import EquationRows, Present, Span, SparseInverse
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.padding import PADDING, padded_length
from obseq.leastsquares.problem.priors import Prior
from obseq.leastsquares.problem.weights import Weighing, root_weights
from obseq.leastsquares.solution.cofactors import Cofactors
from obseq.leastsquares.solution.result import LeastSquaresResult
from obseq.leastsquares.sparse import Sparse, symmetric
from obseq.leastsquares.system import LeastSquares

OBSERVATIONS_AT_A_TIME = 128 * LANES
"""Observations whose derivatives are in memory together: as many as stay in cache."""


@dataclass(frozen=True, eq=False)
class Alone:
    """One observation as if it were independent of the others: what they are correlated with is taken off.

    Attributes:
        rows: (m, n_free) of the Jacobian, whitened.
        residuals: (m,) whitened.
        whitening: (m, m) U; U' U is its part of the inverse covariance of all observations.
        weight: What a loss leaves of its weight, where that is not in the other parts.
    """

    rows: FloatArray
    residuals: FloatArray
    whitening: FloatArray
    weight: float


@dataclass(frozen=True)
class FinalState:
    """A solved system at its solution, whatever became of the unknowns since.

    Attributes:
        equations: the equations that were solved.
        result: their solution.
        cofactors: the inverse Q of the normal matrix.
    """

    equations: NormalEquations
    result: LeastSquaresResult
    cofactors: Cofactors
    _values: FloatArray = field(repr=False)
    _context: FloatArray = field(repr=False)

    def leverages(self, batch: Batch, crossed: bool = False) -> FloatArray:
        """The products a Q a', with a the row of the Jacobian of an observation divided by its given sigma.

        Returns:
            (n, n_residuals); (n, n_residuals, n_residuals) when `crossed`. Zero for inactive observations.
        """
        from obseq.leastsquares.loops.leverages import leverages

        if batch.clusters is not None:
            return self._cluster_leverages(batch)
        k = batch.shape.n_residuals
        results = np.zeros((batch.n, k * k if crossed else k))
        roles = np.array([(role.row, role.size) for role in batch.shape.roles], dtype=np.int64)
        inverse, given = self._inverse(), self.weighing(batch)
        largest = max(role.size for role in batch.shape.roles)
        block, row = np.empty((largest, largest)), np.empty((k, batch.shape.n_unknowns))
        for first in range(0, batch.n, OBSERVATIONS_AT_A_TIME):
            chosen = slice(first, min(first + OBSERVATIONS_AT_A_TIME, batch.n))
            weights = np.ascontiguousarray(root_weights(given.sigmas[chosen], given.active[chosen]).T)
            starts = np.ascontiguousarray(batch.starts[:, chosen])
            rows = EquationRows(self._derivatives(batch, chosen), weights, starts, roles)
            leverages(rows, inverse, crossed, results[chosen], block, row)
            if self.cofactors.parts.core.size:
                results[chosen] += self._weak_leverages(rows, batch.scalars()[:, chosen], crossed)
        return results.reshape(batch.n, k, k) if crossed else results

    def _weak_leverages(self, rows: EquationRows, scalars: IntArray, crossed: bool) -> FloatArray:
        """(n, n_residuals) a U K U' a', of the second part of Q; (n, n_residuals^2) when `crossed`."""
        parts, (m, n) = self.cofactors.parts, rows.weights.shape
        vectors = np.vstack([parts.vectors, np.zeros(parts.vectors.shape[1])])  # the last: what is frozen
        derivatives = rows.derivatives.reshape(m, -1, n) * rows.weights[:, None]
        moved = np.einsum("mun,unk->nmk", derivatives, vectors[self.equations.free.number[scalars]])
        crossing = moved @ parts.core @ moved.swapaxes(1, 2)
        return np.asarray(crossing.reshape(n, m * m) if crossed else np.diagonal(crossing, axis1=1, axis2=2))

    def weighing(self, batch: Batch) -> Weighing:
        """The sigmas, and what else its residuals were weighed by."""
        return self.result.weighing(batch)

    def whitening(self, batch: Batch, chosen: IntArray | None = None) -> FloatArray:
        """(n, m, m) matrices U with U' U the inverse of the covariance of each observation.

        Args:
            batch: a batch without clusters.
            chosen: (n,) observations; all when None.
        """
        given = self.weighing(batch)
        index = np.arange(batch.n) if chosen is None else chosen
        rows = np.eye(batch.shape.n_residuals)[:, :, None] / given.sigmas[index].T[None]
        return np.ascontiguousarray(given.whitened(rows, index).transpose(2, 0, 1))

    def _inverse(self) -> SparseInverse:
        """The first part of Q as loops read it."""
        pattern = self.equations.pattern
        indices = pattern.indices.astype(np.int32, copy=False)
        values = self.cofactors.parts.values
        return SparseInverse(self.equations.free.number, values, pattern.indptr, indices)

    def cluster_rows(self, batch: Batch) -> Sparse:
        """(n n_residuals, n_free) whitened rows of observations of clusters, or not correlated at all."""
        raw = self._raw_rows(batch, slice(0, batch.n))
        return whitened_rows(self.equations.table, self.equations.free, batch, raw)[0]

    def _cluster_leverages(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) a Q a' of the whitened rows, whose unknowns are all joined in the pattern."""
        rows, parts = self.cluster_rows(batch), self.cofactors.parts
        products = rows.dots(rows @ symmetric(self.equations.pattern, parts.values))
        moved = rows @ parts.vectors
        weak = (moved @ parts.core * moved).sum(axis=1)
        return np.asarray(products + weak).reshape(batch.n, -1)

    def cluster_cofactors(self, rows: Sparse, members: IntArray) -> FloatArray:
        """(k, m, m) products A Q A' of whitened rows, for the rows (k, m) of clusters of one size.

        The unknowns of one cluster are all joined in the pattern.
        """
        pattern, count, parts = self.equations.pattern, members.shape[1], self.cofactors.parts
        moved = (rows @ parts.vectors)[members]
        weak = moved @ parts.core @ moved.swapaxes(1, 2)
        if are_few(rows):
            dense = rows.toarray()[members]
            return np.asarray(weak + dense @ pattern.dense(parts.values) @ dense.swapaxes(1, 2))
        keys = pattern.columns() * pattern.n + pattern.indices
        result = np.empty((len(members), count, count))
        for k, cluster in enumerate(members):
            own = rows.some(cluster)
            columns, place = np.unique(own.columns, return_inverse=True)
            dense = Sparse(own.values, place, own.starts, len(columns)).toarray()
            low = np.minimum.outer(columns, columns).astype(np.int64)
            places = np.searchsorted(keys, low * pattern.n + np.maximum.outer(columns, columns))
            result[k] = weak[k] + dense @ parts.values[places] @ dense.T
        return result

    def prior_leverages(self, prior: Prior) -> FloatArray:
        """(n_scalars,) the same for the equations of a prior; 0 where the unknown is frozen."""
        return np.asarray(self.cofactors.variances()[prior.scalars] * np.square(prior.weights))

    def all_leverages(self) -> list[FloatArray]:
        """(n, n_residuals) leverages of every batch, then (n_scalars, 1) of every prior."""
        of_priors = (self.prior_leverages(prior)[:, None] for prior in self.equations.priors)
        return [*(self.leverages(batch) for batch in self.equations.batches), *of_priors]

    def all_normalised(self) -> list[FloatArray]:
        """Residuals over sigmas, in the order and the shapes of `all_leverages`."""
        result, equations = self.result, self.equations
        of_priors = ((result.prior_residuals(p) * p.weights)[:, None] for p in equations.priors)
        return [*(result.normalised_residuals(b) for b in equations.batches), *of_priors]

    def rows(self, batch: Batch, chosen: ArrayLike) -> FloatArray:
        """(k, n_residuals, n_free) rows of the Jacobian over the sigmas, for a few observations (k,)."""
        index = np.atleast_1d(np.asarray(chosen, dtype=np.int64))
        k, m, u = len(index), batch.shape.n_residuals, batch.shape.n_unknowns
        given = self.weighing(batch)
        weights = root_weights(given.sigmas[index], given.active[index]).T
        weighted = self._derivatives(batch, index).reshape(m, u, k) * weights[:, None, :]
        result = np.zeros((k, m, self.equations.n_unknowns))
        for role, ids in zip(batch.shape.roles, batch.blocks[:, index], strict=True):
            starts = self.equations.table.start[ids]
            columns = self.equations.free.number[starts[:, None] + np.arange(role.size)]
            for row in range(k):
                present = np.flatnonzero(columns[row] >= 0)
                result[row][:, columns[row, present]] += weighted[:, role.row + present, row]
        return result

    def influences(self, batch: Batch, chosen: IntArray) -> FloatArray:
        """(n_free, k) what unit biases of observations (k,) of one residual do to the right-hand side."""
        if batch.clusters is not None:
            return (batch.whitening_matrix().T.some(chosen) @ self.cluster_rows(batch)).toarray().T
        weights = self.weighing(batch).robust_weights()[chosen] * self.whitening(batch, chosen)[:, 0, 0]
        return np.asarray(self.rows(batch, chosen)[:, 0].T * weights)

    def alone(self, batch: Batch, row: int) -> Alone:
        """One active observation of a batch, as what leaving it out, or a bias of it, needs it."""
        if batch.clusters is not None:
            return self._alone_in_cluster(batch, row)
        whiten = self.whitening(batch, np.array([row]))[0]
        residuals = whiten @ self.result.residuals(batch)[row]
        weight = float(self.weighing(batch).robust_weights()[row])
        return Alone(self.rows(batch, [row])[0], residuals, whiten, weight)

    def _alone_in_cluster(self, batch: Batch, row: int) -> Alone:
        """The same of an observation that is correlated with others: P = W' W is the inverse covariance."""
        m, root = batch.shape.n_residuals, batch.whitening_matrix()
        own = root.T.some(np.arange(m * row, m * (row + 1))).toarray().T
        weighted = own.T @ (root @ np.nan_to_num(self.result.residuals(batch)).ravel())
        upper = np.asarray(np.linalg.cholesky(own.T @ own).T, dtype=np.float64)
        rows = (self.cluster_rows(batch).T @ own).T
        solved = np.asarray(np.linalg.solve(upper.T, np.column_stack([rows, weighted])), dtype=np.float64)
        return Alone(solved[:, :-1], solved[:, -1], upper, 1.0)

    def solve(self, rhs: FloatArray) -> FloatArray:
        """Q times right-hand sides (n_free,) or (n_free, k)."""
        return self.cofactors.solve(rhs)

    def quadratic_forms(self, rows: Sparse) -> FloatArray:
        """(k,) b Q b' of the rows b of a sparse matrix (k, n_free)."""
        return self.cofactors.quadratic_forms(rows)

    def all_unknowns(self, free: FloatArray) -> FloatArray:
        """(n_scalars,) from (n_free,): zeros where frozen."""
        result = np.zeros(self.equations.table.n_scalars)
        result[self.equations.free.scalars] = free
        return result

    def _derivatives(self, batch: Batch, chosen: IntArray | slice) -> FloatArray:
        """(n_residuals n_unknowns, k) derivatives of chosen observations (k,), residual by residual."""
        shape = batch.shape
        derivatives = self._raw_rows(batch, chosen)[shape.n_residuals :]
        if batch.is_correlated:
            rows = derivatives.reshape(shape.n_residuals, shape.n_unknowns, -1)
            derivatives = self.weighing(batch).whitened(rows, chosen).reshape(derivatives.shape)
        return np.ascontiguousarray(derivatives)

    def _raw_rows(self, batch: Batch, chosen: IntArray | slice) -> FloatArray:
        """(n_residuals + n_residuals n_unknowns, k) residuals and derivatives of chosen observations (k,)."""
        from obseq.leastsquares.loops.accumulation import evaluate

        shape, (count, padded) = batch.shape, _in_tiles(chosen)
        tile, present = self.equations.tile(batch), Present(self._values, self._context)
        results = np.empty((shape.n_residuals * (1 + shape.n_unknowns), padded_length(count)))
        arrays = batch_arrays(batch)._replace(
            starts=np.ascontiguousarray(batch.starts[:, padded]),
            contexts=np.ascontiguousarray(batch.contexts[:, padded]),
            observations=np.ascontiguousarray(batch.observation_tiles[:, padded]),
            carriers=np.ascontiguousarray(batch.carriers[:, padded]),
        )
        evaluate(shape.kernel(), tile, arrays, Span(0, count), present, len(results), results)
        return results[:, :count]


def _in_tiles(chosen: IntArray | slice) -> tuple[int, IntArray | slice]:
    """The number of observations, and their places with some behind that fill the last tile."""
    if isinstance(chosen, slice):
        count = chosen.stop - chosen.start
        return count, slice(chosen.start, chosen.start + padded_length(count))
    return len(chosen), np.append(chosen, np.repeat(chosen[-1:], -len(chosen) % LANES))


def final_state(system: LeastSquares, result: LeastSquaresResult) -> FinalState:
    """The state that a result describes.

    Raises:
        InputError: covariances were not asked for, or the system or its weights have changed since.
    """
    cofactors, analysis = result.cofactors, system.analysis()
    equations = analysis.equations
    if not analysis.is_of(cofactors):
        raise InputError(
            "equations or unknowns were added, frozen or freed since this result: "
            "solve again with covariance=True"
        )
    _refuse_new_weights(equations, result)
    values = np.append(result.state.values, np.zeros(PADDING))
    context = np.append(result.state.context, np.zeros(PADDING))
    return FinalState(equations, result, cofactors, values, context)


def _refuse_new_weights(equations: NormalEquations, result: LeastSquaresResult) -> None:
    are_alike = all(batch.weighing().is_like(result.weighing(batch)) for batch in equations.batches)
    cost = sum(prior.sum_of_squares(result.state.values) for prior in equations.priors)
    for batch in equations.batches:
        rows = whitened_residual_rows(batch, result.residuals(batch).T) * batch.weights[:, : batch.n]
        cost += float(np.square(rows if batch.active.all() else rows[:, batch.active]).sum())
    if not are_alike or not abs(cost - result.cost) <= 1e-12 + 1e-6 * result.cost:
        raise InputError("weights or sigmas have changed since this result: solve again with covariance=True")
