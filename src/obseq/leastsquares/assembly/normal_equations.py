"""Normal equations of a set of batches and priors: assembled at the current values, refilled in place."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.cached import cached_property
from obseq.compilation.loops import HAS_BUILTINS
from obseq.errors import DivergenceError
from obseq.leastsquares.assembly.clusters import add_cluster, whitened_rows
from obseq.leastsquares.assembly.elimination import Elimination
from obseq.leastsquares.assembly.evaluation import (
    batch_arrays,
    jacobian_rows,
    present_values,
    raw_residuals,
    residual_rows,
    used_blocks,
    whitened,
    whitened_residual_rows,
    why_not_finite,
)
from obseq.leastsquares.assembly.linearisation import Linearisation, SolvedLinearisation
from obseq.leastsquares.assembly.prior_rows import PriorRows
from obseq.leastsquares.assembly.small_system import MOST_UNKNOWNS, SmallSystem
from obseq.leastsquares.assembly.store import StoreLayout, aligned_zeros, store_layout
from obseq.leastsquares.assembly.threads import column_bounds, in_threads, share_out
from obseq.leastsquares.loops.loop_arguments import BlockTable, Span
from obseq.leastsquares.problem.arguments import are_finite
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.priors import Prior, Viscosity
from obseq.leastsquares.problem.unknowns import UnknownTable


class _Whole(NamedTuple):
    """Values, gradient and sums of squares before damping and elimination; diagonal as of `Linearisation`."""

    values: FloatArray
    gradient: FloatArray
    squares: dict[str, float]
    diagonal: FloatArray


class NormalEquations:
    """Assembles the equations of a table of unknowns; the pattern is that of its creation.

    Blocks that are `eliminated` (n_blocks,) do not enter the matrix; `step` gives their part of a solution.
    Blocks that only hard constraints touch are in the matrix with zeros. Observations are shared among
    `threads`; with the same number of threads the numbers are the same at each run. `evaluations` counts how
    often all residuals were computed. With the `layout` of more equations the pattern is that of them all.
    """

    def __init__(
        self,
        table: UnknownTable,
        batches: Sequence[Batch],
        priors: Sequence[Prior],
        eliminated: BoolArray | None = None,
        constraints: Sequence[Batch] = (),
        viscosities: Sequence[Viscosity] = (),
        threads: int = 1,
        layout: StoreLayout | None = None,
    ) -> None:
        self.table = table
        self.batches = tuple(batches)
        self.priors = tuple(priors)
        self.constraints = tuple(constraints)
        self.viscosities = tuple(viscosities)
        self.used = used_blocks(table, [*batches, *constraints], priors)
        self.layout = layout or store_layout(table, self.batches, self.used, eliminated)
        self.pattern, self.free = self.layout.matrix, self.layout.free
        self._threads = threads
        self.evaluations = 0
        self._prior_rows = PriorRows(self.priors, self.free)
        blocks, self._diagonal_places = self.layout.groups.blocks, self.layout.diagonal.copy()
        self._diagonal_places[blocks] = 0
        self._shares = share_out(self.layout, [batch.n for batch in self.batches], threads)
        self._elimination = Elimination(table, self.layout, len(self._shares)) if len(blocks) else None
        self._damped = slice(None) if self._elimination else self.pattern.diagonal  # what a damping changes
        self._pair_bounds = column_bounds(self.layout.stored[:, 1:3].min(axis=1), len(self._shares))
        self._kept = _Whole(np.zeros(0), np.zeros(0), {}, np.zeros(0))
        self._store = np.zeros(0)  # made by the first assembly
        self._tiles: dict[tuple[int, int], FloatArray] = {}
        self._records: dict[tuple[int, int], FloatArray] = {}
        self._is_clean = True  # behind the matrix, all of it is zero; not so after an interrupted assembly

    @property
    def n_unknowns(self) -> int:
        """Number of free unknowns, eliminated ones included."""
        return self.pattern.n + int(np.count_nonzero(self.layout.groups.local >= 0))

    def assemble(
        self, damping: float = 0.0, viscous: bool = True, floor: FloatArray | None = None
    ) -> Linearisation:
        """Normal matrix, gradient and sums of squares at the current values.

        The values are the same array at each call: they last until the next one.

        Args:
            damping: share of each diagonal entry of N that is added to it (Levenberg-Marquardt).
            floor: (n_free,) least diagonal that the damping is a share of; that of N itself when None.
            viscous: with the pull to the current values; without, N is that of the observations and priors.

        Raises:
            DivergenceError: a residual or a derivative is not finite.
            SingularSystemError: the observations of an eliminated block do not determine it.
        """
        return self._reduced(self._collected(viscous), damping, floor)

    @cached_property
    def small(self) -> SmallSystem | None:
        """The system as one that `solved` can treat; None where it is none of those."""
        has_clusters = any(batch.clusters is not None for batch in self.batches)
        is_plain = not (self._elimination or self.viscosities or has_clusters) and HAS_BUILTINS
        is_small = len(self._shares) == 1 and 0 < self.pattern.n <= MOST_UNKNOWNS
        return SmallSystem(self.table, self._prior_rows, self.layout) if is_plain and is_small else None

    def solve_at_once(self) -> SolvedLinearisation | None:
        """`assemble` and its Gauss-Newton step at once, for systems that are `small`.

        None where the whole of `assemble` and of a solver is needed: numbers are not finite, or the matrix is
        not clearly regular.
        """
        if self.small is None:
            return None
        self.reweight()
        self._clean()
        totals, of_priors = self._added_up(), np.zeros(len(self.priors))
        found = self.small.iterate(self._store, of_priors)
        totals += of_priors.tolist()
        if found is None or not all(map(math.isfinite, totals)):
            return None
        self._is_clean = True
        self.evaluations += 1
        by_group = _count([*self.batches, *self.priors], totals, {})
        values, length = self._store[: self.pattern.nnz], math.sqrt(max(0.0, found.numbers[1]))
        return SolvedLinearisation(
            values, found.gradient, by_group, 0.0, 0.0, found.weights, found.step, length
        )

    def collect(self) -> FloatArray:
        """Assembles at the current values and keeps what `damped` needs, as often as it is asked.

        Returns:
            (n_scalars,) diagonal of N, as of `Linearisation`.

        Raises:
            DivergenceError: a residual or a derivative is not finite.
        """
        whole = self._collected(viscous=True)
        self._kept = whole._replace(values=whole.values[self._damped].copy())
        return whole.diagonal

    def damped(self, damping: float, floor: FloatArray | None = None) -> Linearisation:
        """The equations of the last `collect`, after which nothing was assembled, under a damping.

        Arguments and errors as of `assemble`.
        """
        values = self._store[: self.pattern.nnz]
        values[self._damped] = self._kept.values
        again = self._kept._replace(values=values, gradient=self._kept.gradient.copy())
        return self._reduced(again, damping, floor)

    def _collected(self, viscous: bool) -> _Whole:
        """The equations before damping and elimination."""
        self.evaluations += 1
        self.reweight()
        self._clean()
        squares = self._by_group(self._added_up())
        values, gradient = self._matrix_and_gradient()
        self._is_clean = True
        self._add_priors(values, gradient, squares)
        self._add_clusters(values, gradient, squares)
        if viscous:
            self._add_viscosities(values)
        return _Whole(values, gradient, squares, self._diagonal(values))

    def _diagonal(self, values: FloatArray) -> FloatArray:
        """(n_scalars,) diagonal of N, eliminated unknowns included; 0 where frozen."""
        diagonal = np.zeros(self.table.n_scalars)
        diagonal[self.free.scalars] = values[self.pattern.diagonal]
        if self._elimination:
            diagonal[self._elimination.scalars] = self._store[self._elimination.places]
        return diagonal

    def _reduced(self, whole: _Whole, damping: float, floor: FloatArray | None) -> Linearisation:
        """Adds the damping, eliminates."""
        values, gradient = whole.values, whole.gradient
        if damping:
            diagonal = values[self.pattern.diagonal]
            values[self.pattern.diagonal] += damping * (
                diagonal if floor is None else np.maximum(diagonal, floor)
            )
        eliminated = 0.0
        if self._elimination:
            eliminated = self._elimination.eliminate(self._store, gradient, damping)
        if not (are_finite(gradient) and are_finite(values)):
            raise DivergenceError(why_not_finite(self.table, self.batches))
        return Linearisation(values, gradient, whole.squares, eliminated, damping, whole.diagonal)

    def rest(self) -> None:
        """Gives the memory of the matrix back until the next assembly, where nothing else needs it."""
        if self._elimination is None:
            self._store, self._kept = np.zeros(0), self._kept._replace(values=np.zeros(0))

    def _clean(self) -> None:
        """Makes the store all zero; the mark that it is goes first."""
        was_clean, self._is_clean = self._is_clean, False
        if not len(self._store):
            self._store = aligned_zeros(self._shares.size)
        elif was_clean:
            self._store[: self.pattern.nnz] = 0.0
            self._store[self.layout.first_eliminated :] = 0.0
        else:
            self._store[:] = 0.0

    def reweight(self, raw: Mapping[Batch, FloatArray] | None = None) -> None:
        """Gives batches that have a loss the weights of their residuals at the current values.

        Args:
            raw: `raw_residuals` there, where they are known.
        """
        for batch in self.batches:
            if batch.loss is not None:
                known = raw[batch] if raw else self.raw_residuals(batch)
                batch.reweight(whitened(batch, known))

    def step(self, solved: FloatArray, linearisation: Linearisation) -> FloatArray:
        """(n_scalars,) step of all unknowns from that of the matrix's (n_free,): zero where frozen.

        The linearisation must be that of the last assembly.
        """
        return self.extended(solved, linearisation.damping)

    def extended(self, solved: FloatArray, damping: float = 0.0) -> FloatArray:
        """(n_scalars,) as `step`, from the matrix as it was assembled last, with this damping."""
        step = np.zeros(self.table.n_scalars)
        step[self.free.scalars] = solved
        if self._elimination:
            self._elimination.substitute_back(self._store, damping, step)
        return step

    def sums_of_squares(self, raw: Mapping[Batch, FloatArray] | None = None) -> dict[str, float]:
        """Sum of weighted squared residuals by group, from values alone.

        Args:
            raw: `raw_residuals` at the current values, where they are known.
        """
        self.evaluations += 1
        with np.errstate(over="ignore", invalid="ignore"):
            weighted = (self._weighted(batch, raw[batch].T if raw else None) for batch in self.batches)
            totals = [float(np.square(one).sum()) for one in weighted]
        squares = self._by_group(totals)
        return _count(self.priors, [p.sum_of_squares(self.table.values) for p in self.priors], squares)

    def _by_group(self, totals: list[float]) -> dict[str, float]:
        """Sums of squares by group, from those of all batches."""
        if not all(map(math.isfinite, totals)):
            raise DivergenceError(why_not_finite(self.table, self.batches))
        return _count(self.batches, totals, {})

    def weighted_residuals(self) -> FloatArray:
        """(m,) residuals over their sigmas, then priors; robust weights as of the last linearisation."""
        self.evaluations += 1
        priors = [prior.residuals(self.table.values) * prior.weights for prior in self.priors]
        return np.concatenate([*(self._weighted(batch).ravel() for batch in self.batches), *priors])

    def seen(self, directions: FloatArray) -> FloatArray:
        """(m, k) what the weighted residuals change along directions (n_free, k), those of priors last."""
        parts = [directions[self.free.number[p.scalars]] * p.weights[:, None] for p in self.priors]
        for batch in self.batches:
            rows = jacobian_rows(self.table, batch)
            parts.append(whitened_rows(self.table, self.free, batch, rows)[0] @ directions)
        return np.concatenate(parts)

    def raw_residuals(self, batch: Batch) -> FloatArray:
        """(n, n_residuals) computed minus observed, at the current values, in their units."""
        return raw_residuals(self.table, batch, self._threads, partial(self.tile, batch))

    def _weighted(self, batch: Batch, rows: FloatArray | None = None) -> FloatArray:
        """(n_residuals, n) weighted residuals, from those (n_residuals, n) that are known."""
        weights = batch.weights[:, : batch.n]
        if rows is None:
            rows = residual_rows(self.table, batch, self._threads, partial(self.tile, batch))
        return np.where(weights != 0.0, whitened_residual_rows(batch, rows) * weights, 0.0)

    def _added_up(self) -> list[float]:
        """Adds all batches to the store; returns their sums of weighted squared residuals."""
        from obseq.leastsquares.loops.accumulation import assemble

        present, bounds = present_values(self.table), self._shares.bounds.tolist()

        def add_share(share: int) -> list[float]:
            totals, spans, store = [], map(Span, bounds[share], bounds[share + 1]), self._store
            for batch, table, span in zip(self.batches, self.layout.batches, spans, strict=True):
                tile, scratch = self._room(share, batch, table)
                arrays, kernel = batch_arrays(batch), batch.shape.kernel()
                totals.append(float(assemble(kernel, tile, arrays, span, present, table, scratch, store)))
            return totals

        totals = in_threads(add_share, len(self._shares))
        if len(self._shares.moves):
            from obseq.leastsquares.loops.shares import add_copies

            add_copies(self._store, self._shares.moves)
        return [sum(of_batch) for of_batch in zip(*totals, strict=True)]

    def _room(self, share: int, batch: Batch, table: BlockTable) -> tuple[FloatArray, FloatArray]:
        """A tile and room for records, of one thread and for one formula: kept, since batches are many."""
        key = share, id(batch.shape)
        if key not in self._records:
            self._records[key] = aligned_zeros(table.scratch)
        return self.tile(batch, share), self._records[key]

    def tile(self, batch: Batch, share: int = 0) -> FloatArray:
        """A tile of one thread and for one formula, kept too."""
        key = share, id(batch.shape)
        if key not in self._tiles:
            self._tiles[key] = batch.shape.new_tile()
        return self._tiles[key]

    def _matrix_and_gradient(self) -> tuple[FloatArray, FloatArray]:
        """The values of the matrix with all blocks of their own added, and the gradient."""
        from obseq.leastsquares.loops.blocks_to_matrix import add_diagonal_blocks, add_pairs

        store, unknowns, bounds = self._store, self.layout.unknowns, self._pair_bounds
        gradient = np.zeros(self.pattern.n)
        add_diagonal_blocks(store, self._diagonal_places, unknowns, gradient)

        def add_share(share: int) -> None:
            add_pairs(store, self.layout.stored[bounds[share] : bounds[share + 1]], unknowns)

        if len(self.layout.stored):
            in_threads(add_share, len(bounds) - 1)
        return store[: self.pattern.nnz], gradient

    def _add_priors(self, values: FloatArray, gradient: FloatArray, squares: dict[str, float]) -> None:
        if not self._prior_rows:
            return
        from obseq.leastsquares.loops.blocks_to_matrix import add_priors

        totals, indptr = np.zeros(len(self.priors)), self.pattern.indptr
        add_priors(self._prior_rows.arrays(), self.table.padded_values, indptr, values, gradient, totals)
        _count(self.priors, totals.tolist(), squares)
        if self._elimination:
            for prior in self.priors:
                weight = np.square(prior.weights)
                pull = prior.residuals(self.table.values) * weight
                self._elimination.add(self._store, prior.scalars, weight, pull)

    def _add_clusters(self, values: FloatArray, gradient: FloatArray, squares: dict[str, float]) -> None:
        """Adds the observations that are correlated with one another."""
        for batch in self.batches:
            if batch.clusters is not None:
                rows = whitened_rows(self.table, self.free, batch, jacobian_rows(self.table, batch))
                squares[batch.group] += add_cluster(*rows, self.pattern, values, gradient)

    def _add_viscosities(self, values: FloatArray) -> None:
        """Adds the weights of a pull to the current values: to the diagonal only."""
        for viscosity in self.viscosities:
            row = self.free.number[viscosity.scalars]
            free = row >= 0
            np.add.at(values, self.pattern.diagonal[row[free]], viscosity.weights[free])
            if self._elimination:
                none = np.zeros_like(viscosity.weights)
                self._elimination.add(self._store, viscosity.scalars, viscosity.weights, none)


def _count(
    sources: Sequence[Batch | Prior], totals: list[float], squares: dict[str, float]
) -> dict[str, float]:
    """Adds the sum of squares of each source to that of its group."""
    for source, total in zip(sources, totals, strict=True):
        squares[source.group] = squares.get(source.group, 0.0) + total
    return squares
