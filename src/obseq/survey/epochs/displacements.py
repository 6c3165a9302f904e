"""Displacements of the points of two epochs, with the covariance of all of them together.

Known coordinates with a sigma that are the same in both epochs are one and the same piece of knowledge: an
error in them moves both epochs alike. With ``K = Q P`` of each epoch (Q cofactors of the points, P weights of
the known coordinates), the covariance of the two is ``K1 P^-1 K2' = Q1 P Q2``, and the cofactors of the
displacements are ``Q1 + Q2 - Q1 P Q2 - Q2 P Q1``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq import crs
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.survey.adjustment.point_system import PointSystem

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.survey.adjustment.adjusted import Adjustment
    from obseq.survey.model import CoordinateCovariance, Points

MOST_POINTS = 3000
SAME = 1e-9
"""Coordinates (m) and sigmas that differ by less are the same."""


@dataclass(frozen=True, eq=False)
class Displacements:
    """Displacements of common points, second epoch minus first.

    Attributes:
        names: (n,) of the points.
        places: (n, 3) in the first epoch, m.
        vectors: (n, 3) m, in the frame.
        cofactors: (3 n, 3 n) of all of them, m^2 for sigma0 1.
        tested: (n,) points that are not held in both epochs.
    """

    names: tuple[str, ...]
    places: FloatArray
    vectors: FloatArray
    cofactors: FloatArray
    tested: BoolArray

    def block(self, row: int) -> FloatArray:
        """(3, 3) cofactors of one displacement."""
        at = slice(3 * row, 3 * row + 3)
        return self.cofactors[at, at]

    def turned(self, axes: FloatArray) -> Displacements:
        """The same along other axes at each point, (n, 3, 3) by rows."""
        blocks = self.cofactors.reshape(len(self.names), 3, len(self.names), 3)
        turned = np.einsum("nij,njmk,mlk->niml", axes, blocks, axes, optimize=True)
        vectors = np.einsum("nij,nj->ni", axes, self.vectors)
        return Displacements(
            self.names, self.places, vectors, turned.reshape(self.cofactors.shape), self.tested
        )


def displacements(first: Adjustment, second: Adjustment, names: tuple[str, ...]) -> Displacements:
    """The displacements of points that both epochs have.

    Raises:
        InputError: the epochs are in different frames, or have too many points in common.
    """
    if first.frame != second.frame:
        raise InputError(
            f"compare: the first epoch is adjusted in {first.frame}, the second in {second.frame}; adjust "
            "both in one frame (--frame)"
        )
    if len(names) > MOST_POINTS:
        raise InputError(
            f"compare: {len(names)} common points need their full covariance, at most {MOST_POINTS} can be "
            "compared at once; name those that matter (--points)"
        )
    rows = [_rows(epoch, names) for epoch in (first, second)]
    places = [epoch.points.coordinates[row] for epoch, row in zip((first, second), rows, strict=True)]
    q1, q2 = (_cofactors(epoch, names) for epoch in (first, second))
    known = [epoch.points.points.subset(row) for epoch, row in zip((first, second), rows, strict=True)]
    system = PointSystem(crs.parse(first.frame), crs.parse(first.points_crs))
    shared = _shared_weights(known[0], known[1], system.axes(known[0].coordinates)[0])
    crossed = q1 @ shared @ q2
    held = [points.is_held.all(axis=1) for points in known]
    return Displacements(
        names,
        places[0],
        places[1] - places[0],
        q1 + q2 - crossed - crossed.T,
        np.asarray(~(held[0] & held[1])),
    )


def _rows(epoch: Adjustment, names: tuple[str, ...]) -> IntArray:
    index = epoch.points.points.index
    return np.array([index[name] for name in names], np.int64)


def _cofactors(epoch: Adjustment, names: tuple[str, ...]) -> FloatArray:
    """(3 n, 3 n) cofactors of points, zero where they are held."""
    cofactors = epoch.solution.cofactors
    scalars = cofactors.table.scalars(cofactors.table.find(names, "Point3"), "compare").ravel()
    return np.asarray(cofactors.between(scalars, scalars))


def _shared_weights(first: Points, second: Points, axes: FloatArray) -> FloatArray:
    """(3 n, 3 n) weights of the known coordinates that both epochs have, in the frame.

    Args:
        first: the common points as the first epoch knows them.
        second: as the second knows them.
        axes: (n, 3, 3) of the system in which they are given, by rows.
    """
    n = len(first)
    alike = np.abs(first.coordinates - second.coordinates).max(axis=1) < SAME
    same_sigmas = np.isclose(first.sigmas, second.sigmas, rtol=0.0, atol=SAME, equal_nan=True)
    spreads = np.where(alike[:, None] & same_sigmas & (first.sigmas > 0.0), first.sigmas, np.inf)
    weights = np.zeros((n, 3, n, 3))
    rows = np.arange(n)
    weights[rows, :, rows] = np.einsum("nki,nk,nkj->nij", axes, np.square(1.0 / spreads), axes)
    flat = weights.reshape(3 * n, 3 * n)
    correlated = first.covariance
    if correlated is None or not _is_same(correlated, second.covariance):
        return flat
    chosen = np.zeros((len(correlated.coordinates), n, 3))
    for k, (name, component) in enumerate(correlated.coordinates):
        if name in first.index:
            chosen[k, first.index[name]] = axes[first.index[name], component]
    rows_of = chosen.reshape(-1, 3 * n)
    return np.asarray(flat + rows_of.T @ np.linalg.solve(correlated.matrix, rows_of))


def _is_same(first: CoordinateCovariance, second: CoordinateCovariance | None) -> bool:
    return second is not None and (
        first.coordinates == second.coordinates
        and bool(np.allclose(first.matrix, second.matrix, rtol=1e-9, atol=0.0))
    )
