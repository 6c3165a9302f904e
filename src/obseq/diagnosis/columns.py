"""The columns of hypotheses over the equations: a plain array where they are few, else a sparse matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from obseq.dataclass import dataclass

if TYPE_CHECKING:
    from scipy.sparse import csc_array

    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.diagnosis.linear import Linear


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
        return np.asarray(np.sqrt(self.matrix.multiply(self.matrix).sum(axis=0))).ravel()

    def scaled(self, lengths: FloatArray) -> Columns:
        """The same divided by lengths (k,)."""
        if isinstance(self.matrix, np.ndarray):
            return Columns(self.matrix / lengths, self.is_local)
        return Columns((self.matrix / lengths[None, :]).tocsc(), self.is_local)

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

    def weights_apart(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, as if its equations had no unknowns in common."""
        shares = 1.0 - linear.leverages
        if isinstance(self.matrix, np.ndarray):
            return np.asarray(shares @ self.matrix**2)
        return np.asarray(self.matrix.multiply(self.matrix).T @ shares)

    def first_weights(self, linear: Linear) -> FloatArray:
        """(k,) M of each, of length 1, where it costs little; NaN of those that a solve each would take."""
        if isinstance(self.matrix, np.ndarray):
            lost = np.einsum("ij,ij->j", *self._through(linear))
            return np.asarray(np.where(self.matrix.any(axis=0), 1.0 - lost, 0.0))
        entries = np.diff(self.matrix.indptr)
        weights = np.where(entries == 0, 0.0, np.nan)
        alone = np.flatnonzero(entries == 1)
        weights[alone] = 1.0 - linear.leverages[self.matrix.indices[self.matrix.indptr[alone]]]
        local = np.flatnonzero((entries > 1) & self.is_local)
        if local.size:
            through = cast("Any", linear.rows).T @ self.matrix[:, local]
            weights[local] = (
                1.0 - np.asarray((linear.cofactors @ through).multiply(through).sum(axis=0)).ravel()
            )
        return weights

    def are_near(self, sets: IntArray) -> BoolArray:
        """(g,) whether the unknowns of all columns of a set (g, q) are joined: M takes no solves."""
        is_plain = isinstance(self.matrix, np.ndarray)
        return np.ones(len(sets), np.bool_) if is_plain else np.asarray(self.is_local[sets].all(axis=1))

    def grams(self, linear: Linear, sets: IntArray) -> FloatArray:
        """(g, q, q) C' R C of small sets (g, q) of columns; by solves where they are not near."""
        g, q = sets.shape
        if isinstance(self.matrix, np.ndarray):
            through, solved = self._through(linear)
            each = self.matrix[:, sets.ravel()].reshape(-1, g, q)
            before, after = (one[:, sets.ravel()].reshape(-1, g, q) for one in (through, solved))
            lost: FloatArray = np.einsum("ugi,ugj->gij", before, after)
            return np.asarray(np.einsum("ngi,ngj->gij", each, each) - lost)
        from scipy.sparse import csc_array

        flat, result = self.matrix[:, sets.ravel()], np.empty((g, q, q))
        rows, cofactors = cast("Any", linear.rows), cast("Any", linear.cofactors)
        across = (rows.T @ flat).tocsc()
        if self.is_local[sets].all():
            left = (cofactors @ across).tocsc()
        else:
            left = csc_array(linear.solve(np.ascontiguousarray(across.toarray())))
        for i in range(q):
            for j in range(i + 1):
                own = flat[:, i::q].multiply(flat[:, j::q]).sum(axis=0)
                off = left[:, i::q].multiply(across[:, j::q]).sum(axis=0)
                result[:, i, j] = result[:, j, i] = np.asarray(own - off).ravel()
        return result

    def _through(self, linear: Linear) -> tuple[FloatArray, FloatArray]:
        """A' C, and Q A' C."""
        through = np.asarray(linear.rows.T @ self.matrix)
        return through, linear.solve(np.ascontiguousarray(through)) if len(through) else through
