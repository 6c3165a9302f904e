"""The columns of hypotheses over the equations: a plain array where they are few, else a sparse matrix."""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, cast

import numpy as np

from obseq.dataclass import dataclass
from obseq.leastsquares.sparse import Sparse

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.arrays import BoolArray, FloatArray, IndexArray, IntArray
    from obseq.diagnosis.linear import Linear

    Lost = Callable[[Sparse], FloatArray]

_NONE, _SEVERAL = -1, -2
"""In place of the observation that a column changes: none, or more than one."""
CHUNK = 64
"""Columns that are solved together."""
_NUMBERS = 4_000_000
"""Numbers of a matrix of columns: 32 MB, which a network of 60,000 equations fills with the chunk above."""
_PAIR = 2
_AT_A_TIME = 4096
"""Columns whose products are made together."""


@dataclass(frozen=True, eq=False)
class Columns:
    """What errors of one unit add to computed minus observed.

    Attributes:
        matrix: (n, k) a plain array, whitened; where it is sparse, (k, n): each column is a row there.
        is_local: (k,) whether the unknowns of its equations are all joined in the normal matrix.
    """

    matrix: Sparse | FloatArray
    is_local: BoolArray
    _kept: list[tuple[FloatArray, FloatArray]] = field(default_factory=list)

    def norms(self) -> FloatArray:
        """(k,) length of each."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(np.sqrt(np.einsum("ij,ij->j", self.matrix, self.matrix)))
        return np.sqrt(self._each.dots(self._each))

    @property
    def _each(self) -> Sparse:
        """(k, n) the columns of a sparse matrix, as rows."""
        return cast("Sparse", self.matrix)

    def scale(self, lengths: FloatArray) -> None:
        """Divides them by lengths (k,), in place: those of a large network are not copied."""
        matrix = self.matrix
        self._kept.clear()
        if isinstance(matrix, np.ndarray):
            matrix /= lengths
        else:
            matrix.values /= lengths.repeat(matrix.counts)

    def shown(self, vectors: FloatArray) -> FloatArray:
        """(k,) or (k, m) C' times vectors (n,) or (n, m)."""
        return np.asarray((self.matrix.T if isinstance(self.matrix, np.ndarray) else self.matrix) @ vectors)

    def effect(self, which: IntArray, sizes: FloatArray) -> FloatArray:
        """(n,) what errors of some sizes add together."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(self.matrix[:, which] @ sizes)
        return self._each.some(which).transposed_times(sizes)

    def some(self, which: IntArray) -> FloatArray:
        """(n, m) some of them."""
        if isinstance(self.matrix, np.ndarray):
            return self.matrix[:, which]
        return self._each.some(which).toarray().T

    @property
    def at_a_time(self) -> int:
        """How many are solved for together: as many as a matrix over all equations has room for."""
        n = int(self.matrix.shape[0 if isinstance(self.matrix, np.ndarray) else 1])
        return max(1, min(CHUNK, _NUMBERS // max(n, 1)))

    def lost(self, linear: Linear, which: IntArray) -> FloatArray:
        """(m,) what the unknowns take of the squares of some of a sparse matrix: C' A Q A' C of each."""
        return linear.lost(self._each.some(which) @ cast("Sparse", linear.rows))

    def weights_apart(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, as if its equations had no unknowns in common."""
        shares = 1.0 - linear.taken.diagonal()
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(shares @ self.matrix**2)
        return self._each.dots(self._each.with_columns_scaled(shares))

    def first_weights(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, where it costs little; NaN of those that a solve each would take."""
        if isinstance(self.matrix, np.ndarray):
            lost = np.einsum("ij,ij->j", *self._through(linear))
            return np.asarray(np.where(self.matrix.any(axis=0), 1.0 - lost, 0.0))
        each, units = self._each, self._units(linear)
        weights = np.where(each.counts == 0, 0.0, np.nan)
        (within,) = np.nonzero(units >= 0)
        own = each.some(within)
        weights[within] = 1.0 - own.dots(own @ cast("Sparse", linear.taken))
        (local,) = np.nonzero((units == _SEVERAL) & self.is_local)
        if local.size:
            through = each.some(local) @ cast("Sparse", linear.rows)
            weights[local] = 1.0 - through.dots(through @ cast("Sparse", linear.cofactors))
        return weights

    def _units(self, linear: Linear) -> IndexArray:
        """(k,) first equation of the observation that a column changes; negative for several or none."""
        each, taken = self._each, cast("Sparse", linear.taken)
        first = taken.columns[taken.starts[:-1]]
        found = np.full(each.shape[0], _NONE, np.int32)
        (some,) = np.nonzero(each.counts)
        if some.size:
            owners = first[each.columns]
            low, high = (f.reduceat(owners, each.starts[some]) for f in (np.minimum, np.maximum))
            found[some] = np.where(low == high, low, _SEVERAL)
        return found

    def are_near(self, linear: Linear, sets: IntArray) -> BoolArray:
        """(g,) whether M of a set (g, q) takes no solves: the unknowns of all its columns are joined."""
        if isinstance(self.matrix, np.ndarray):
            return np.ones(len(sets), np.bool_)
        return np.asarray(self._are_within(linear, sets) | self.is_local[sets].all(axis=1))

    def _are_within(self, linear: Linear, sets: IntArray) -> BoolArray:
        """(g,) whether all columns of a set change the same observation, or nothing."""
        units = self._units(linear)[sets]
        units = np.where(units == _NONE, units.max(axis=1, keepdims=True), units)
        return np.asarray((units == units[:, :1]).all(axis=1) & (units[:, 0] != _SEVERAL))

    def grams(self, linear: Linear, sets: IntArray) -> FloatArray:
        """(g, q, q) C' R C of small sets (g, q) of columns; by solves where they are not near."""
        g, q = sets.shape
        if isinstance(self.matrix, np.ndarray):
            through, solved = self._through(linear)
            each = self.matrix[:, sets.ravel()].reshape(-1, g, q)
            before, after = (one[:, sets.ravel()].reshape(-1, g, q) for one in (through, solved))
            taken: FloatArray = np.einsum("ugi,ugj->gij", before, after)
            return np.asarray(np.einsum("ngi,ngj->gij", each, each) - taken)
        result = np.empty((g, q, q))
        for which, lost in self._ways(linear, q, sets):
            for part in np.array_split(which, -(-len(which) * q // _AT_A_TIME)) if len(which) else ():
                flat = self._each.some(sets[part].ravel())
                result[part] = _inner(flat, flat, q) - lost(flat)
        return result

    def gram(self, linear: Linear, own: IntArray) -> FloatArray:
        """(q, q) C' R C of some columns, whose unknowns need not be joined."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(self.grams(linear, own[None])[0])
        flat = self._each.some(own)
        return np.asarray((_inner(flat, flat, len(own)) - _lost_by_all(linear, flat, len(own)))[0])

    def _ways(self, linear: Linear, q: int, sets: IntArray) -> list[tuple[IntArray, Lost]]:
        """Sets by how what the unknowns take of their columns is found."""
        rows, taken = cast("Sparse", linear.rows), cast("Sparse", linear.taken)

        def locally(flat: Sparse) -> FloatArray:
            through = flat @ rows
            return _inner(through, through @ cast("Sparse", linear.cofactors), q)

        is_within = self._are_within(linear, sets)
        is_local = ~is_within & self.is_local[sets].all(axis=1)
        return [
            (np.flatnonzero(is_within), lambda flat: _inner(flat, flat @ taken, q)),
            (np.flatnonzero(is_local), locally),
            (np.flatnonzero(~is_within & ~is_local), lambda flat: _lost_by_all(linear, flat, q)),
        ]

    def _through(self, linear: Linear) -> tuple[FloatArray, FloatArray]:
        """A' C, and Q A' C; of a plain array they are kept: tests of sets ask for them again."""
        if not self._kept:
            through = np.asarray(linear.rows.T @ cast("FloatArray", self.matrix))
            solved = linear.solve(np.ascontiguousarray(through)) if len(through) else through
            self._kept.append((through, solved))
        return self._kept[0]


def _lost_by_all(linear: Linear, flat: Sparse, q: int) -> FloatArray:
    """(g, q, q) what the unknowns take of sets of columns: x'y is half of (x + y)'(x + y) - x'x - y'y."""
    through = flat @ cast("Sparse", linear.rows)
    firsts, seconds = _pairs(flat.shape[0], q)
    both = through.some(np.column_stack([firsts, seconds]).ravel())
    sums = Sparse(both.values, both.columns, both.starts[::2], both.shape[1])
    own, together = linear.lost(through), linear.lost(sums)
    return _squares(0.5 * (together - own[firsts] - own[seconds]), q)


def _inner(left: Sparse, right: Sparse, q: int) -> FloatArray:
    """(g, q, q) products of the rows of each set, which follow each other; they are symmetric."""
    firsts, seconds = _pairs(left.shape[0], q)
    return _squares(left.some(firsts).dots(right.some(seconds)), q)


def _pairs(count: int, q: int) -> tuple[IntArray, IntArray]:
    """Rows of both members of all pairs in sets of q rows that follow each other."""
    first, second = np.triu_indices(q)
    starts = np.arange(0, count, q)[:, None]
    return (starts + first).ravel(), (starts + second).ravel()


def _squares(products: FloatArray, q: int) -> FloatArray:
    """(g, q, q) symmetric matrices of the products of pairs."""
    first, second = np.triu_indices(q)
    result = np.empty((len(products) // len(first), q, q))
    result[:, first, second] = result[:, second, first] = products.reshape(-1, len(first))
    return result


def joint(weights: FloatArray, shown: FloatArray, unseen: float) -> tuple[FloatArray, IntArray, FloatArray]:
    """T, degrees of freedom (g,) and sizes (g, q) of sets, from M (g, q, q) and u (g, q)."""
    if weights.shape[1] == _PAIR:
        return _joint_of_pairs(weights, shown, unseen)
    shares, axes = np.linalg.eigh(weights)
    seen = shares > unseen
    along = np.einsum("gij,gi->gj", axes, shown)
    sizes = np.where(seen, along / np.where(seen, shares, 1.0), 0.0)
    return (sizes * along).sum(axis=1), seen.sum(axis=1), np.einsum("gij,gj->gi", axes, sizes)


def _joint_of_pairs(
    weights: FloatArray, shown: FloatArray, unseen: float
) -> tuple[FloatArray, IntArray, FloatArray]:
    """The same for sets of two, whose eigenvectors stand in closed form: blocks have many of them."""
    first, second, cross = weights[:, 0, 0], weights[:, 1, 1], weights[:, 0, 1]
    angle = 0.5 * np.arctan2(2.0 * cross, first - second)
    middle, half = 0.5 * (first + second), np.hypot(0.5 * (first - second), cross)
    axis = np.column_stack([np.cos(angle), np.sin(angle)])
    across = np.column_stack([-axis[:, 1], axis[:, 0]])
    found, degrees = np.zeros(len(weights)), np.zeros(len(weights), np.int64)
    sizes = np.zeros_like(shown)
    for share, direction in ((middle + half, axis), (middle - half, across)):
        along, seen = np.einsum("gi,gi->g", direction, shown), share > unseen
        size = np.where(seen, along / np.where(seen, share, 1.0), 0.0)
        found, degrees, sizes = found + size * along, degrees + seen, sizes + size[:, None] * direction
    return found, degrees, sizes
