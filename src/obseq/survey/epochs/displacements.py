"""Displacements of the points of two epochs, with the covariance of all of them together.

Known coordinates with a sigma that are the same in both epochs are one and the same piece of knowledge: an
error in them moves both epochs alike. With ``K = Q A' P`` of each epoch (Q cofactors of the points, A and P
equations and weights of all its known coordinates), the covariance of the two is ``C = K1 S K2'`` (S the
covariance of what both know alike), and the cofactors of the displacements are ``Q1 + Q2 - C - C'``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from obseq.arrays import BoolArray, FloatArray, IntArray
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.adjustment.adjusted import Adjustment
from obseq.survey.epochs.known_points import cofactors, common, given

MOST_POINTS = 3000


@dataclass(frozen=True, eq=False)
class Displacements:
    """Displacements of common points, second epoch minus first.

    Attributes:
        names: (n,) of the points.
        places: (n, 3) in the first epoch, m.
        vectors: (n, 3) m, in the frame.
        cofactors: (3 n, 3 n) of all of them, m^2 for sigma0 1.
        tested: (n,) points that are not held in both epochs.
        without_height: (n,) points whose height an epoch does not observe; None for none.
    """

    names: tuple[str, ...]
    places: FloatArray
    vectors: FloatArray
    cofactors: FloatArray
    tested: BoolArray
    without_height: BoolArray | None = None

    def block(self, row: int) -> FloatArray:
        """(3, 3) cofactors of one displacement."""
        at = slice(3 * row, 3 * row + 3)
        return self.cofactors[at, at]

    def of(self, rows: IntArray) -> Displacements:
        """Those of some of the points."""
        scalars = (3 * rows[:, None] + np.arange(3)).ravel()
        names = tuple(self.names[row] for row in rows.tolist())
        chosen = self.cofactors[np.ix_(scalars, scalars)]
        lacking = None if self.without_height is None else self.without_height[rows]
        return Displacements(names, self.places[rows], self.vectors[rows], chosen, self.tested[rows], lacking)

    def turned(self, axes: FloatArray) -> Displacements:
        """The same along other axes at each point, (n, 3, 3) by rows."""
        blocks = self.cofactors.reshape(len(self.names), 3, len(self.names), 3)
        turned = np.einsum("nij,njmk,mlk->niml", axes, blocks, axes, optimize=True)
        vectors = np.einsum("nij,nj->ni", axes, self.vectors)
        return replace(self, vectors=vectors, cofactors=turned.reshape(self.cofactors.shape))


def displacements(first: Adjustment, second: Adjustment, names: tuple[str, ...]) -> Displacements:
    """The displacements of points that both epochs have.

    Raises:
        InputError: the epochs, or their known points, are in different systems; too many points in common.
    """
    if first.frame != second.frame:
        raise InputError(
            f"compare: the first epoch is adjusted in {first.frame}, the second in {second.frame}; adjust "
            "both in one frame (--frame)"
        )
    if first.points_crs != second.points_crs and len(first.known) and len(second.known):
        raise InputError(
            f"compare: the points of the first epoch are given in {first.points_crs}, those of the second in "
            f"{second.points_crs}, and known coordinates of both count; convert one of the point files "
            "(obseq convert), or give reference points (--reference)"
        )
    if len(names) > MOST_POINTS:
        raise InputError(
            f"compare: {len(names)} common points need their full covariance, at most {MOST_POINTS} can be "
            "compared at once; name those that matter (--points)"
        )
    rows = [_rows(epoch, names) for epoch in (first, second)]
    places = [epoch.points.places[row] for epoch, row in zip((first, second), rows, strict=True)]
    q1, q2 = (cofactors(epoch, names, names) for epoch in (first, second))
    crossed = common(given(first, names), given(second, names))
    known = [epoch.points.points.subset(row) for epoch, row in zip((first, second), rows, strict=True)]
    held = [points.is_held.all(axis=1) for points in known]
    unknown = known[0].is_invented | known[1].is_invented
    seen = ~unknown.ravel()
    return Displacements(
        names,
        places[0],
        np.where(unknown, 0.0, places[1] - places[0]),
        (q1 + q2 - crossed - crossed.T) * np.outer(seen, seen),
        np.asarray(~(held[0] & held[1])),
        np.asarray(unknown[:, 2]),
    )


def _rows(epoch: Adjustment, names: tuple[str, ...]) -> IntArray:
    index = epoch.points.points.index
    return np.array([index[name] for name in names], np.int64)
