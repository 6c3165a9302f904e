"""A system cut into the leaves of a tree, and the node of the tree where each unknown is eliminated.

The area is halved again and again. An observation belongs to the leaf of its last point (its target, so that
stations are on the junctions: there are fewer of them); a block of unknowns is eliminated at the lowest node
of the tree below which all its observations are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.assembly.evaluation import used_blocks
from obseq.leastsquares.helmert.leaves import Part
from obseq.leastsquares.problem.numbering import free_unknowns

if TYPE_CHECKING:
    from collections.abc import Iterator

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.leastsquares.helmert.leaves import Given
    from obseq.leastsquares.problem.batches import Batch
    from obseq.leastsquares.problem.manifolds import Manifold
    from obseq.leastsquares.problem.priors import Prior
    from obseq.leastsquares.system import LeastSquares

Known = tuple["IntArray", "FloatArray", "FloatArray"]


def halved(places: FloatArray, depth: int) -> IntArray:
    """(n,) number of the leaf of each place (n, 2): halves across the longer side, again and again."""
    leaf = np.zeros(len(places), dtype=np.int64)
    for _ in range(depth):
        new = 2 * leaf
        for part in np.unique(leaf):
            inside = np.flatnonzero(leaf == part)
            axis = int(np.argmax(np.ptp(places[inside], axis=0)))
            order = inside[np.argsort(places[inside, axis], kind="stable")]
            new[order[len(order) // 2 :]] += 1
        leaf = new
    return leaf


def homes(touched: BoolArray) -> IntArray:
    """(n_blocks,) lowest node above all leaves that touch a block (n_leaves, n_blocks)."""
    n = len(touched)
    first, last = n + np.argmax(touched, axis=0), 2 * n - 1 - np.argmax(touched[::-1], axis=0)
    while (first != last).any():
        apart = first != last
        first, last = np.where(apart, first // 2, first), np.where(apart, last // 2, last)
    return np.asarray(first)


@dataclass(frozen=True)
class Cut:
    """A system in parts.

    Attributes:
        scalars: (n_unknowns,) positions of the free unknowns in the table.
        home: (n_unknowns,) node where each is eliminated.
        parts: one for each leaf.
    """

    scalars: IntArray
    home: IntArray
    parts: list[Part]


def cut(system: LeastSquares, depth: int) -> Cut:
    """The parts of a system, 2 to the power of a depth.

    Raises:
        InputError: the system has what cannot be cut: constraints, losses, correlations; or too few points
            for so many parts.
    """
    _refuse(system)
    cutting = _Cutting(system, depth)
    home = homes(cutting.touched)[cutting.of_scalar]
    free = cutting.number >= 0
    parts = [cutting.part(leaf, home) for leaf in range(2**depth)]
    return Cut(np.flatnonzero(free), home[free], parts)


class _Cutting:
    """Which leaf each observation belongs to, and which leaves touch each block."""

    def __init__(self, system: LeastSquares, depth: int) -> None:
        self.table, self.batches, self.priors = system.unknowns, system.batches, system.priors
        n = len(self.table)
        self.number = free_unknowns(self.table, used_blocks(self.table, self.batches, self.priors)).number
        self.of_scalar = np.repeat(np.arange(n), self.table.size)
        self.is_point = self.table.each(lambda kind: kind.is_point, slice(None))
        points = np.flatnonzero(self.is_point)
        if depth < 1 or len(points) < 2**depth:
            raise InputError(f"{len(points)} points cannot be halved {depth} times: a depth is from 1 on")
        self.leaf_of = np.zeros(n, dtype=np.int64)
        places = np.stack([self.table.values[self.table.start[points] + axis] for axis in (0, 1)], axis=1)
        self.leaf_of[points] = halved(places, depth)
        self.of_batch = [self._leaf_of_rows(batch) for batch in self.batches]
        self.touched = np.zeros((2**depth, n), dtype=bool)
        for batch, leaf in zip(self.batches, self.of_batch, strict=True):
            for blocks in batch.blocks:
                self.touched[leaf[batch.active], blocks[batch.active]] = True
        for prior in self.priors:
            self.touched[self.leaf_of[prior.ids], prior.ids] = True

    def _leaf_of_rows(self, batch: Batch) -> IntArray:
        """(n,) leaf of each observation: that of its last point, the first one without points."""
        leaf = np.zeros(batch.n, dtype=np.int64)
        for blocks in batch.blocks:
            point = self.is_point[blocks]
            leaf[point] = self.leaf_of[blocks[point]]
        return leaf

    def part(self, leaf: int, home: IntArray) -> Part:
        """What one leaf is built from."""
        groups = list(self._groups(np.flatnonzero(self.touched[leaf])))
        blocks = np.concatenate(groups)
        local = np.full(len(self.table), -1)
        local[blocks] = np.arange(len(blocks))
        scalars = np.concatenate([self.table.scalars(ids).ravel() for ids in groups])
        return Part(
            tuple(self._kept(ids) for ids in groups),
            self.table.frozen[scalars],
            tuple(self._batches(leaf, local)),
            tuple(self._priors(leaf, local)),
            self.number[scalars],
            home[scalars] != len(self.touched) + leaf,
        )

    def _kept(self, ids: IntArray) -> tuple[Manifold, IntArray, list[str], FloatArray]:
        names = [self.table.names[block] for block in ids.tolist()]
        return self.table.manifold(int(ids[0])), ids, names, self.table.read(ids)

    def _groups(self, blocks: IntArray) -> Iterator[IntArray]:
        """The blocks of each kind and size."""
        for _, ids in self.table.of_manifolds():
            mine = ids[np.isin(ids, blocks)]
            for size in np.unique(self.table.size[mine]).tolist():
                yield mine[self.table.size[mine] == size]

    def _batches(self, leaf: int, local: IntArray) -> Iterator[Given]:
        for batch, of_row in zip(self.batches, self.of_batch, strict=True):
            rows = np.flatnonzero((of_row == leaf) & batch.active)
            if rows.size:
                arguments = zip(batch.shape.roles, batch.blocks, strict=True)
                given = {role.name: local[ids[rows]] for role, ids in arguments}
                yield batch.shape.formula, given, np.array(batch.observations[rows]), batch.sigmas[rows]

    def _priors(self, leaf: int, local: IntArray) -> Iterator[Known]:
        for prior in self.priors:
            blocks = self.of_scalar[prior.scalars]
            rows = np.flatnonzero(self.leaf_of[blocks] == leaf)
            if rows.size:
                yield self._prior(prior, rows, local)

    def _prior(self, prior: Prior, rows: IntArray, local: IntArray) -> Known:
        """Some of the scalars of a prior, one by one; the other components of their blocks are left out."""
        blocks, scalars = self.of_scalar[prior.scalars[rows]], prior.scalars[rows]
        shape = len(rows), int(self.table.size[blocks[0]])
        values, sigmas = np.zeros(shape), np.full(shape, np.inf)
        at = np.arange(len(rows)), scalars - self.table.start[blocks]
        values[at], sigmas[at] = prior.values[rows], prior.sigmas[rows, 0]
        return local[blocks], values, sigmas


def _refuse(system: LeastSquares) -> None:
    """Raises InputError for what parts of a system would not say."""
    if system.constraints or system.viscosities or system.datum.scalars.size:
        raise InputError("Helmert blocks: hard constraints, viscosities and a datum cannot be cut into parts")
    for batch in system.batches:
        if batch.loss is not None or batch.is_correlated or batch.clusters is not None:
            raise InputError(f"Helmert blocks: {batch.name} has a loss or covariances, which cannot be cut")
