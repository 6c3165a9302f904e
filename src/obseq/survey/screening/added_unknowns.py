"""What may be wrong, tested as unknowns that are added to a rejected adjustment: one cause, or two together.

With the columns C of their effect on all residuals, observations and known coordinates, T = (C' P v)'
(C' P Qv P C)^-1 (C' P v) is what they take from the weighted squares, and -(C' P Qv P C)^-1 C' P v are their
sizes. A known coordinate that is wrong has a column with one entry: it is as if it were not known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.survey.screening.contradictions import known_rows, parts_of, through_unknowns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.arrays import FloatArray, IntArray
    from obseq.survey.screening.contradictions import Contradiction, Part

_UNSEEN = 1e-6
"""Share of the weight of an unknown below which nothing shows it."""


@dataclass(frozen=True, eq=False)
class AddedUnknowns:
    """The tests of any unknowns among many.

    Attributes:
        found: the rejected adjustment.
        parts: its observations.
        columns: (n, j) C of the offsets, over the field book; the other unknowns are known coordinates.
        through: (unknowns of the network, k) A' P C.
        shown: (k,) C' P v.
        weights: (k, k) C' P Qv P C.
        whole: (k,) the diagonal of C' P C.
    """

    found: Contradiction
    parts: list[Part]
    columns: FloatArray
    through: FloatArray
    shown: FloatArray
    weights: FloatArray
    whole: FloatArray

    @classmethod
    def of(cls, found: Contradiction, columns: FloatArray, known: IntArray) -> AddedUnknowns:
        """Those of offsets, and after them of known coordinates, in their sigmas.

        Args:
            found: the rejected adjustment.
            columns: (n, j) what an offset of one (m, rad) adds to the residual of each observation.
            known: (i,) rows of the known coordinates, which have no covariance with others.
        """
        parts = list(parts_of(found.equations, found.state, np.arange(len(columns))))
        shown, whole, through = through_unknowns(found.state, parts, columns)
        normalised, rows = known_rows(found, known)
        through = np.ascontiguousarray(np.hstack([through, rows.T]))
        spread = np.eye(through.shape[1])
        spread[: len(whole), : len(whole)] = whole
        weights = spread - through.T @ found.state.solve(through)
        shown = np.concatenate([shown, normalised])
        return cls(found, parts, columns, through, shown, weights, np.diag(spread).copy())

    def test(self, chosen: Sequence[int]) -> tuple[float, FloatArray] | None:
        """T of some of the unknowns together, and their sizes; None where nothing shows some of them."""
        own = list(chosen)
        root = np.sqrt(self.whole[own])
        if not (root > 0.0).all():
            return None
        shares, axes = np.linalg.eigh(self.weights[np.ix_(own, own)] / np.outer(root, root))
        if shares[0] <= _UNSEEN:
            return None
        along = axes.T @ (self.shown[own] / root)
        return float(np.sum(along**2 / shares)), -(axes @ (along / shares)) / root

    def with_each(self, chosen: Sequence[int]) -> FloatArray:
        """(k,) T of some of the unknowns together with each other one; NaN where nothing shows that."""
        own = list(chosen)
        across = np.linalg.solve(self.weights[np.ix_(own, own)], self.weights[own])
        left = self.shown - self.shown[own] @ across
        weight = np.diag(self.weights) - np.einsum("ik,ik->k", self.weights[own], across)
        seen = weight > _UNSEEN * self.whole
        alone = float(self.shown[own] @ np.linalg.solve(self.weights[np.ix_(own, own)], self.shown[own]))
        return np.where(seen, alone + left**2 / np.where(seen, weight, 1.0), np.nan)

    def with_one_observation(self, chosen: Sequence[int], redundancy: FloatArray) -> float:
        """The largest T of some of the unknowns together with a gross error in one observation.

        Args:
            chosen: the unknowns.
            redundancy: (n,) of the observations; NaN where there is none.
        """
        own = list(chosen)
        inverse = np.linalg.inv(self.weights[np.ix_(own, own)])
        solved = self.found.state.solve(np.ascontiguousarray(self.through[:, own]))
        offsets = [k for k in own if k < self.columns.shape[1]]
        best = 0.0
        for rows, root, residuals, jacobian in self.parts:
            effects = -np.asarray(jacobian.T @ solved)
            effects[:, [own.index(k) for k in offsets]] += root @ self.columns[rows][:, offsets]
            left = residuals - effects @ (inverse @ self.shown[own])
            weight = redundancy[rows] - np.einsum("mi,ij,mj->m", effects, inverse, effects)
            seen = weight > _UNSEEN
            best = max(best, float(np.max(left[seen] ** 2 / weight[seen], initial=0.0)))
        return best + float(self.shown[own] @ inverse @ self.shown[own])
