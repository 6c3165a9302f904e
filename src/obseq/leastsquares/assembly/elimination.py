"""The eliminated blocks of a set of equations: taken out of the matrix, and found again afterwards."""

from __future__ import annotations

import numpy as np

from obseq.arrays import FloatArray, IntArray, IntRows
from obseq.leastsquares.assembly.pattern import ranks
from obseq.leastsquares.assembly.store import StoreLayout, aligned_zeros, part_width
from obseq.leastsquares.assembly.threads import column_bounds, in_threads
from obseq.leastsquares.diagnosis.singular import eliminated_error
from obseq.leastsquares.loops.loop_arguments import EliminationRoom
from obseq.leastsquares.problem.unknowns import UnknownTable


class Elimination:
    """Works on a store that is filled.

    Groups of blocks are shared among threads. Each thread has sums of its own, which are subtracted from the
    matrix at the end in a fixed order: the numbers are the same at each run.

    Args:
        table: the unknowns.
        layout: where the store has their blocks.
        threads: how many share the groups.
    """

    def __init__(self, table: UnknownTable, layout: StoreLayout, threads: int) -> None:
        self._table = table
        self._layout = layout
        self._spans = _spans(layout.fill.bodies.bounds, threads)
        self._sums = aligned_zeros(len(self._spans) * layout.fill.size).reshape(len(self._spans), -1)
        self._pair_bounds = column_bounds(layout.fill.low, threads)
        count = layout.free.count[layout.fill.blocks]
        self._pulled = np.repeat(layout.free.first[layout.fill.blocks], count) + ranks(count)
        blocks = layout.groups.blocks
        size = table.size[blocks]
        within = np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        scalars = np.repeat(table.start[blocks], size) + within
        free = ~table.frozen[scalars]
        places = np.repeat(4 * layout.diagonal[blocks], size) + within * np.repeat(part_width(size) + 1, size)
        self.scalars: IntArray = scalars[free]
        self.places: IntArray = places[free]

    def add(self, store: FloatArray, scalars: IntArray, weight: FloatArray, pull: FloatArray) -> None:
        """Adds to the diagonal and to the gradient of those unknowns that are eliminated."""
        table = self._table
        block = np.searchsorted(table.start, scalars, side="right") - 1
        chosen = np.isin(block, self._layout.groups.blocks)
        block, scalars = block[chosen], scalars[chosen]
        size, within = table.size[block], scalars - table.start[block]
        width, at = part_width(size), 4 * self._layout.diagonal[block]
        np.add.at(store, at + within * width + within, weight[chosen])
        np.add.at(store, at + size * width + within, pull[chosen])

    def eliminate(self, store: FloatArray, gradient: FloatArray, damping: float) -> float:
        """Subtracts the effect of all groups; sum of g_t' N_tt^-1 g_t over them.

        Args:
            store: the matrix at its front, changed, and small blocks behind it.
            gradient: (n_free,) changed.
            damping: share of the diagonal of the eliminated blocks that is added to it.

        Raises:
            SingularSystemError: the observations of an eliminated block do not determine it.
        """
        pulls = np.zeros((len(self._spans), int(self._layout.fill.bodies.height.sum())))
        failed = np.full((len(self._spans), 1), -1, dtype=np.int64)

        def eliminate_share(share: int) -> float:
            return self._summed_up(store, share, damping, pulls[share], failed[share])

        decrease = sum(in_threads(eliminate_share, len(self._spans)))
        wrong = failed[failed >= 0]
        if wrong.size:
            raise eliminated_error(self._table, int(wrong[0]))
        self._subtract_sums(store)
        gradient[self._pulled] -= pulls.sum(axis=0)[self._layout.fill.pulls]
        return decrease

    def _summed_up(
        self, store: FloatArray, share: int, damping: float, pulls: FloatArray, failed: IntArray
    ) -> float:
        from obseq.leastsquares.loops.schur_complement import eliminate

        layout, sums = self._layout, self._sums[share]
        bodies = layout.fill.bodies
        sums[:] = 0.0
        return eliminate(
            store,
            layout.diagonal,
            layout.groups,
            bodies,
            layout.unknowns,
            damping,
            self._spans[share],
            sums,
            pulls,
            failed,
            self._room(bodies.widest),
        )

    def _subtract_sums(self, store: FloatArray) -> None:
        """Subtracts the sums of all threads from the matrix."""
        from obseq.leastsquares.loops.schur_complement import subtract_sums

        layout, bounds = self._layout, self._pair_bounds

        def subtract_share(share: int) -> None:
            pairs = layout.summed[bounds[share] : bounds[share + 1]]
            subtract_sums(self._sums, pairs, layout.unknowns, store)

        in_threads(subtract_share, len(bounds) - 1)

    def substitute_back(self, store: FloatArray, damping: float, step: FloatArray) -> None:
        """Writes the steps of eliminated unknowns in a step (n_scalars,) that has the others."""
        from obseq.leastsquares.loops.schur_complement import substitute_back

        layout = self._layout
        diagonal, groups, unknowns = layout.diagonal, layout.groups, layout.unknowns

        def substitute_share(share: int) -> None:
            room = self._room(widest=0)
            substitute_back(store, diagonal, groups, unknowns, damping, self._spans[share], step, room)

        in_threads(substitute_share, len(self._spans))

    def _room(self, widest: int) -> EliminationRoom:
        """Room for one eliminated group, whose longest rows have this length."""
        most = self._layout.groups.most
        return EliminationRoom(np.empty((most, most)), np.empty(most), np.empty(6), np.empty(most * widest))


def _spans(bounds: IntArray, threads: int) -> IntRows:
    """(n_shares, 3) groups of each share, with about as many pairs, and where its first pair is.

    `bounds` (n_groups + 1,): as of `Bodies`.
    """
    met = np.diff(bounds)
    pairs = np.concatenate([[0], np.cumsum(met * (met + 1) // 2)])
    wanted = np.arange(1, threads) * int(pairs[-1]) // threads
    cuts = np.concatenate([[0], np.searchsorted(pairs, wanted), [len(met)]])
    return np.column_stack([cuts[:-1], cuts[1:], pairs[cuts[:-1]]]).astype(np.int64)
