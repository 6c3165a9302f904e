"""The columns of hypotheses over the equations: a plain array where they are few, else a sparse matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable

    from scipy.sparse import csc_array

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.diagnosis.linear import Linear

    Matrix = Any  # dense or sparse: SciPy's operators are those of NumPy
    Ways = Callable[[csc_array], tuple[Matrix, Matrix]]

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
        matrix: (n, k), whitened.
        is_local: (k,) whether the unknowns of its equations are all joined in the normal matrix.
    """

    matrix: csc_array | FloatArray
    is_local: BoolArray

    def norms(self) -> FloatArray:
        """(k,) length of each."""
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(np.sqrt(np.einsum("ij,ij->j", self.matrix, self.matrix)))
        return np.sqrt(_by_column(self.matrix, np.square(self.matrix.data)))

    def scale(self, lengths: FloatArray) -> None:
        """Divides them by lengths (k,), in place: of a large network they are most of the memory."""
        matrix = self.matrix
        if isinstance(matrix, np.ndarray):
            matrix /= lengths
        else:
            matrix.data /= np.repeat(lengths, np.diff(matrix.indptr))

    def shown(self, vectors: FloatArray) -> FloatArray:
        """(k,) or (k, m) C' times vectors (n,) or (n, m)."""
        return np.asarray(self.matrix.T @ vectors)

    def effect(self, which: IntArray, sizes: FloatArray) -> FloatArray:
        """(n,) what errors of some sizes add together."""
        return np.asarray(self.matrix[:, which] @ sizes)

    def some(self, which: IntArray) -> FloatArray:
        """(n, m) some of them."""
        found = self.matrix[:, which]
        return found if isinstance(found, np.ndarray) else np.asarray(found.toarray())

    @property
    def at_a_time(self) -> int:
        """How many are solved for together: as many as a matrix over all equations has room for."""
        return max(1, min(CHUNK, _NUMBERS // max(int(self.matrix.shape[0]), 1)))

    def through(self, linear: Linear, which: IntArray) -> FloatArray:
        """(u, m) A' times some of them."""
        found = linear.rows.T @ self.matrix[:, which]
        return np.ascontiguousarray(found if isinstance(found, np.ndarray) else found.toarray())

    def weights_apart(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, as if its equations had no unknowns in common."""
        shares = 1.0 - linear.taken.diagonal()
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(shares @ self.matrix**2)
        return _by_column(self.matrix, np.square(self.matrix.data) * shares[self.matrix.indices])

    def first_weights(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, where it costs little; NaN of those that a solve each would take."""
        if isinstance(self.matrix, np.ndarray):
            lost = np.einsum("ij,ij->j", *self._through(linear))
            return np.asarray(np.where(self.matrix.any(axis=0), 1.0 - lost, 0.0))
        matrix = cast("Matrix", self.matrix)
        weights = np.where(np.diff(matrix.indptr) == 0, 0.0, np.nan)
        units = self._units(linear)
        (within,) = np.nonzero(units >= 0)
        own = matrix[:, within]
        weights[within] = 1.0 - _sums(own, linear.taken @ own)
        (local,) = np.nonzero((units == _SEVERAL) & self.is_local)
        if local.size:
            through = cast("Matrix", linear.rows).T @ matrix[:, local]
            weights[local] = 1.0 - _sums(linear.cofactors @ through, through)
        return weights

    def _units(self, linear: Linear) -> IntArray:
        """(k,) first equation of the observation that a column changes; negative for several or none."""
        matrix, taken = cast("Matrix", self.matrix), cast("Matrix", linear.taken)
        first = taken.indices[taken.indptr[:-1]]
        found = np.full(matrix.shape[1], _NONE)
        (some,) = np.nonzero(np.diff(matrix.indptr))
        if some.size:
            owners = first[matrix.indices]
            low, high = (f.reduceat(owners, matrix.indptr[some]) for f in (np.minimum, np.maximum))
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
            lost: FloatArray = np.einsum("ugi,ugj->gij", before, after)
            return np.asarray(np.einsum("ngi,ngj->gij", each, each) - lost)
        result = np.empty((g, q, q))
        for which, taken in self._ways(linear, sets):
            for part in np.array_split(which, -(-len(which) * q // _AT_A_TIME)) if len(which) else ():
                flat = cast("Matrix", self.matrix)[:, sets[part].ravel()]
                result[part] = _inner(flat, flat, q) - _inner(*taken(flat), q)
        return result

    def _ways(self, linear: Linear, sets: IntArray) -> list[tuple[IntArray, Ways]]:
        """Sets by how what the unknowns take of them is found: vectors whose products with others it is."""
        rows = cast("Matrix", linear.rows)

        def locally(flat: csc_array) -> tuple[Matrix, Matrix]:
            through = (rows.T @ flat).tocsc()
            return through, (linear.cofactors @ through).tocsc()

        def exactly(flat: csc_array) -> tuple[Matrix, Matrix]:
            through = (rows.T @ flat).toarray()
            return through, linear.solve(through)

        is_within = self._are_within(linear, sets)
        is_local = ~is_within & self.is_local[sets].all(axis=1)
        return [
            (np.flatnonzero(is_within), lambda flat: (flat, (linear.taken @ flat).tocsc())),
            (np.flatnonzero(is_local), locally),
            (np.flatnonzero(~is_within & ~is_local), exactly),
        ]

    def _through(self, linear: Linear) -> tuple[FloatArray, FloatArray]:
        """A' C, and Q A' C."""
        through = np.asarray(linear.rows.T @ self.matrix)
        return through, linear.solve(np.ascontiguousarray(through)) if len(through) else through


def _by_column(matrix: csc_array, values: FloatArray) -> FloatArray:
    """(k,) sums of values that stand in the place of the entries of a matrix."""
    result, (some,) = np.zeros(matrix.shape[1]), np.nonzero(np.diff(matrix.indptr))
    if some.size:
        result[some] = np.add.reduceat(values, matrix.indptr[some])
    return result


def _sums(left: Matrix, right: Matrix) -> FloatArray:
    """(k,) products of columns."""
    return np.asarray(left.multiply(right).sum(axis=0)).ravel()


def _inner(left: Matrix, right: Matrix, q: int) -> FloatArray:
    """(g, q, q) products of the columns of each set, which follow each other."""
    found = np.empty((left.shape[1] // q, q, q))
    for i in range(q):
        for j in range(q):
            first, second = left[:, i::q], right[:, j::q]
            product = first * second if isinstance(left, np.ndarray) else first.multiply(second)
            found[:, i, j] = np.asarray(product.sum(axis=0)).ravel()
    return found


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
